"""The skill file: one readable JSON document that says what was learned, from what, by whom, and in which frame.

Layout (fixed outside, so that scripts can rely on it): `format`, `version`, `type`, `type_version`, `created_by`,
`learned_from` [{`file`, `sha256`, `simulated`, `teacher`}], `frame` (points and axes, see `skillframe.document.frame`)
and `phases`, a list whose items belong to the type. Keys are sorted, a row of numbers stands on one line, and every
number comes back to the last bit: Python writes the shortest decimal that does.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from skillframe import __version__
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import read_frame
from skillframe.document.keys import demand
from skillframe.errors import InputError, UnknownName
from skillframe.extend.records import CoordinatorType, Document, SkillType
from skillframe.extend.registry import registry
from skillframe.files import write_whole
from skillframe.files.documents import check_plain, parse_json, read_text, shown

LARGEST = 1e100  # beyond it squares overflow
FORMAT, VERSION = "skillframe.skill", 1
_KINDS = {
    "format": str, "version": int, "type": str, "created_by": dict, "learned_from": list,
    "frame": dict, "phases": list,
}  # fmt: skip
_GIVE, _AGAIN = "give a file written by skillframe learn", "learn the skill again"


def new_document(skill: SkillType, body: Document, demonstrations: Sequence[Demonstration] = ()) -> Document:
    """A whole skill document around what a learner gives.

    Args:
        skill: the kind of skill that learned it.
        body: `frame`, `phases` and whatever else the kind keeps.
        demonstrations: what it was learned from; their files are hashed, or their arrays where they have no file.

    Raises:
        InputError: the body breaks the layout.
    """
    document = {
        **body,
        "format": FORMAT,
        "version": VERSION,
        "type": skill.name,
        "type_version": skill.version,
        "created_by": _creator(skill.name),
        "learned_from": [_source(demonstration) for demonstration in demonstrations],
    }
    _check(document, f"skill type {skill.name}")
    return document


def _creator(name: str) -> dict[str, str]:
    try:
        kind = "coordinator" if isinstance(registry().behaviour(name), CoordinatorType) else "skill"
        plugin = registry().provider(kind, name)
    except UnknownName:  # a record that was never registered, as in tests
        return {"skillframe": __version__}
    return {"skillframe": __version__, "plugin": plugin.distribution, "plugin_version": plugin.version}


def _source(demonstration: Demonstration) -> dict[str, Any]:
    """A demonstration's file and hash, and who taught: a simulated person, or whom a recording shows."""
    path = Path(demonstration.source) if demonstration.source else None
    digest = hashlib.sha256()
    if path is not None and path.is_file():
        digest.update(path.read_bytes())
    else:
        for array in (demonstration.time, demonstration.position, demonstration.quaternion, demonstration.wrench):
            digest.update(array.astype("<f8").tobytes())
    kind = demonstration.meta.get("teacher")
    return {
        "file": shown(demonstration.source) or "(in memory)", "sha256": digest.hexdigest(),
        "simulated": bool(demonstration.meta.get("simulated")), **({"teacher": kind} if isinstance(kind, str) else {}),
    }  # fmt: skip


def save(document: Document, path: Path) -> None:
    """Write a skill file, whole or not at all.

    Raises:
        InputError: the document breaks the layout, or the file cannot be written.
    """
    _check(document, str(path))
    write_whole(path, to_text(document).encode())


def to_text(document: Document) -> str:
    """The document as JSON text: sorted keys, two spaces a level, a row of numbers on one line."""
    return _layout(document, "") + "\n"


def _layout(value: Any, indent: str) -> str:
    inner = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{inner}{json.dumps(key)}: {_layout(value[key], inner)}" for key in sorted(value)]
        return "{\n" + ",\n".join(lines) + "\n" + indent + "}"
    if isinstance(value, list | tuple) and any(isinstance(item, list | tuple | dict) for item in value):
        return "[\n" + ",\n".join(inner + _layout(item, inner) for item in value) + "\n" + indent + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def load(path: Path) -> Document:
    """Read and check a skill file.

    Raises:
        InputError: missing, truncated, not JSON, of a newer version, a key that is absent or holds the wrong thing, a
            number that is not finite; names the key.
        UnknownName: no such kind of skill is installed.
    """
    return checked(_parse(path), path)


def checked(document: Document, where: object) -> Document:
    """The same document, checked as `load` does.

    Args:
        document: as read.
        where: its file, for messages.

    Raises:
        InputError, UnknownName: as `load`.
    """
    _check(document, str(where))
    try:
        skill = registry().behaviour(document["type"])
    except UnknownName as error:
        raise UnknownName(error.kind, error.name, error.known, where=str(where)) from None
    if document.get("type_version", 1) > skill.version:
        raise InputError(
            where,
            f"holds version {document['type_version']} of skill type {skill.name}, newer than {skill.version}",
            "update the plug-in that provides it",
        )
    try:
        if skill.check is not None:
            with understood(where):
                skill.check(document)
        if skill.describe is not None:
            with understood(where):
                skill.describe(document)
    except InputError as error:
        spot = where if error.where == str(where) else f"{where}: {error.where}"
        raise InputError(spot, error.problem, error.fix) from None
    return document


@contextmanager
def understood(where: object) -> Iterator[None]:
    """What a kind of skill stumbles over in a document that keeps the common layout, as one sentence.

    Raises:
        InputError: in place of whatever Python or numpy said of a value of another type, size or shape.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError) as error:
        said = f"{type(error).__name__}: {' '.join(str(error).split())}"[:200]
        raise InputError(where, f"holds something that its kind of skill cannot use ({said})", _AGAIN) from error


def _parse(path: Path) -> Document:
    document = parse_json(read_text(path, _GIVE), path, _GIVE)
    if not isinstance(document, dict):
        raise InputError(path, "is not a skill file: it holds no JSON object", _GIVE)
    return document


def _check(document: Document, where: str) -> None:
    """The layout that every kind of skill shares. The kind's own part is its own business (`SkillType.check`)."""
    if document.get("format") != FORMAT:
        raise InputError(where, f"has format {document.get('format')!r}, not {FORMAT!r}", "give a skill file")
    version = document.get("version")
    if isinstance(version, int) and version > VERSION:
        raise InputError(where, f"is a skill file of version {version}, newer than {VERSION}", "update skillframe")
    for key, kind in _KINDS.items():
        demand(document, key, kind, where)
    if "type_version" in document:
        demand(document, "type_version", int, where)
    for key in ("version", "type_version"):
        if document.get(key, 1) < 1:
            raise InputError(f"{where}: {key}", f"is {document[key]}, and versions count from 1", "fix it")
    for spot, problem in _no_numbers(document, ""):
        raise InputError(f"{where}: {spot}", problem, "correct it, or learn the skill again")
    check_plain(document, where, _AGAIN)
    read_frame(document, where)
    for i, source in enumerate(document["learned_from"]):
        for key in ("file", "sha256"):
            demand(source, key, str, where, f"learned_from[{i}]")
    for i, phase in enumerate(document["phases"]):
        if not isinstance(phase, dict):
            raise InputError(f"{where}: phases[{i}]", "is not an object", _AGAIN)


def _no_numbers(value: Any, spot: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, float | int) and not -LARGEST <= value <= LARGEST:
        finite = abs(value) <= sys.float_info.max  # a whole number in JSON may be longer
        yield spot, "is beyond any physical size" if finite else "is not a finite number"
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _no_numbers(item, f"{spot}.{key}" if spot else str(key))
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            yield from _no_numbers(item, f"{spot}[{i}]")
