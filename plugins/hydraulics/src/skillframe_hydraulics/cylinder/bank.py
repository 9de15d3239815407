"""Actuators of a machine's trials, reused between runs, and their parameters by trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.fmu import (
    INPUTS,
    OUTPUTS,
    Actuators,
    ActuatorSpec,
    cached_path,
    find_compiler,
    fmu_folders,
    kept,
    open_actuators,
)
from skillframe.frames import Float
from skillframe.robot import Actuation, RobotSpec
from skillframe_hydraulics.checks.figures import CYLINDER, completed


def banks(
    spec: RobotSpec, trials: int, ports: Sequence[str] = (), *, lines: tuple[Sequence[str], Sequence[str]] = ((), ())
) -> Actuators:  # fmt: skip
    """A bank of a robot's actuators, the last one again if it fits, since opening FMUs takes tenths of a second.

    `ports` are inputs that faults need, `lines` inputs and outputs that supply lines need.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: an actuator cannot be opened.
    """
    specs = []
    for own in map(_as_spec, spec.actuation):
        lacking = [] if own.fmu == CYLINDER else [name for name in ports if name not in own.inputs]
        if lacking:
            text = f"its FMU has no input for {' and '.join(lacking)}, so that it cannot break so"
            cure = "map one under inputs of its [[actuation]], or leave it out"
            raise InputError(f"robot {spec.name}, {own.name}", text, cure)
        fed = bool(lines[0]) and own.fmu == CYLINDER  # another maker's maps what a line needs, or no line feeds it
        needed = {*ports, *lines[0]} if fed else {*ports}
        mapped = {name: name for name in (*(() if own.inputs else INPUTS), *sorted(needed))}
        own = replace(own, inputs={**mapped, **own.inputs}) if needed else own
        if fed:
            shown = {name: name for name in (*(() if own.outputs else OUTPUTS), *lines[1])}
            own = replace(own, outputs={**shown, **own.outputs})
        specs.append(own)
    return kept((str(spec.folder), repr(specs), trials), lambda: open_cylinders(specs, trials, spec.folder))


def open_cylinders(specs: Sequence[ActuatorSpec], trials: int = 1, base: Path | None = None) -> Actuators:
    """A bank for these actuators, of FMI 2. Arguments and errors as `skillframe.fmu.opening.open_actuators`.

    Without a C compiler, a machine with only `hydraulic_cylinder` uses the Python reference, with a note.
    """
    folder = fmu_folders()[CYLINDER]
    named = all(spec.fmu == CYLINDER for spec in specs)
    if named and find_compiler() is None and not cached_path(folder, 2).is_file():
        from skillframe.fmu import read_table
        from skillframe_hydraulics.cylinder.reference import ReferenceBank

        return ReferenceBank(specs, read_table(folder), trials)
    return open_actuators(specs, trials, base, 2)


def foreign_specs(spec: RobotSpec) -> list[ActuatorSpec]:
    """Cylinders whose FMU is not `hydraulic_cylinder`."""
    return [_as_spec(actuation) for actuation in spec.actuation if actuation.fmu != CYLINDER]


def _as_spec(a: Actuation) -> ActuatorSpec:
    return ActuatorSpec(
        fmu=a.fmu, parameters=completed(a), inputs=dict(a.inputs), outputs=dict(a.outputs), name=a.joint
    )


def instance_parameters(spec: RobotSpec, draws: Mapping[str, Float], hold: Float) -> list[dict[str, float]]:
    """Parameters of every instance, trial by trial: `actuator.*` draws, and equilibrium with forces (N, k)."""
    result = []
    for trial, forces in enumerate(hold):
        for number, (actuation, force) in enumerate(zip(spec.actuation, forces, strict=True), 1):
            held = actuation.initial_force or ("initial_force" if actuation.fmu == CYLINDER else "")
            own = _drawn(completed(actuation), draws, trial, number)
            result.append(own | ({held: float(force)} if held else {}))
    return result


_SCALED = {
    "friction_scale": ("coulomb_friction", "viscous_friction", "static_friction"),
    "valve_scale": ("rated_flow",),
    "bulk_scale": ("bulk_modulus",),
}
"""Parameters scaled by `actuator.*`: of all cylinders, or of one by its number in robot.toml."""


def _drawn(parameters: Mapping[str, Any], draws: Mapping[str, Float], trial: int, number: int) -> dict[str, float]:
    changed = {
        name: float(np.asarray(draws[f"actuator.{name}"])[trial])
        for name in ("supply_pressure", "deadband")
        if f"actuator.{name}" in draws
    }
    for factor, names in _SCALED.items():
        keys = [key for key in (f"actuator.{factor}", f"actuator.{factor}_{number}") if key in draws]
        own = [name for name in names if name in parameters]
        if keys and not own:
            called = " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))
            text = f"no actuator parameter is called {called}"
            raise InputError(keys[0], text, "vary something that the FMU has under that name")
        if keys:
            scale = float(np.prod([np.asarray(draws[key])[trial] for key in keys]))
            changed |= {name: scale * float(parameters[name]) for name in own}
    return changed
