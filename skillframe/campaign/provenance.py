"""What a result depends on besides the campaign: versions, code, processor and hashes of its files.

"NAME code" is a hash of a package's files on disk, so that edited code is recognised. Rows are bit-identical on one
kind of machine with one set of versions; replays name differences.

Identity of a worker: versions, processor and plug-ins, compared before it gets work.

A worker is refused if its rows might differ: another version of Python, skillframe or a numerical library, another
processor architecture, or a needed plug-in that is absent, of another version or broken.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.spec import CampaignSpec
from skillframe.document.file import parse_source

LIBRARIES = ("skillframe", "numpy", "scipy", "mujoco", "pin")
CODE = " code"  #: suffix of a plug-in's name in the table of hashes, for the hash of its code
MACHINE = ("platform", "processor")


def environment() -> dict[str, str]:
    """Versions and code hashes of what computes, and the machine."""
    return dict(_environment(tuple(sys.path), os.environ.get("SKILLFRAME_PLUGINS")))


@lru_cache(maxsize=8)
def _environment(path: tuple[str, ...], selected: str | None) -> Mapping[str, str]:
    """Cached, since a process keeps running the code that it imported."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        processor = platform.processor() or platform.machine()
    return {"python": platform.python_version(), "platform": platform.platform(), "processor": processor,
            **versions_on_disk()}  # fmt: skip


def versions_on_disk() -> dict[str, str]:
    """Versions and code hashes of libraries and plug-ins as installed now, whatever this process has imported."""
    setting = os.environ.get("SKILLFRAME_PLUGINS")
    wanted = None if setting is None else {name.strip() for name in setting.split(",")}
    plugins: dict[str, tuple[str, set[str]]] = {}
    for point in metadata.entry_points(group="skillframe"):
        if point.dist is not None and (wanted is None or point.name in wanted):
            _, modules = plugins.setdefault(str(point.dist.name), (str(point.dist.version), set()))
            modules.add(point.module.partition(".")[0])
    found = {name: _version(name) for name in LIBRARIES}
    found |= {name: version for name, (version, _) in sorted(plugins.items()) if name not in found}
    code = {"skillframe": {"skillframe"}} | {name: modules for name, (_, modules) in sorted(plugins.items())}
    return found | {f"{name}{CODE}": code_hash(modules) for name, modules in code.items()}


def installed() -> dict[str, str]:
    """Versions and code that a new process would run, without the machine."""
    return software({**environment(), **versions_on_disk()})


def software(found: Mapping[str, str]) -> dict[str, str]:
    """An environment without the machine."""
    return {name: text for name, text in found.items() if name not in MACHINE}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def code_hash(modules: Iterable[str]) -> str:
    """SHA-256 of the files of packages or modules and their names, without .pyc files."""
    total = hashlib.sha256()
    for module in sorted(modules):
        spec = None
        with suppress(ImportError, ValueError):  # a broken plug-in, which `plugins` reports
            spec = find_spec(module)
        places = [] if spec is None else [Path(place) for place in spec.submodule_search_locations or ()]
        files = [(file, file.relative_to(place).as_posix()) for place in places for file in place.rglob("*")]
        if spec is not None and not places and spec.origin:
            files = [(Path(spec.origin), Path(spec.origin).name)]
        for file, name in sorted(files, key=lambda pair: pair[1]):
            if file.is_file() and file.suffix != ".pyc":
                total.update(f"{module} {name} {file_hash(file)}\n".encode())
    return total.hexdigest()


def environment_differences(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """One line per entry that differs."""
    names = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    return [f"{name}: {then.get(name, 'absent')} then, {now.get(name, 'absent')} now" for name in names]


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def file_hashes(folder: Path, parts: tuple[str, ...]) -> dict[str, str]:
    """SHA-256 of every file under some sub-folders, by path relative to the folder."""
    files = sorted(path for part in parts for path in (folder / part).rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): file_hash(path) for path in files}


