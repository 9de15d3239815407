r"""How much of a push friction and damping of the joints take, and a sentence where it is too much.

A tool that moves at speed \(v\) meets \(f / r + d v / r^2\) from a joint with friction \(f\) and damping \(d\). Its
lever \(r\), with \(r^2 = |J_v|^2 + l^2 |J_\omega|^2\) at home, is how far the tool frame moves and turns per radian,
turning counted at \(l\) = 0.1 m. Skills push with some 20 N and 2 N m at 20 mm/s. Lever, speed and what counts as too
much are our choice: on the Panda 0.1 N m in every joint (1 N at the worst) stops half of the demo's insertions, and
2 N m s/rad (4 N) make one of eight run out of time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.robot.kinematics import RobotState
from skillframe.robot.model import RobotModel

TURNING, SPEED, PUSH = 0.1, 0.02, 1.0  # m; m/s; N, a twentieth of what skills push with
MOST_NAMES = 3
_SCALE = np.array([[1.0]] * 3 + [[TURNING]] * 3)


class Resistance(NamedTuple):
    """Of one joint: friction [N m or N], damping [N m s/rad or N s/m], and what they take of a push at the tool [N]."""

    joint: str
    friction: float
    damping: float
    sliding: bool
    push: float

    @property
    def figures(self) -> str:
        """Friction and damping in words."""
        force, rate = ("N", "N s/m") if self.sliding else ("Nm", "Nm s/rad")
        given = ((self.friction, "friction", force), (self.damping, "damping", rate))
        return " and ".join(f"{what} {value:g} {unit}" for value, what, unit in given if value > 0.0)


def resistances(robot: RobotModel) -> list[Resistance]:
    """Of every joint that resists and moves a tool frame. Any frame where the robot names no arm."""
    model = robot.model
    if not (np.any(model.friction) or np.any(model.damping)):
        return []
    frames = robot.tool_frames or range(1, model.nframes)
    state = RobotState(model, robot.home, np.zeros(model.nv))
    levers = [np.square(state.jacobian(f).reshape(6, -1) * _SCALE).sum(axis=0) for f in frames]
    squares = np.max(levers, axis=0, initial=0.0)
    found = []
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nv != 1 or squares[joint.idx_v] <= 0.0:
            continue
        friction, damping = float(model.friction[joint.idx_v]), float(model.damping[joint.idx_v])
        square = float(squares[joint.idx_v])
        push = friction / np.sqrt(square) + damping * SPEED / square
        sliding = robot.urdf.joints[model.names[index]].type == "prismatic"
        found.append(Resistance(model.names[index], friction, damping, sliding, float(push)))
    return [one for one in found if one.push > 0.0]


def hurting(robot: RobotModel) -> list[Resistance]:
    """The joints that take a twentieth of a push or more, the worst first."""
    return sorted((one for one in resistances(robot) if one.push >= PUSH), key=lambda one: -one.push)


def resistance_note(robot: RobotModel) -> str:
    """What to say where something failed with joints that resist, or "" if none takes a twentieth of a push."""
    worst = hurting(robot)
    if not worst or robot.spec.hydraulic:
        return ""
    named = ", ".join(f"{one.joint} ({one.figures}: {one.push:.2g} N of a push)" for one in worst[:MOST_NAMES])
    rest = f" and {len(worst) - MOST_NAMES} more" if len(worst) > MOST_NAMES else ""
    known = "the controller compensates them while a joint moves, not at rest" if robot.spec.dynamics.compensate else (
        "the controller does not know of it"
    )  # fmt: skip
    return (
        f"joints of {robot.spec.name} resist: {named}{rest}; {known}; before looking elsewhere, give what the maker "
        "says in robot.toml's [dynamics]"
    )
