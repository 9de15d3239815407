"""The plug-in template: files in `plugin_template/`, with names and a few words filled in."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator
from pathlib import Path

from skillframe.errors import InputError
from skillframe.files import write_whole

TEMPLATE = Path(__file__).resolve().parent / "plugin_template"
ENDING = ".in"


def plugin_name(text: str) -> str:
    """A name as Python and file systems like it: "My-Skill" becomes "my_skill".

    Raises:
        InputError: it cannot be the name of a module.
    """
    name = re.sub(r"^skillframe_", "", text.strip().lower().replace("-", "_").replace(" ", "_"))
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise InputError(f"plug-in name {text!r}", "is not a name", "use letters, digits and underscores: my_skill")
    return name


def write_template(name: str, folder: Path) -> Iterator[Path]:
    """Write the template into a new or empty folder, giving each file as it is written.

    Raises:
        InputError: the folder exists and holds something.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "exists and is not an empty folder", "give another one with --out")
    words = {
        "PACKAGE": f"skillframe_{name}",
        "DISTRIBUTION": f"skillframe-{name.replace('_', '-')}",
        "NAME": name,
        "CLASS": "".join(part.capitalize() for part in name.split("_")),
    }
    for source in sorted(path for path in TEMPLATE.rglob(f"*{ENDING}")):
        target = folder / _filled(source.relative_to(TEMPLATE).as_posix().removesuffix(ENDING), words)
        write_whole(target, _filled(source.read_text(encoding="utf-8"), words).encode())
        yield target


def _filled(text: str, words: dict[str, str]) -> str:
    """Text with each placeholder, a word in capitals between two at signs or a path's part, replaced."""
    for key, word in words.items():
        text = text.replace(f"@{key}@", word)
    return text
