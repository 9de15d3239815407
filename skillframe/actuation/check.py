"""`check_fmu`: facts, validation, and a short trial in a child process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skillframe.actuation.child import Child, SandboxLimits
from skillframe.actuation.inspection import FmuFacts, inspect_fmu, problems_of
from skillframe.errors import SkillframeError

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
    state = "claimed" if facts.saves_state else "none"
    try:
        facts.require_runnable()
    except SkillframeError as error:
        problems.append(str(error))
    else:
        state, trouble = _try(facts, state)
        problems += trouble
    return {
        "fmi_version": facts.fmi_version, "kinds": list(facts.kinds), "platforms": list(facts.platforms),
        "has_sources": facts.has_sources, "inputs": facts.names("input"), "outputs": facts.names("output"),
        "state_capability": state, "problems": problems,
    }  # fmt: skip


def _try(facts: FmuFacts, state: str) -> tuple[str, list[str]]:
    """Load, initialise, step ten times; save and restore where that is claimed."""
    child = Child(facts.path, facts.name, LIMITS)
    try:
        repeats = child.ask(b"k", {"path": str(facts.path)}, LIMITS.start_s, "being tried out")
    except SkillframeError as error:
        return state, [str(error)]
    finally:
        child.close()
    if state == "none":
        return "none", []
    return ("exact", []) if repeats else ("broken", ["its state can be saved but does not repeat when restored"])
