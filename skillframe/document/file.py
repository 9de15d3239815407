r"""The skill file: a JSON document of what was learned, from what, by whom, and in which frame.

Layout, on which scripts can rely: `format`, `version`, `type`, `type_version`, `created_by`, `learned_from` [{`file`,
`sha256`, `simulated`, `teacher`}], `frame` (points and axes, see `skillframe.document.frame`) and `phases`, a list
whose items depend on the type. Keys are sorted, a list of numbers stands on one line, and numbers are exact.

On the command line and in campaigns, a skill is named by its file, or by its kind and demonstrations.
"peg.skill.json" is a skill file. "replay:demo1.npz" learns the kind `replay` from that file in memory; more files and
the learner's settings follow after commas: "lmc:a.npz,b.npz", "replay:demo1.npz,mode=absolute".

The text is a skill file if such a file exists, if it has no colon, or if the text before the first colon cannot be a
kind ("results/v1:peg.json", "C:\\peg.json"). After the colon, the longest run of parts that names a file is one
demonstration ("a,b.npz", "speed=2.npz"). The rest is a setting if its KEY is a name, otherwise a missing demonstration.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from skillframe import __version__
from skillframe.config import LARGEST, parse_setting
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import demand, read_frame, refuse_unfit
from skillframe.errors import InputError, UnknownName
from skillframe.extend.records import CoordinatorType, Document, LearnOptions, SkillType
from skillframe.extend.registry import registry
from skillframe.files import write_whole
from skillframe.files.documents import check_plain, parse_json, read_text, refuse_other, shown

FORMAT, VERSION = "skillframe.skill", 1
_KINDS = {
    "format": str, "version": int, "type": str, "created_by": dict, "learned_from": list,
    "frame": dict, "phases": list,
}  # fmt: skip
_GIVE, _AGAIN = "give a file written by skillframe learn", "learn the skill again"


def new_document(skill: SkillType, body: Document, demonstrations: Sequence[Demonstration] = ()) -> Document:
    """A whole skill document from a learner's body.

    Args:
        skill: the kind of skill.
        body: `frame`, `phases` and further keys of the kind.
        demonstrations: of the learning; their files are hashed, or their arrays if in memory.

    Raises:
        InputError: the body breaks the layout.
    """
    created_by = {"skillframe": __version__}
    with suppress(UnknownName):  # an unregistered record, as in tests
        kind = "coordinator" if isinstance(registry().behaviour(skill.name), CoordinatorType) else "skill"
        plugin = registry().provider(kind, skill.name)
        created_by |= {"plugin": plugin.distribution, "plugin_version": plugin.version}
    document = {
        **body,
        "format": FORMAT,
        "version": VERSION,
        "type": skill.name,
        "type_version": skill.version,
        "created_by": created_by,
        "learned_from": [_source(demonstration) for demonstration in demonstrations],
    }
    _check(document, f"skill type {skill.name}")
    return document


def _source(demonstration: Demonstration) -> dict[str, Any]:
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
    """Write a skill file as a whole.

    Raises:
        InputError: the document breaks the layout, or the file cannot be written.
    """
    _check(document, str(path))
    write_whole(path, to_text(document).encode())


def to_text(document: Document) -> str:
    """The document as JSON text: sorted keys, two spaces a level, a list of numbers on one line."""
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
        InputError: missing, truncated, not JSON, of a newer version, an absent or invalid key, or a number that is not
            finite; names the key.
        UnknownName: no such kind of skill is installed.
    """
    refuse_other(path, "skill")
    document = parse_json(read_text(path, _GIVE), path, _GIVE)
    if not isinstance(document, dict):
        raise InputError(path, "is not a skill file: it holds no JSON object", _GIVE)
    return checked(document, path)


def checked(document: Document, where: object) -> Document:
    """Check a document as `load` does, and return it.

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
    """Turn errors of a kind of skill in an invalid document into one sentence.

    Raises:
        InputError: in place of errors of Python or numpy about a value's type, size or shape.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError) as error:
        said = f"{type(error).__name__}: {' '.join(str(error).split())}"[:200]
        raise InputError(where, f"holds something that its kind of skill cannot use ({said})", _AGAIN) from error


