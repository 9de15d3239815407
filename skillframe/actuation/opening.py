"""Open a bank of actuators for a robot: in this process, in child processes, or as the Python reference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skillframe.actuation.actuator import Actuators, ActuatorSpec
from skillframe.actuation.allow import is_allowed
from skillframe.actuation.build import cached_path
from skillframe.actuation.inspection import FmuFacts, inspect_fmu
from skillframe.actuation.library import find_fmu, fmu_folders
from skillframe.actuation.toolchain import find_compiler

CYLINDER = "hydraulic_cylinder"


def open_actuators(
    specs: Sequence[ActuatorSpec], trials: int = 1, base: Path | None = None, version: int = 2
) -> Actuators:
    """A bank for these actuators, `trials` times.

    FMUs that are foreign and not allowed run in child processes, so that one trial's failure stays its own. Without a C
    compiler, a robot whose actuators are all `hydraulic_cylinder` gets the Python reference, which `notes` says.

    Args:
        specs: the actuators.
        trials: how many times.
        base: folder that relative paths start from.
        version: of the standard, for our own FMUs.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: see `find_fmu` and the banks.
    """
    folders = fmu_folders()
    named = all(spec.fmu == CYLINDER for spec in specs)
    if named and find_compiler() is None and not cached_path(folders[CYLINDER], version).is_file():
        from skillframe.actuation.reference import ReferenceBank
        from skillframe.actuation.table import read_table

        return ReferenceBank(specs, read_table(folders[CYLINDER]), trials)
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
    from skillframe.actuation.mixed import MixedBank

    return MixedBank(specs, banks)


def _bank(allowed: bool, specs: Sequence[ActuatorSpec], facts: Sequence[FmuFacts], trials: int) -> Actuators:
    """A bank in this process, or in children."""
    if allowed:
        from skillframe.actuation.driver import FmuBank

        return FmuBank(specs, facts, trials)
    from skillframe.actuation.sandbox import SandboxBank

    return SandboxBank(specs, facts, trials)
