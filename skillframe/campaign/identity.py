"""Who a worker is: versions, processor and plug-ins, compared with ours before it is given work.

A worker whose versions of Python, skillframe or the libraries that compute differ, or whose processor is of another
architecture, may give other rows, and gets none. So does one that lacks a plug-in that the campaign needs, has another
version of it, or could not load it. Plug-ins that this campaign does not need may differ; that is only said. So may the
operating system and the processor's model, which are noted with the rows (`store`).
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.provenance import LIBRARIES, environment
from skillframe.campaign.spec import CampaignSpec
from skillframe.document.source import parse_source

SAME = ("python", *LIBRARIES)


class Identity(NamedTuple):
    """What a process is.

    Attributes:
        environment: as `provenance.environment`.
        architecture: of the processor: "x86_64".
        plugins: by distribution, its version, and its error if it did not load: "0.2.0 (ImportError: ...)".
        provides: by distribution, what it provides: "skill:lmc".
    """

    environment: dict[str, str]
    architecture: str
    plugins: dict[str, str]
    provides: dict[str, tuple[str, ...]]


def identity(plugins: bool = True) -> Identity:
    """What this process is. With plug-ins it loads their entry modules, as any run does."""
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
    """Distributions that the campaign may need: any that provides a name that its skills, world or scores mention.

    Rather one too many: every word in a skill file counts, and where a skill is learned on the spot every reader does.
    """
    words, readers = {spec.world, *spec.scores}, False
    for text in spec.skills:
        entry = parse_source(text, spec.folder)
        readers |= bool(entry.kind)
        words |= {entry.kind} if entry.kind else set(_words(_document(spec.folder / entry.files[0])))
    return {
        distribution
        for distribution, names in ours.provides.items()
        if any(name.partition(":")[2] in words or (readers and name.startswith("reader:")) for name in names)
    }


def _document(path: Path) -> Any:
    """A skill file's content. Nothing if it cannot be read, which the workers will say."""
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _words(inner)


class Comparison(NamedTuple):
    """How a worker differs from us: in what keeps it from work, and in what is only worth saying, in words."""

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
