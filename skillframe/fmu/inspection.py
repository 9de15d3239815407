"""Facts and validation of FMU files without loading their code.

Untrusted files are read in a child under limits, because a description may exhaust time and memory.
"""

from __future__ import annotations

import re
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

from skillframe.errors import InputError
from skillframe.fmu.child import Child, ChildLost, SandboxLimits
from skillframe.fmu.extract import content_hash, description_folder, is_allowed, member_names
from skillframe.fmu.facts import FmuFacts, FmuVariable

READING_S, WAITING_S = 60, 900.0
"""Processor and wall time for a description [s]."""


def inspect_fmu(path: Path) -> FmuFacts:
    """Facts of an FMU file, read in a child if untrusted.

    Raises:
        InputError: not an FMU, an unsafe one, or an invalid model description.
        ChildLost: time or memory exceeded.
    """
    path, digest = path.resolve(), content_hash(path)
    known = _KNOWN.get((path, digest))
    if known is not None:
        return known
    member_names(path)
    return inspect_here(path) if is_allowed(path) else facts_from(_asked(path, b"i"), path)


_KNOWN: dict[tuple[Path, str], FmuFacts] = {}


def _asked(path: Path, letter: bytes) -> Any:
    limits = SandboxLimits()
    child = Child(path, path.stem, limits)
    try:
        given = {"path": str(path), "processor_s": READING_S}
        most_bytes = 64 * 1024**2
        return child.ask(letter, given, WAITING_S, "its description was read", most_bytes)
    finally:
        child.close()


def describe_here(facts: FmuFacts) -> dict[str, Any]:
    """Facts as plain values, without path and inaccessible variables."""
    told = {name: v for name, v in facts.variables.items() if v.causality in ("input", "output", "parameter")}
    return {**asdict(replace(facts, variables=told)), "path": ""}


def facts_from(given: dict[str, Any], path: Path) -> FmuFacts:
    """Facts from `describe_here`, cached for `inspect_fmu`."""
    lists = {name: tuple(given[name]) for name in ("kinds", "platforms", "source_files", "definitions")}
    variables = {name: FmuVariable(**v) for name, v in given["variables"].items()}
    facts = FmuFacts(**{**given, **lists, "path": path, "variables": variables})
    _KNOWN[path, facts.digest] = facts
    return facts


def inspect_here(path: Path) -> FmuFacts:
    """`inspect_fmu` in this process.

    Raises:
        InputError: as `inspect_fmu`.
    """
    return _inspect(path.resolve(), content_hash(path))


@lru_cache(maxsize=64)
def _inspect(path: Path, digest: str) -> FmuFacts:
    names = member_names(path)
    description = read_description(path)
    cs = description.coSimulation
    kinds = {
        "co_simulation": cs, "model_exchange": description.modelExchange,
        "scheduled_execution": description.scheduledExecution,
    }  # fmt: skip
    first = next((kind for kind in kinds.values() if kind is not None), None)
    for kind in kinds.values():
        if kind is not None and re.search(r"[^\w.-]|\.\.|^$", kind.modelIdentifier or ""):
            problem = f"has the model identifier {kind.modelIdentifier!r}, which is no name of a file"
            raise InputError(path, problem, "do not trust this file" if kind.modelIdentifier else "export it again")
    files, definitions = _sources(description, cs.modelIdentifier if cs else "")
    identifier = first.modelIdentifier if first is not None else ""
    found = {
        p.parts[1] for p in map(PurePosixPath, names)
        if len(p.parts) == 3 and p.parts[0] == "binaries" and p.stem == identifier
        and p.suffix in (".so", ".dll", ".dylib")
    }  # fmt: skip
    platforms = tuple(sorted(found))
    from fmpy import platform, platform_tuple

    return FmuFacts(
        path=path,
        digest=digest,
        fmi_version=description.fmiVersion,
        name=" ".join((description.modelName or path.stem).split()) or path.stem,
        kinds=tuple(kind for kind, there in kinds.items() if there is not None),
        platforms=platforms,
        has_sources=any(PurePosixPath(n).parts[0] == "sources" and n.endswith((".c", ".cpp")) for n in names),
        runs_here=str(platform if description.fmiVersion.startswith("2") else platform_tuple) in platforms,
        saves_state=bool(cs and cs.canGetAndSetFMUstate),
        serializes_state=bool(cs and cs.canSerializeFMUstate),
        variable_step=bool(cs and cs.canHandleVariableCommunicationStepSize),
        input_derivatives=bool(cs and cs.canInterpolateInputs and description.fmiVersion.startswith("2")),
        variables={v.name: _variable(v) for v in description.modelVariables},
        token=description.guid or description.instantiationToken,
        identifier=cs.modelIdentifier if cs else "",
        needs_tool=bool(cs and cs.needsExecutionTool),
        source_files=files,
        definitions=definitions,
        units={unit.name: _base_unit(unit.baseUnit) for unit in description.unitDefinitions if unit.baseUnit},
    )


