"""`check_fmu`: facts, validation, and a short trial in a child process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skillframe.errors import SkillframeError
from skillframe.fmu.child import Child, SandboxLimits
from skillframe.fmu.extract import forget, is_unpacked, unpack
from skillframe.fmu.inspection import FmuFacts, inspect_fmu, problems_of
from skillframe.fmu.sandbox import loading

LIMITS = SandboxLimits()  # of the short trial


def check_fmu(path: Path) -> dict[str, Any]:
    """What an FMU is, and what is wrong with it (contract: `fmu check --json`).

    `state_capability` is "exact" where saving, stepping, restoring and stepping again was tried and repeated to the
    bit, "claimed" where that could not be tried here, "broken" where it did not repeat, and "none".

    Raises:
        InputError: not an FMU at all, or one that would escape its folder.
    """
    facts = inspect_fmu(path)
    problems = problems_of(path)
    state, confinement = ("claimed" if facts.saves_state else "none"), dict[str, Any]()
    try:
        facts.require_runnable()
    except SkillframeError as error:
        problems.append(str(error))
    else:
        state, confinement, trouble = _try(facts, state)
        problems += trouble
    return {
        "fmi_version": facts.fmi_version, "kinds": list(facts.kinds), "platforms": list(facts.platforms),
        "has_sources": facts.has_sources, "inputs": facts.names("input"), "outputs": facts.names("output"),
        "state_capability": state, "problems": problems, "confinement": confinement,
    }  # fmt: skip


def _try(facts: FmuFacts, state: str) -> tuple[str, dict[str, Any], list[str]]:
    """Load, initialise, step ten times, save and restore if claimed. Returns what confined it and what went wrong.

    What was unpacked here of an FMU that does not get through is removed.
    """
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
    """What holds an FMU that is not trusted on this system, as `fmu check` says it."""
    if not found:
        return "not tried"
    version = found.get("landlock", 0)
    where = "memory" if found.get("memory_folder") else "a temporary folder"
    writes = f"writes files only in {where} that is removed (Landlock {version})" if version else ""
    sees = "sees no process but its own (process namespace)" if found.get("namespace") else ""
    lacks = "" if version else "this system has no Landlock: it can write whatever you can write"
    return "; ".join(text for text in (writes, sees, lacks) if text)
