"""The plug-in template: files in `plugin_template/`, with names and a few words filled in.

`common/` is in every plug-in, `kinds/KIND/` where it is asked for; `hook.in`, `about.in` and `try.in` of a kind are put
together in the entry module and in the README.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from skillframe.errors import InputError
from skillframe.extend.contract import CONTRACT
from skillframe.files import write_whole

TEMPLATE = Path(__file__).resolve().parent / "plugin_template"
ENDING = ".in"
KINDS = ("skill", "segmenter", "world", "coordinator", "reader", "exporter", "score", "robot", "drive", "section")
EVERY = "all"


def plugin_name(text: str) -> str:
    """A name as Python and file systems like it: "My-Skill" becomes "my_skill".

    Raises:
        InputError: it cannot be the name of a module.
    """
    name = re.sub(r"^skillframe_", "", text.strip().lower().replace("-", "_").replace(" ", "_"))
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise InputError(f"plug-in name {text!r}", "is not a name", "use letters, digits and underscores: my_skill")
    return name


def write_template(name: str, folder: Path, kinds: Sequence[str] = ("skill",)) -> Iterator[Path]:
    """Write the template into a new or empty folder, giving each file as it is written.

    Args:
        name: of the plug-in and its records, as from `plugin_name`.
        folder: where it goes.
        kinds: what it provides, of `KINDS`; "all" for one of each.

    Raises:
        InputError: the folder exists and holds something.
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
    """What stands for each placeholder. Parts of kinds first, because they hold placeholders themselves."""
    records = sorted(f"{kind.capitalize()}Type" for kind in kinds)
    lazy = ["Lazy"] if set(kinds) - {"world", "robot"} else []
    return {
        "HOOKS": "".join(f"\n\n{_part(kind, 'hook')}" for kind in kinds).rstrip("\n"),
        "BULLETS": "".join(_part(kind, "about") for kind in kinds).rstrip("\n"),
        "TRY": "".join(_part(kind, "try") for kind in kinds).rstrip("\n"),
        "RECORDS": _imported(sorted([*lazy, *records])),
        "STDLIB": "from pathlib import Path\n" if "robot" in kinds else "",
        "KINDS": _enumerated([f"a {kind}" if kind != "exporter" else "an exporter" for kind in kinds]),
        "PACKAGE": f"skillframe_{name}",
        "DISTRIBUTION": f"skillframe-{name.replace('_', '-')}",
        "NAME": name,
        "CLASS": "".join(part.capitalize() for part in name.split("_")),
        "CONTRACT": CONTRACT,
        "RANGE": _range(),
    }


def _part(kind: str, part: str) -> str:
    return (TEMPLATE / "kinds" / kind / f"{part}{ENDING}").read_text(encoding="utf-8")


def _imported(names: Sequence[str]) -> str:
    """Names after `import`, a line each where there are many."""
    return ", ".join(names) if len(names) < 4 else "(\n" + "".join(f"    {name},\n" for name in names) + ")"


def _enumerated(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _range() -> str:
    """The versions of skillframe that a plug-in which is written now asks for: this minor version."""
    from skillframe import __version__

    major, minor = __version__.split(".")[:2]
    return f">={major}.{minor},<{major}.{int(minor) + 1}"


def _filled(text: str, words: dict[str, str]) -> str:
    """Text with each placeholder, a word in capitals between two at signs or a path's part, replaced."""
    for key, word in words.items():
        text = text.replace(f"@{key}@", word)
    return text
