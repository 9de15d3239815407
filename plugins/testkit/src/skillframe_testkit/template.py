"""The plug-in template: files in `plugin_template/` with placeholders.

`common/` is in every plug-in, `kinds/KIND/` in those of a kind; `hook.in`, `about.in` and `try.in` of the kinds are
combined in the entry module and the README.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from skillframe.errors import InputError
from skillframe.extend import CONTRACT
from skillframe.files import write_whole

TEMPLATE = Path(__file__).resolve().parent / "plugin_template"
ENDING = ".in"
KINDS = ("skill", "segmenter", "world", "coordinator", "reader", "exporter", "score", "robot", "drive", "section")
EVERY = "all"


def plugin_name(text: str) -> str:
    """A valid module name: "My-Skill" becomes "my_skill".

    Raises:
        InputError: it cannot be the name of a module.
    """
    name = re.sub(r"^skillframe_", "", text.strip().lower().replace("-", "_").replace(" ", "_"))
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise InputError(f"plug-in name {text!r}", "is not a name", "use letters, digits and underscores: my_skill")
    return name


def write_template(name: str, folder: Path, kinds: Sequence[str] = ("skill",)) -> Iterator[Path]:
    """Write the template into a new or empty folder, and yield each file.

    Args:
        name: of the plug-in and its records, as from `plugin_name`.
        folder: to write.
        kinds: some of `KINDS`; "all" for one of each.

    Raises:
        InputError: the folder is not empty.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "exists and is not an empty folder", "give another one with --out")
    chosen = [kind for kind in KINDS if kind in kinds or EVERY in kinds]
    words = _words(name, chosen)
    for root in (TEMPLATE / "common", *(TEMPLATE / "kinds" / kind for kind in chosen)):
        for source in sorted(path for path in root.rglob(f"*{ENDING}") if path.parent != root or root.name == "common"):
            target = folder / _filled(source.relative_to(root).as_posix().removesuffix(ENDING), words)
            write_whole(target, _filled(source.read_text(encoding="utf-8"), words).encode())
            yield target


def _words(name: str, kinds: Sequence[str]) -> dict[str, str]:
    """Values of placeholders, kinds first because these contain placeholders."""
    records = [f"{kind.capitalize()}Type" for kind in kinds]
    records = sorted([*records, "Lazy"] if set(kinds) - {"world", "robot"} else records)
    lines = "(\n" + "".join(f"    {record},\n" for record in records) + ")"
    named = [f"a {kind}" if kind != "exporter" else "an exporter" for kind in kinds]
    major, minor = version("skillframe").split(".")[:2]
    return {
        "HOOKS": "".join(f"\n\n{_part(kind, 'hook')}" for kind in kinds).rstrip("\n"),
        "BULLETS": "".join(_part(kind, "about") for kind in kinds).rstrip("\n"),
        "TRY": "".join(_part(kind, "try") for kind in kinds).rstrip("\n"),
        "RECORDS": ", ".join(records) if len(records) < 4 else lines,
        "STDLIB": "from pathlib import Path\n" if "robot" in kinds else "",
        "KINDS": named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}",
        "PACKAGE": f"skillframe_{name}",
        "DISTRIBUTION": f"skillframe-{name.replace('_', '-')}",
        "NAME": name,
        "CLASS": "".join(part.capitalize() for part in name.split("_")),
        "CONTRACT": CONTRACT,
        "RANGE": f">={major}.{minor},<{major}.{int(minor) + 1}",
    }


def _part(kind: str, part: str) -> str:
    return (TEMPLATE / "kinds" / kind / f"{part}{ENDING}").read_text(encoding="utf-8")


def _filled(text: str, words: dict[str, str]) -> str:
    """Text with placeholders (@KEY@, or part of a path) replaced."""
    for key, word in words.items():
        text = text.replace(f"@{key}@", word)
    return text
