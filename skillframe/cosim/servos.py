r"""Electric servos as FMUs: declaration, conversion of joint torques to inputs, and checks.

A servo takes the input `torque`, or `target`, a position of its inner loop. With the loop's gains K_p and K_v and
spring stiffness k at the joint, a torque tau becomes

    target = q + tau (1/K_p + 1/k) + (K_v/K_p) \dot\theta

which gives tau at rest: a torque-position transformer (Khatib, Thaulad, Yoshikawa and Park, ICRA 2008) with spring. The
motor torque tau + (K_p/k) (tau - tau_s) closes a loop around the spring's tau_s.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from skillframe.cosim.energy_balance import Float
from skillframe.errors import InputError
from skillframe.fmu.actuator import Actuators, ActuatorSpec
from skillframe.fmu.opening import kept, open_actuators
from skillframe.robot.spec import RobotSpec
from skillframe.robot.tables import Actuation

COMMANDS = ("torque", "target")
"""Inputs of a servo, of which exactly one is mapped."""
SERVO = "electric_servo"


class Servos(NamedTuple):
    """Nominal values of k servos, each (k,).

    Attributes:
        share: command per torque: 1, or 1/K_p + 1/k [rad/(N m)].
        holds: 1 for position servos, else 0.
        lead: K_v/K_p [s] of position servos, else 0.
        inertia: effective, of rotor and gear at the joint [kg m^2]: with K_p, divided by 1 + K_p/k.
    """

    share: Float
    holds: Float
    lead: Float
    inertia: Float

    def command(self, torque: Float, position: Float, velocity: Float) -> Float:
        """Servo commands (N, k) from joint torques, joint positions and motor velocities (N, k)."""
        return torque * self.share + self.holds * (position + self.lead * velocity)


def servos(spec: RobotSpec) -> Servos:
    """Nominal servos of a robot.

    Raises:
        InputError: as `require_servos`.
    """
    require_servos(spec)
    rows = []
    for actuation in spec.actuation:
        known, holds = actuation.known, "target" in actuation.inputs
        gain, stiffness = float(known.get("position_gain", 1.0)), float(known.get("stiffness", np.inf))
        share = 1.0 / gain + 1.0 / stiffness if holds else 1.0
        lead = float(known.get("velocity_gain", 0.0)) / gain if holds else 0.0
        gear, rotor = (float(known.get(name, plain)) for name, plain in (("gear", 1.0), ("rotor_inertia", 0.0)))
        less = 1.0 + gain / stiffness if holds else 1.0
        rows.append((share, float(holds), lead, gear**2 * rotor / less))
    return Servos(*(np.array(column) for column in zip(*rows, strict=True)))


def actuator_specs(spec: RobotSpec) -> list[ActuatorSpec]:
    """Servos for the bank, with their input as `command`."""
    return [
        ActuatorSpec(
            fmu=a.fmu, parameters=dict(a.parameters), outputs=dict(a.outputs), name=a.joint,
            inputs={"command" if ours in COMMANDS else ours: theirs for ours, theirs in a.inputs.items()},
        )
        for a in spec.actuation
    ]  # fmt: skip


def open_servos(spec: RobotSpec, trials: int) -> Actuators:
    """Cached bank of a robot's servos for `trials`.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: an FMU cannot be opened, or lacks a mapped name.
    """
    specs = actuator_specs(spec)
    return kept((str(spec.folder), repr(specs), trials), lambda: open_actuators(specs, trials, spec.folder))


def start_parameters(spec: RobotSpec, hold: Float, friction: Float | None) -> list[dict[str, float]]:
    """Parameters of every instance: initial torque (N, k) [N m], and friction scaled by factors (N,).

    Raises:
        InputError: friction varies, but no parameter name ends with _friction.
    """
    frictions = [[name for name in a.parameters if name.endswith("_friction")] for a in spec.actuation]
    if friction is not None and not any(frictions):
        text = "no parameter of an [[actuation]] has a name that ends with _friction"
        raise InputError("actuator.friction_scale", text, "give the FMU's friction in parameters")
    result = []
    for trial, torques in enumerate(hold):
        for actuation, names, torque in zip(spec.actuation, frictions, torques, strict=True):
            held = actuation.initial_force or ("initial_force" if actuation.fmu == SERVO else "")
            own = {held: float(torque)} if held else {}
            if friction is not None:
                own |= {name: float(friction[trial]) * float(actuation.parameters[name]) for name in names}
            result.append(own)
    return result


def unfit_servo(actuation: Actuation) -> Iterator[tuple[str, str]]:
    """Problem and fix of each invalid value in a servo's entry."""
    who, told = f"the servo on {actuation.joint}", [name for name in COMMANDS if name in actuation.inputs]
    if not told:
        text = f"{who} has no command: its inputs map neither torque nor target"
        yield text, 'add inputs = { torque = "..." } for a torque [N m], or { target = "..." } for a position [rad]'
    if len(told) == 2:
        yield f"{who} has two commands, torque and target", "map one of them, and name the other in unused"
    if "command" in actuation.inputs:
        yield f"{who} maps command, which no servo takes", "write torque or target instead"
    known = actuation.known
    if "target" in actuation.inputs and not _above_zero(known.get("position_gain")):
        text = f"{who} takes a target, and its position_gain [N m/rad] is not known"
        yield text, "add it to parameters or nominal of its [[actuation]]"
    for name in ("stiffness", "gear"):
        if name in known and not _above_zero(known[name]):
            yield f"{name} of {who} is {known[name]!r:.60}; it must be greater than zero", "correct it"
    for name in ("velocity_gain", "rotor_inertia"):
        if name in known and not (_above_zero(known[name]) or known[name] == 0):
            yield f"{name} of {who} is {known[name]!r:.60}; it must be zero or more", "correct it"


def require_servos(spec: RobotSpec) -> None:
    """Refuse a robot with invalid servos.

    Raises:
        InputError: names file, servo and fix.
    """
    for actuation in spec.actuation:
        for problem, fix in unfit_servo(actuation):
            raise InputError(spec.folder / "robot.toml", problem, fix)


def _above_zero(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < np.inf
