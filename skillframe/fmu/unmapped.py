"""Variables of an actuator's FMU that no mapping names: an input that nobody writes keeps its start value."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from skillframe.errors import UnknownName
from skillframe.fmu.actuator import INPUTS, OUTPUTS, ActuatorSpec
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.library import find_fmu, fmu_folders
from skillframe.fmu.table import read_table


class Unmapped(NamedTuple):
    """Of one FMU: the joints that it drives, its inputs that nobody writes with their start values, outputs unread."""

    fmu: str
    joints: tuple[str, ...]
    inputs: dict[str, str]
    outputs: tuple[str, ...]

    @property
    def sentences(self) -> list[str]:
        """One for the inputs and one for the outputs, where there are such."""
        whose, found = f"of {self.fmu} on {', '.join(self.joints)}", []
        if self.inputs:
            kept = ", ".join(f"{name} ({start})" for name, start in self.inputs.items())
            found.append(f"no inputs entry writes {kept} {whose}; such an input keeps its start value")
        if self.outputs:
            found.append(f"no outputs entry reads {', '.join(self.outputs)} {whose}")
        return found


def unmapped(
    specs: Sequence[ActuatorSpec], unused: Sequence[Sequence[str]], base: Path | None = None
) -> list[Unmapped]:
    """What nobody maps, a row for every FMU and mapping. Joints that have them alike stand in one row.

    Args:
        specs: the actuators; names are those of their joints.
        unused: of each actuator, variables that are left alone on purpose.
        base: folder that relative paths start from.

    Raises:
        InputError, UnknownName: an FMU cannot be found or read, or has no variable of a name in `unused`.
    """
    rows: dict[tuple[object, ...], Unmapped] = {}
    for spec, meant in zip(specs, unused, strict=True):
        inputs, outputs = _variables(spec.fmu, base)
        for name in meant:
            if name not in inputs and name not in outputs:
                known = [*inputs, *outputs]
                raise UnknownName("input or output", name, known, f"in unused of the [[actuation]] of {spec.name}")
        written = set(spec.inputs.values() or INPUTS) | set(meant)
        read = set(spec.outputs.values() or OUTPUTS) | set(meant)
        row = Unmapped(
            spec.fmu, (), {name: start for name, start in inputs.items() if name not in written},
            tuple(name for name in outputs if name not in read),
        )  # fmt: skip
        key = (row.fmu, tuple(row.inputs.items()), row.outputs)
        rows[key] = row._replace(joints=(*rows.get(key, row).joints, spec.name))
    return [row for row in rows.values() if row.inputs or row.outputs]


def _variables(fmu: str, base: Path | None) -> tuple[dict[str, str], list[str]]:
    """Inputs with their start values, and outputs. Of a named FMU from its table, so that nothing need be built."""
    if (folder := fmu_folders().get(fmu)) is not None:
        table = read_table(folder)
        return {name: f"{entry.start:g}" for name, entry in table.input.items()}, list(table.output)
    facts = inspect_fmu(find_fmu(fmu, base))
    return {name: facts.variables[name].start or "0" for name in facts.names("input")}, facts.names("output")
