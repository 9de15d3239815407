r"""Electric servos as FMUs: what robot.toml says of them, how a joint torque becomes their input, and what is refused.

A servo takes a torque, or a motor position for its inner loop. Which of the two is said by the mapping alone: our input
`torque` or our input `target`. With K_p and K_v the inner loop's gains and k the stiffness of the spring, all at the
joint, the torque tau of the law becomes the position

    target = q + tau (1/K_p + 1/k) + (K_v/K_p) \dot\theta

which the inner loop and the spring turn back into tau at rest: a torque-position transformer (Khatib, Thaulad,
Yoshikawa and Park, ICRA 2008), with the spring included by us. In terms of torques the motor then gives
tau + (K_p/k) (tau - tau_s), a torque loop around the spring's tau_s that also makes friction and rotor count less.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from skillframe.cosim.plant import Float
from skillframe.errors import InputError
from skillframe.fmu.actuator import Actuators, ActuatorSpec
from skillframe.fmu.kept import kept
from skillframe.fmu.opening import open_actuators
from skillframe.robot.driven import Actuation
from skillframe.robot.spec import RobotSpec

COMMANDS = ("torque", "target")
"""Our names of what a servo may be told; exactly one of them is mapped."""
SERVO = "electric_servo"


class Servos(NamedTuple):
    """The controller's k servos, each (k,).

    Attributes:
        share: command per torque of the law: 1, or 1/K_p + 1/k [rad/(N m)].
        holds: 1 where a servo takes a position, else 0.
        lead: K_v/K_p [s] of position servos, else 0.
        inertia: of rotor and gear as the law feels it at the joint [kg m^2]: with K_p, divided by 1 + K_p/k.
    """

    share: Float
    holds: Float
    lead: Float
    inertia: Float

    def command(self, torque: Float, position: Float, velocity: Float) -> Float:
        """What the servos are told (N, k), from torques of the law, joint positions and motor velocities (N, k)."""
        return torque * self.share + self.holds * (position + self.lead * velocity)


def servos(spec: RobotSpec) -> Servos:
    """What the controller takes a robot's servos for.

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
        less = 1.0 + gain / stiffness if holds else 1.0  # the torque loop around the spring
        rows.append((share, float(holds), lead, gear**2 * rotor / less))
    return Servos(*(np.array(column) for column in zip(*rows, strict=True)))


def actuator_specs(spec: RobotSpec) -> list[ActuatorSpec]:
    """The servos as the bank takes them, with what they are told as its `command`."""
    return [
        ActuatorSpec(
            fmu=a.fmu, parameters=dict(a.parameters), outputs=dict(a.outputs), name=a.joint,
            inputs={"command" if ours in COMMANDS else ours: theirs for ours, theirs in a.inputs.items()},
        )
        for a in spec.actuation
    ]  # fmt: skip


def open_servos(spec: RobotSpec, trials: int) -> Actuators:
    """A bank of a robot's servos for so many trials, kept between runs.

    Raises:
        InputError, UnknownName, MissingDependency, InstanceFailed: an FMU cannot be opened, or lacks a mapped name.
    """
    specs = actuator_specs(spec)
    return kept((str(spec.folder), repr(specs), trials), lambda: open_actuators(specs, trials, spec.folder))


def start_parameters(spec: RobotSpec, hold: Float, friction: Float | None) -> list[dict[str, float]]:
    """Parameters of every instance, trial by trial: the torque that it holds at the start, and its friction.

    Args:
        spec: of the robot.
        hold: (N, k) torques at the joints [N m].
        friction: (N,) factors of what is called friction, or None.

    Raises:
        InputError: friction is varied, and no parameter is called so.
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
    """What is missing or impossible in a servo's entry: what is wrong, and the cure."""
    who, told = f"the servo on {actuation.joint}", [name for name in COMMANDS if name in actuation.inputs]
    if not told:
        text = f"{who} is told nothing: its inputs map neither torque nor target"
        yield text, 'add inputs = { torque = "..." } for a torque [N m], or { target = "..." } for a position [rad]'
    if len(told) == 2:
        yield f"{who} is told a torque and a target", "map one of them, and name the other in unused"
    if "command" in actuation.inputs:
        yield f"{who} maps command, which is a valve's", "write torque or target instead"
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
    """Refuse a robot whose servos' entries are missing or impossible.

    Raises:
        InputError: names the file, the first such servo, and what to do.
    """
    for actuation in spec.actuation:
        for problem, fix in unfit_servo(actuation):
            raise InputError(spec.folder / "robot.toml", problem, fix)


def _above_zero(value: object) -> bool:
    """Whether it is a positive, finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < np.inf
