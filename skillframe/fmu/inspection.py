"""What an FMU is and can do, read from its file without loading any of its code.

A file that is not trusted is read in a child process under limits: its description may be made to take all time and
memory. What comes back is as small as what is used of it.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

from skillframe.errors import InputError, UnknownName
from skillframe.fmu.allow import is_allowed
from skillframe.fmu.extract import content_hash, description_folder, member_names

FLOATS = ("Real", "Float64")
MOST_VARIABLES = 100_000
LONGEST_FACTS = 64 * 1024**2  # bytes of the facts of one FMU
READING_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """A variable of an FMU.

    Attributes:
        name, reference: its name and value reference; type: "Real", "Float64", "Boolean" ...
        causality: "input", "output", "parameter" ...; size: number of scalars (FMI 3 arrays).
        start: as written in the model description, or None; unit, text: unit and what it is, or "".
    """

    name: str
    reference: int
    type: str
    causality: str
    size: int = 1
    start: str | None = None
    unit: str = ""
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuFacts:
    """What the file says.

    Attributes:
        path, digest: the file and the SHA-256 of its content.
        fmi_version: "2.0", "3.0" ...; name: the model's name.
        kinds: of "co_simulation", "model_exchange", "scheduled_execution".
        platforms: folders of binaries inside that hold a library of the model; has_sources: carries C sources.
        runs_here: one of the platforms is this machine's.
        saves_state, serializes_state, variable_step, input_derivatives: claimed capabilities of co-simulation.
        variables: by name; locals are left out of what is read in a child.
        token, identifier, needs_tool: what instantiation takes, the library's name, whether its maker's tool is needed.
        source_files, definitions: C sources of co-simulation and compiler options, as listed.
    """

    path: Path
    digest: str
    fmi_version: str
    name: str
    kinds: tuple[str, ...]
    platforms: tuple[str, ...]
    has_sources: bool
    runs_here: bool
    saves_state: bool
    serializes_state: bool
    variable_step: bool
    input_derivatives: bool
    variables: dict[str, FmuVariable]
    token: str = ""
    identifier: str = ""
    needs_tool: bool = False
    source_files: tuple[str, ...] = ()
    definitions: tuple[str, ...] = ()

    def names(self, causality: str) -> list[str]:
        """Names of the variables of a causality, in the file's order."""
        return [v.name for v in self.variables.values() if v.causality == causality]

    def variable(self, name: str, causality: str, what: str = "") -> FmuVariable:
        """The variable of a name.

        Raises:
            UnknownName: there is none, or it is not of that causality; suggests the nearest.
        """
        found = self.variables.get(name)
        if found is None or found.causality != causality:
            note = what or (f"{name!r} is there as {found.causality}" if found else "")
            raise UnknownName(f"{causality} of {self.path.name}", name, self.names(causality), note)
        return found

    def settable(self, name: str) -> FmuVariable:
        """The parameter or input of a name. Raises `UnknownName` as `variable` does."""
        found = self.variables.get(name)
        if found is not None and found.causality in ("parameter", "input"):
            return found
        note = f"{name!r} is there as {found.causality}" if found else ""
        known = [*self.names("input"), *self.names("parameter")]
        raise UnknownName(f"parameter or input of {self.path.name}", name, known, note)

    def require_runnable(self) -> None:
        """Refuse what cannot be driven here, saying what is inside.

        Raises:
            InputError: no co-simulation, or no binary for this machine.
        """
        if "co_simulation" not in self.kinds:
            inside = " and ".join(self.kinds) + " only" if self.kinds else "no interface that can be run"
            raise InputError(self.path, f"holds {inside}", "export it as co-simulation")
        if self.runs_here:
            return
        from fmpy import platform, platform_tuple

        here = platform if self.fmi_version.startswith("2") else platform_tuple
        inside = f"holds binaries for {', '.join(self.platforms)}" if self.platforms else "holds no binaries"
        if self.has_sources:
            fix = f"it carries C sources: type skillframe fmu build {self.path}"
        else:
            fix = f"and no sources; ask its maker for {here} or for sources"
        raise InputError(self.path, f"{inside}, this machine is {here}", fix)


def inspect_fmu(path: Path) -> FmuFacts:
    """Facts of an FMU file. One that is not allowed inside this process is read in a child.

    Raises:
        InputError: not an FMU, one that would escape its folder, or a model description that cannot be read.
        ChildLost: reading it took more time or memory than it may.
    """
    path, digest = path.resolve(), content_hash(path)
    known = _KNOWN.get((path, digest))
    if known is not None:
        return known
    member_names(path)
    return inspect_here(path) if is_allowed(path) else facts_from(_asked(path, b"i"), path)


