"""Check of an FMU: facts, validation, and a short test in a child process, and compilation of its C sources.

Sources may prefix the interface functions (FMI 2.0.4, section 2.1.1: `FMI2_FUNCTION_PREFIX`); the linker then adds
plain names.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from skillframe.errors import InputError, SkillframeError
from skillframe.files import cache_dir
from skillframe.fmu.bindings import NOT_LOADED
from skillframe.fmu.build import BuiltFmu, compile_library, pack
from skillframe.fmu.child import Child, SandboxLimits
from skillframe.fmu.extract import content_hash, forget, is_unpacked, unpack
from skillframe.fmu.facts import FmuFacts
from skillframe.fmu.inspection import inspect_fmu, problems_of
from skillframe.fmu.sandbox import loading

LIMITS = SandboxLimits()
HARMLESS = ("ModelStructure/InitialUnknowns", "The file path ")
"""Beginnings of harmless findings: incomplete lists for solvers; backslashes."""


def check_fmu(path: Path) -> dict[str, Any]:
    """Facts and problems of an FMU, as in `fmu --json`.

    `state_capability` is "exact" if steps repeated from a saved state are identical, "broken" if not, "claimed" if
    untested, else "none".

    Raises:
        InputError: not an FMU, or it would escape its folder.
    """
    facts = inspect_fmu(path)
    problems, undone = problems_of(path)
    notes = [undone] if undone else []
    state, confinement = ("claimed" if facts.saves_state else "none"), dict[str, Any]()
    try:
        facts.require_runnable()
    except SkillframeError as error:
        problems.append(str(error))
    else:
        state, confinement, trouble = _try(facts, state)
        if not trouble:
            notes += [problem for problem in problems if problem.startswith(HARMLESS)]
            problems = [problem for problem in problems if not problem.startswith(HARMLESS)]
        problems += trouble
    return {
        "fmi_version": facts.fmi_version, "kinds": list(facts.kinds), "platforms": list(facts.platforms),
        "has_sources": facts.has_sources, "inputs": facts.names("input"), "outputs": facts.names("output"),
        "state_capability": state, "problems": problems, "confinement": confinement,
        "notes": notes,
    }  # fmt: skip


def unloadable(facts: FmuFacts) -> str:
    """Reason why an FMU's library does not load, or "". Removes what it unpacks."""
    try:
        said = " ".join(_try(facts, "none")[2])
    finally:
        forget(facts.path)
    return said if NOT_LOADED in said else ""


def _try(facts: FmuFacts, state: str) -> tuple[str, dict[str, Any], list[str]]:
    """Test loading, initialisation, ten steps and state. Returns state capability, confinement and problems."""
    confined: dict[str, Any] = {}
    before = is_unpacked(facts.path)
    unpack(facts.path)
    child = Child(facts.path, facts.name, LIMITS)
    try:
        confined = child.ask(b"h", None, LIMITS.start_s, "being started")
        repeats = child.ask(b"k", loading(facts), LIMITS.start_s, "being tried out")
        if not isinstance(repeats, bool):
            raise child.liar("no yes or no", "being tried out")
    except SkillframeError as error:
        if not before:
            forget(facts.path)
        return state, confined, [str(error)]
    finally:
        child.close()
    if state == "none":
        return "none", confined, []
    wrong = [] if repeats else ["its state can be saved but does not repeat when restored"]
    return "exact" if repeats else "broken", confined, wrong


def confinement_in_words(found: dict[str, Any]) -> str:
    """Confinement of untrusted FMUs on this system, as text."""
    if not found:
        return "not tried"
    version = found.get("landlock", 0)
    where = "memory" if found.get("memory_folder") else "a temporary folder"
    writes = f"writes files only in {where} that is removed (Landlock {version})" if version else ""
    sees = "sees no process but its own (process namespace)" if found.get("namespace") else ""
    lacks = "" if version else "this system has no Landlock: it can write whatever you can write"
    return "; ".join(text for text in (writes, sees, lacks) if text)


def build_from_sources(path: Path) -> BuiltFmu:
    """Copy of an FMU with a binary for this machine, cached, and not allowed in-process.

    Raises:
        InputError: no listed C sources.
        CompilerFailed, MissingDependency: as `compile_library`.
    """
    import fmpy

    facts = inspect_fmu(path)
    if not facts.has_sources:
        raise InputError(path, "carries no C sources", f"ask its maker for {fmpy.platform} or for sources")
    out = cache_dir("fmus-compiled") / content_hash(path)[:24] / path.name
    if "co_simulation" not in facts.kinds:
        raise InputError(path, f"holds {' and '.join(facts.kinds)} only", "export it as co-simulation")
    files, defines = list(facts.source_files), list(facts.definitions)
    if not files:
        raise InputError(path, "does not list its source files", "ask its maker for a binary")
    for name in files:
        if name.startswith("-") or not (unpack(path) / "sources" / name).is_file() or ".." in Path(name).parts:
            raise InputError(path, f"lists the source {name!r}, which is not in its folder sources", "export it again")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as work:
        tree = Path(work) / "tree"
        shutil.copytree(unpack(path), tree)
        library = facts.identifier + fmpy.sharedLibraryExtension
        headers = Path(fmpy.__file__).parent / "c-code"
        extra = ["-fvisibility=default", f"-I{headers}", "-std=gnu11", *defines]
        compile_library(files, library, tree / "sources", extra)
        if plain := _without_prefix((tree / "sources" / library).read_bytes()):
            compile_library(files, library, tree / "sources", [*extra, *plain])
        where = tree / "binaries" / (fmpy.platform if facts.fmi_version.startswith("2") else fmpy.platform_tuple)
        where.mkdir(parents=True, exist_ok=True)
        os.replace(tree / "sources" / library, where / library)
        made = pack(tree, Path(work) / path.name)
        if trouble := unloadable(inspect_fmu(made)):
            raise InputError(made.name, f"was built, and {trouble}", "ask its maker for a binary")
        os.replace(made, out)
    return BuiltFmu(name=facts.name, fmi_version=facts.fmi_version, path=out)


def _without_prefix(library: bytes) -> list[str]:
    names = {found.decode() for found in re.findall(rb"\0(\w*fmi[23][A-Z]\w*)(?=\0)", library)}
    prefixes = {found[1] for name in names if (found := re.fullmatch(r"(\w+?)fmi[23]Instantiate\w*", name))}
    if len(prefixes) != 1 or any(re.fullmatch(r"fmi[23]Instantiate\w*", name) for name in names):
        return []
    prefix = prefixes.pop()
    return [f"-Wl,--defsym={n.removeprefix(prefix)}={n}" for n in sorted(names) if n.startswith(f"{prefix}fmi")]
