"""Open a bank of actuators for a robot: in this process, in child processes, or some in each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skillframe.fmu.actuator import Actuators, ActuatorSpec
from skillframe.fmu.allow import is_allowed
from skillframe.fmu.inspection import FmuFacts, inspect_fmu
from skillframe.fmu.library import find_fmu


def open_actuators(
    specs: Sequence[ActuatorSpec], trials: int = 1, base: Path | None = None, version: int = 2
) -> Actuators:
    """A bank for these actuators, `trials` times.

    FMUs that are foreign and not allowed run in child processes, so that one trial's failure stays its own.

    Args:
        specs: the actuators.
        trials: how many times.
        base: folder that relative paths start from.
        version: of the standard, for our own FMUs.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: see `find_fmu` and the banks.
    """
    paths = [find_fmu(spec.fmu, base, version) for spec in specs]
    facts = [inspect_fmu(path) for path in paths]
    kinds: dict[bool, list[int]] = {}
    for index, path in enumerate(paths):
        kinds.setdefault(is_allowed(path), []).append(index)
    banks = [
        (chosen, _bank(allowed, [specs[i] for i in chosen], [facts[i] for i in chosen], trials))
        for allowed, chosen in sorted(kinds.items(), reverse=True)
    ]
    if len(banks) == 1:
        return banks[0][1]
    from skillframe.fmu.mixed import MixedBank

    return MixedBank(specs, banks)


def _bank(allowed: bool, specs: Sequence[ActuatorSpec], facts: Sequence[FmuFacts], trials: int) -> Actuators:
    """A bank in this process, or in children."""
    if allowed:
        from skillframe.fmu.driver import FmuBank

        return FmuBank(specs, facts, trials)
    from skillframe.fmu.sandbox import SandboxBank

    return SandboxBank(specs, facts, trials)
