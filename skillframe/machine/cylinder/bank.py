"""The actuators of a machine's trials: kept between runs, and the parameters that differ from trial to trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.fmu.actuator import INPUTS, Actuators, ActuatorSpec
from skillframe.fmu.kept import kept
from skillframe.frames import Float
from skillframe.machine.checks.figures import CYLINDER, completed
from skillframe.machine.cylinder.opening import open_cylinders
from skillframe.robot.driven import Actuation
from skillframe.robot.spec import RobotSpec


def banks(spec: RobotSpec, trials: int, ports: Sequence[str] = ()) -> Actuators:
    """A bank of a robot's actuators for so many trials. It is the same one again if it was the last asked for.

    Args:
        spec: the robot.
        trials: how many.
        ports: inputs that faults need, which every cylinder must have.

    Opening FMUs takes some tenths of a second, resetting them none to speak of, so a campaign's chunks share a bank.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: an actuator cannot be opened.
    """
    specs = [_with_ports(_as_spec(actuation), ports, spec.name) for actuation in spec.actuation]
    return kept((str(spec.folder), repr(specs), trials), lambda: open_cylinders(specs, trials, spec.folder))


def _with_ports(own: ActuatorSpec, ports: Sequence[str], robot: str) -> ActuatorSpec:
    """An actuator with inputs for its faults.

    Raises:
        InputError: a cylinder of another maker, to whose FMU they are not mapped.
    """
    if not ports:
        return own
    lacking = [] if own.fmu == CYLINDER else [name for name in ports if name not in own.inputs]
    if lacking:
        text = f"its FMU has no input for {' and '.join(lacking)}, so that it cannot break so"
        raise InputError(
            f"robot {robot}, {own.name}", text, "map one under inputs of its [[actuation]], or leave it out"
        )
    mapped = {name: name for name in (*(() if own.inputs else INPUTS), *ports)}
    return replace(own, inputs={**mapped, **own.inputs})


def foreign_specs(spec: RobotSpec) -> list[ActuatorSpec]:
    """The cylinders whose FMU is not `hydraulic_cylinder`, all of whose variables are known here."""
    return [_as_spec(actuation) for actuation in spec.actuation if actuation.fmu != CYLINDER]


def _as_spec(a: Actuation) -> ActuatorSpec:
    return ActuatorSpec(
        fmu=a.fmu, parameters=completed(a), inputs=dict(a.inputs), outputs=dict(a.outputs), name=a.joint
    )


def instance_parameters(spec: RobotSpec, draws: Mapping[str, Float], hold: Float) -> list[dict[str, float]]:
    """Parameters of every instance, trial by trial: `actuator.*` draws, and equilibrium with holding forces (N, k)."""
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
"""Parameters that a factor `actuator.*` scales: of all cylinders, or, with its number in robot.toml, of one."""


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
