"""Open a bank of actuators for a hydraulic machine: its FMUs, or the Python reference where they cannot be built."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skillframe.fmu.actuator import Actuators, ActuatorSpec
from skillframe.fmu.build import cached_path
from skillframe.fmu.library import fmu_folders
from skillframe.fmu.opening import open_actuators
from skillframe.fmu.toolchain import find_compiler

CYLINDER = "hydraulic_cylinder"


def open_cylinders(
    specs: Sequence[ActuatorSpec], trials: int = 1, base: Path | None = None, version: int = 2
) -> Actuators:
    """A bank for these actuators. Arguments and errors are those of `skillframe.fmu.opening.open_actuators`.

    Without a C compiler, a machine whose actuators are all `hydraulic_cylinder` gets the Python reference, which
    `notes` says.
    """
    folder = fmu_folders()[CYLINDER]
    named = all(spec.fmu == CYLINDER for spec in specs)
    if named and find_compiler() is None and not cached_path(folder, version).is_file():
        from skillframe.fmu.table import read_table
        from skillframe.machine.cylinder.reference import ReferenceBank

        return ReferenceBank(specs, read_table(folder), trials)
    return open_actuators(specs, trials, base, version)