def combined_hash(content: Mapping[str, Any]) -> str:
    """SHA-256 of plain values in canonical JSON."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def edited_results(folder: Path, summary: Mapping[str, Any] | None) -> str:
    """A sentence if results.csv differs from its SHA-256 in summary.json, otherwise "".

    A summary without a hash gives "".
    """
    path = folder / "results.csv"
    hashes = (summary or {}).get("hashes")
    stated = hashes.get(path.name) if isinstance(hashes, dict) else None
    if not isinstance(stated, str) or not path.is_file() or file_hash(path) == stated:
        return ""
    return (
        "results.csv is not as the campaign wrote it: its SHA-256 is not the one in summary.json; "
        "skillframe campaign resume writes it again from rows.jsonl"
    )


SAME = ("python", *LIBRARIES)


class Identity(NamedTuple):
    """Identity of a process.

    Attributes:
        environment: as `provenance.environment`.
        architecture: of the processor: "x86_64".
        plugins: version by distribution, with any error: "0.2.0 (ImportError: ...)".
        provides: names of each distribution: "skill:lmc".
    """

    environment: dict[str, str]
    architecture: str
    plugins: dict[str, str]
    provides: dict[str, tuple[str, ...]]


def identity(plugins: bool = True) -> Identity:
    """Identity of this process. With `plugins` it loads their entry modules."""
    if not plugins:
        return Identity(environment(), platform.machine(), {}, {})
    from skillframe.extend.registry import registry

    found: dict[str, list[Any]] = {}
    for plugin in registry().plugins:
        found.setdefault(plugin.distribution, []).append(plugin)
    versions = {
        name: f"{group[0].version}" + "".join(f" ({p.error})" for p in group if p.error)
        for name, group in found.items()
    }
    provides = {name: tuple(sorted(x for p in group for x in p.provides)) for name, group in found.items()}
    return Identity(environment(), platform.machine(), versions, provides)


def needed_plugins(spec: CampaignSpec, ours: Identity) -> set[str]:
    """Distributions that provide any name that the campaign's skills, world or scores mention.

    Errs towards too many: every word of a skill file counts, and every reader where a skill is learned on the spot.
    """
    words, readers = {spec.world, *spec.scores}, False
    for text in spec.skills:
        entry = parse_source(text, spec.folder)
        if entry.kind:
            readers = True
            words.add(entry.kind)
            continue
        with suppress(OSError, ValueError, RecursionError):
            words |= set(_words(json.loads((spec.folder / entry.files[0]).read_bytes())))
    return {
        distribution
        for distribution, names in ours.provides.items()
        if any(name.partition(":")[2] in words or (readers and name.startswith("reader:")) for name in names)
    }


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _words(inner)


class Comparison(NamedTuple):
    """Differences of a worker, in words: those that exclude it, and those worth a notice."""

    refused: list[str]
    noted: list[str]


def compared(ours: Identity, theirs: Identity, needed: set[str]) -> Comparison:
    """Compare a worker with this process."""
    here, there = ours.environment, theirs.environment
    refused = [
        f"{name} {there.get(name, 'absent')} there, {here.get(name, 'absent')} here"
        for name in SAME if there.get(name) != here.get(name)
    ]  # fmt: skip
    if ours.architecture != theirs.architecture:
        refused.append(f"a {theirs.architecture} processor there, {ours.architecture} here")
    noted: list[str] = []
    for name in sorted({*ours.plugins, *theirs.plugins} - {"skillframe"}):
        mine, other = ours.plugins.get(name, "absent"), theirs.plugins.get(name, "absent")
        if mine != other or ours.provides.get(name) != theirs.provides.get(name):
            text = f"plug-in {name} {other} there, {mine} here"
            (refused if name in needed else noted).append(text if mine != other else f"{text}, with other names in it")
    return Comparison(refused, noted)