def _check(document: Document, where: str) -> None:
    """Check the common layout. `SkillType.check` checks the rest."""
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
        finite = abs(value) <= sys.float_info.max  # an integer in JSON may be longer
        yield spot, "is beyond any physical size" if finite else "is not a finite number"
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _no_numbers(item, f"{spot}.{key}" if spot else str(key))
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            yield from _no_numbers(item, f"{spot}[{i}]")


NO_KIND = re.compile(r"[^:]*[/\\][^:]*:|:|[A-Za-z]:\\")
"""A text without a kind before the first colon: a path, nothing, or a drive of Windows."""
SETTING = re.compile(r"\s*[A-Za-z_][\w.-]*\s*=")


def learned(skill: SkillType, demonstrations: Sequence[Demonstration], options: LearnOptions | None = None) -> Document:
    """A whole skill document, learned from demonstrations.

    Raises:
        InputError: this kind of skill is not learned, the demonstrations are of different tools or hold a stall, or the
            learner refuses them.
    """
    from skillframe.document.file import new_document

    if skill.learn is None:
        raise InputError(
            f"skill type {skill.name}", "is not learned from demonstrations", "write its skill file by hand"
        )
    refuse_unfit(demonstrations)
    body = skill.learn(demonstrations, options or LearnOptions())
    return new_document(skill, body, demonstrations)


class SkillSource(NamedTuple):
    """The parts of a skill's name.

    Attributes:
        kind: of a skill to be learned; "" for a skill file.
        files: the skill file, or the demonstrations.
        settings: "KEY=VALUE" for the learner.
    """

    kind: str
    files: tuple[str, ...]
    settings: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The name as written."""
        parts = ",".join((*self.files, *self.settings))
        return f"{self.kind}:{parts}" if self.kind else parts

    @property
    def label(self) -> str:
        """Name in a campaign's results: the text with file names instead of paths."""
        return _label(self)

    @property
    def name(self) -> str:
        """Name in a single run: the skill file's name without its ending, or the kind."""
        return self.kind or Path(self.files[0]).name.removesuffix(".json").removesuffix(".skill")

    def moved(self, place: Callable[[str], str]) -> SkillSource:
        """A copy with every file replaced."""
        return self._replace(files=tuple(place(file) for file in self.files))


@lru_cache(maxsize=1024)
def _label(source: SkillSource) -> str:
    """Cached, as tables use it once per row."""
    return source.moved(lambda file: Path(file).name).text


def parse_source(text: str, folder: Path | None = None) -> SkillSource:
    """Parse a skill's name. Files are looked for and not opened.

    Raises:
        InputError: a kind without a demonstration.
    """
    base = folder or Path()
    kind, colon, rest = text.partition(":")
    if not colon or NO_KIND.match(text) or _is_file(base, text):
        return SkillSource("", (text,))
    files, settings = _parts(rest, base)
    if not files:
        raise InputError(text, "names no demonstration", f"write for example {kind}:demo.npz")
    return SkillSource(kind, tuple(files), tuple(settings))


def _parts(rest: str, base: Path) -> tuple[list[str], list[str]]:
    files: list[str] = []
    settings: list[str] = []
    parts = rest.split(",")
    while parts:
        ends = (end for end in range(len(parts), 0, -1) if _is_file(base, ",".join(parts[:end])))
        if end := next(ends, 0):
            files.append(",".join(parts[:end]))
        elif parts[0]:
            (settings if SETTING.match(parts[0]) else files).append(parts[0])
        parts = parts[end or 1 :]
    return files, settings


def _is_file(base: Path, name: str) -> bool:
    """Whether a file exists, False for texts that cannot be a name."""
    return os.path.isfile(base / name)


def load_skill(text: str, folder: Path | None = None) -> tuple[str, Document]:
    """Name and document of a skill from "FILE.skill.json" or "TYPE:DEMO[,DEMO...][,KEY=VALUE...]".

    Raises:
        InputError: a file cannot be used, or no demonstration is given.
        UnknownName: no such kind of skill.
    """
    from skillframe.extend.reading import read_demonstration

    source, base = parse_source(text, folder), folder or Path()
    if not source.kind:
        return source.name, load(base / source.files[0])
    skill = registry().skill(source.kind)
    options = LearnOptions(settings=dict(parse_setting(part) for part in source.settings))
    return source.name, learned(skill, [read_demonstration(base / file) for file in source.files], options)