_KNOWN: dict[tuple[Path, str], FmuFacts] = {}


def _asked(path: Path, letter: bytes) -> Any:
    """An answer about a description from a child that has loaded nothing of the FMU."""
    from skillframe.fmu.child import Child, SandboxLimits

    limits = SandboxLimits()
    child = Child(path, path.stem, limits)
    try:
        return child.ask(letter, {"path": str(path)}, READING_S, "its description was read", LONGEST_FACTS)
    finally:
        child.close()


def describe_here(facts: FmuFacts) -> dict[str, Any]:
    """Facts as plain values, without the path and without variables that no one can set or read by name."""
    told = {name: v for name, v in facts.variables.items() if v.causality in ("input", "output", "parameter")}
    return {**asdict(replace(facts, variables=told)), "path": ""}


def facts_from(given: dict[str, Any], path: Path) -> FmuFacts:
    """Facts out of `describe_here`. `inspect_fmu` keeps them for this process."""
    lists = {name: tuple(given[name]) for name in ("kinds", "platforms", "source_files", "definitions")}
    variables = {name: FmuVariable(**v) for name, v in given["variables"].items()}
    facts = FmuFacts(**{**given, **lists, "path": path, "variables": variables})
    _KNOWN[path, facts.digest] = facts
    return facts


def inspect_here(path: Path) -> FmuFacts:
    """As `inspect_fmu`, in this process.

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
    platforms = _platforms(names, first.modelIdentifier if first is not None else "")
    return FmuFacts(
        path=path,
        digest=digest,
        fmi_version=description.fmiVersion,
        name=" ".join((description.modelName or path.stem).split()) or path.stem,
        kinds=tuple(kind for kind, there in kinds.items() if there is not None),
        platforms=platforms,
        has_sources=any(PurePosixPath(n).parts[0] == "sources" and n.endswith((".c", ".cpp")) for n in names),
        runs_here=_here(description.fmiVersion) in platforms,
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
    )


def read_description(path: Path) -> Any:
    """The model description as fmpy reads it, without its strict validation (`problems_of` does that).

    Raises:
        InputError: the XML cannot be read, or is of FMI 1.
    """
    with description_folder(path, MOST_VARIABLES) as folder:
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
    """What is wrong with a description, in the words of the XML reader or of the standard's schema."""
    from fmpy.model_description import ValidationError
    from lxml.etree import LxmlError  # type: ignore[import-untyped]

    if isinstance(error, OSError):  # lxml's, for bytes of another encoding
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


def problems_of(path: Path) -> list[str]:
    """As `judge_here`, in a child where the file is not trusted.

    Raises:
        ChildLost: it took more time or memory than it may.
    """
    return judge_here(path) if is_allowed(path) else [str(problem) for problem in _asked(path, b"j")]


def judge_here(path: Path) -> list[str]:
    """What fmpy's validation finds: schema, names, structure, units, start values.

    An alias of FMI 3 shares the entries of its variable; fmpy 0.3 asks for entries of its own, which is left out here.
    """
    from fmpy.validation import validate_fmu

    found = [" ".join(str(problem).split()) for problem in validate_fmu(str(path))]
    return [problem for problem in found if problem not in _asked_of_aliases(path)]


def _asked_of_aliases(path: Path) -> set[str]:
    """What fmpy says where every initial unknown is there, and only their aliases have no entry."""
    description = read_description(path)
    there = {unknown.variable.name for unknown in description.initialUnknowns}
    shared = {v.name for v in description.modelVariables if v.alias is not None and v.alias.name in there}
    expected, actual = (", ".join(sorted(names)) for names in (there | shared, there))
    where = "ModelStructure/InitialUnknowns does not contain the expected set of variables."
    return {f"{where} Expected {{{expected}}} but was {{{actual}}}."} if shared else set()


def _sources(description: Any, identifier: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Source files, definitions and include folders as listed (fmpy reads both versions' lists)."""
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


def _here(version: str) -> str:
    from fmpy import platform, platform_tuple

    return str(platform if version.startswith("2") else platform_tuple)


def _platforms(names: list[str], identifier: str) -> tuple[str, ...]:
    found = {
        p.parts[1] for p in map(PurePosixPath, names)
        if len(p.parts) == 3 and p.parts[0] == "binaries" and p.stem == identifier
        and p.suffix in (".so", ".dll", ".dylib")
    }  # fmt: skip
    return tuple(sorted(found))


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