def read_description(path: Path) -> Any:
    """Model description by fmpy, without strict validation.

    Raises:
        InputError: invalid XML, or FMI 1.
    """
    with description_folder(path, 100_000) as folder:  # most variables
        try:
            description = _read(folder, validate=False)
        except Exception as error:
            raise InputError(
                path, f"has a model description that cannot be read: {_why(folder, error)}", "export it again"
            ) from None
    if description.fmiVersion.startswith("1"):
        raise InputError(path, "is an FMI 1.0 unit", "export it as FMI 2.0 or 3.0 co-simulation")
    if (description.guid or description.instantiationToken) is None:
        token = "guid" if description.fmiVersion.startswith("2") else "instantiationToken"
        raise InputError(path, f"has a model description without {token}", "export it again")
    return description


def _read(folder: Path, validate: bool) -> Any:
    from fmpy import read_model_description

    return read_model_description(str(folder), validate=validate)


def _why(folder: Path, error: Exception) -> str:
    from fmpy.model_description import ValidationError
    from lxml.etree import LxmlError  # type: ignore[import-untyped]

    if isinstance(error, OSError):
        return "its text is not in the encoding that it names"
    if isinstance(error, LxmlError | ValidationError) or type(error) is Exception:
        return _line(error)
    try:
        _read(folder, validate=True)
    except (ValidationError, LxmlError) as found:
        return _line(found).partition(": - ")[2].partition(" - ERROR")[0] or _line(found)
    except Exception:
        pass
    return "it is not built as the standard says, or names no version of it"


def problems_of(path: Path) -> tuple[list[str], str]:
    """Result of `judge_here`, in a child if untrusted, and why it failed, or ""."""
    if is_allowed(path):
        return judge_here(path), ""
    try:
        return [str(problem) for problem in _asked(path, b"j")], ""
    except ChildLost as lost:
        return [], f"not validated: {lost}"


def judge_here(path: Path) -> list[str]:
    """Problems found by fmpy: schema, names, structure, units, start values.

    Findings about aliases in FMI 3 are dropped: they share their variable's entry, which fmpy 0.3 ignores.
    """
    from fmpy.validation import validate_fmu

    found = [" ".join(str(problem).split()) for problem in validate_fmu(str(path))]
    description = read_description(path)
    there = {unknown.variable.name for unknown in description.initialUnknowns}
    shared = {v.name for v in description.modelVariables if v.alias is not None and v.alias.name in there}
    expected, actual = (", ".join(sorted(names)) for names in (there | shared, there))
    where = "ModelStructure/InitialUnknowns does not contain the expected set of variables."
    of_aliases = f"{where} Expected {{{expected}}} but was {{{actual}}}."
    return [problem for problem in found if not shared or problem != of_aliases]


def _sources(description: Any, identifier: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    files: list[str] = []
    options: list[str] = []
    for configuration in getattr(description, "buildConfigurations", []):
        if configuration.modelIdentifier != identifier:
            continue
        for group in configuration.sourceFileSets:
            files += group.sourceFiles
            options += [f"-D{d.name}={d.value}" if d.value else f"-D{d.name}" for d in group.preprocessorDefinitions]
            options += [f"-I{folder}" for folder in group.includeDirectories]
    return tuple(dict.fromkeys(files)), tuple(options)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


def _base_unit(base: Any) -> dict[str, float]:
    named = {name: getattr(base, name) for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")}
    return {name: value for name, value in named.items() if value not in (0, float(name == "factor"))}


def _variable(v: Any) -> FmuVariable:
    size = 1
    for length in v.shape or ():
        size *= int(length)
    start = v.start if v.start is None else str(v.start)
    return FmuVariable(
        name=v.name, reference=v.valueReference, type=v.type, causality=v.causality or "local", size=size,
        start=start, unit=v.unit or "",
        text=" ".join((v.description or "").split()),
    )  # fmt: skip
