r"""What a robot that takes impedances renders, measured by small wrenches in free air.

A wrench f along an axis of base goes to and fro, as slowly as the arm follows at rest. With the displacement x along
the axis, the stiffness k that the robot renders, the commanded damping D, and friction F_c that opposes the motion,

    f - (D v)_i = k x + F_c sign(v) + b                                                                         (1)

so that k is the slope of the loop of f over x, and b a constant load. Half the loop's width is F_c, and f' T more where
f acts late by T. Where the tool moves along the axis by v while the joints move by q', friction mu that all joints
share gives mu = F_c |v| / sum |q'| (the power that is lost).

Sines of f at some frequencies then give the delay T of the feed-forward. With the task inertia M (6, 6) of the nominal
robot, and commands held over their period h,

    X = [(-w^2 M + i w D + K)^-1]_ii exp(-i w (T + h / 2))                                                      (2)

Friction is left out of (2): at these frequencies and forces the joints slide, and inertia outweighs it. Stiffness and
damping act in the robot's own controller and are not late. A gain that all torques share is not seen in k, which
compares stiffness with wrench, but in what (2) leaves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose, rotation_matrix
from skillframe.skill import Command, Impedance, no_reasons
from skillframe_drive.identify import (
    MOTIONS,
    Identified,
    Robot,
    add_sensor,
    at_rest,
    fit_sensor,
    response_of,
    rounded_up,
)
from skillframe_drive.link import Link
from skillframe_drive.real import ImpedanceOnLink
from skillframe_drive.runs import Line, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Probes:
    """The wrenches of an identification.

    Attributes:
        stiffness: commanded along [N/m] and about [N m/rad] the axes, as skills have it in free air.
        push_n: largest force to each side [N]: 20 mm at that stiffness, and above the friction of arms.
        push_s: duration of a force that goes to and fro once [s].
        sine_n: amplitude of the sines [N].
        sines_hz: their frequencies [Hz], where the inertia outweighs stiffness and friction.
        least: share of the way without friction that the tool has to move: friction of 0.6 of the force leaves it.
        wrong: share by which the rendered stiffness may differ from the commanded one.
        late_s: delay of the feed-forward that is tolerated [s]: couplings k between axes lose k T of damping.
        unexplained: share of the response that equation (2) may leave; joint friction of 1 N m leaves 0.12.
    """

    stiffness: tuple[float, float] = (1500.0, 100.0)
    push_n: float = 30.0
    push_s: float = 4.0
    sine_n: float = 20.0
    sines_hz: tuple[float, ...] = (4.0, 6.0, 8.0)
    least: float = 0.4
    wrong: float = 0.2
    late_s: float = 0.01
    unexplained: float = 0.25


PROBES = Probes()


class Loop(NamedTuple):
    """Equation (1): stiffness [N/m], friction [N], that which all joints share [N m], and the way of the tool [m]."""

    stiffness: float
    friction: float
    joint: float
    way: float


class Late(NamedTuple):
    """Equation (2): delay of the feed-forward [s], and the share of the response that is left unexplained."""

    delay_s: float
    residual: float


class _Tool(Robot):
    """A robot in free air whose tool is held by a spring, turned and pushed."""

    def __init__(self, task: Task, link: Link, point: Float) -> None:
        super().__init__(task, link, point)
        self.drive = ImpedanceOnLink(self.setup, self.limb)
        for one in self.drive.prepare():
            raise SkillframeError(f"the identification ended: {one.cause}")
        along, about = PROBES.stiffness
        self.held = Impedance(np.diag([along] * 3 + [about] * 3))
        self._tick = 0
        seen = self.drive.sense(0, np.arange(1))
        self.place = Pose(seen.pose.position.copy(), seen.pose.rotation.copy())
        self.damping = self.drive.controller.damping_for(self.held, self.drive._reading)[0].copy()
        jacobian, mass = self.drive._reading.jacobian[0], self.limb.mass_matrix()[0]
        self.inertia = np.linalg.inv(jacobian @ np.linalg.solve(mass, jacobian.T))
        self.held = self.held._replace(damping=self.damping)

    def lead(self, pushes: Float, turns: Float) -> Float:
        """Push by forces (T, 3), base axes, with the tool turned by rotation vectors (T, 3) from the start.

        Returns displacement of the centre, twist, speed of the joints summed, and time: (T, 11).
        """
        still, rows = np.zeros((1, 6)), np.zeros((len(pushes), 11))
        for k, (push, turn) in enumerate(zip(pushes, turns, strict=True)):
            self._tick += 1
            seen = self.drive.sense(self._tick, np.arange(1))
            self.state = self.limb.state
            speed = np.abs(self.state.velocity).sum()
            rows[k] = [*(seen.pose.position - self.place.position)[0], *seen.twist[0], speed, self.state.time]
            pose = Pose(self.place.position, rotation_matrix(turn[None]) @ self.place.rotation)
            forward = np.concatenate([push, np.zeros(3)])[None]
            command = Command(pose, still, self.held, forward, np.zeros(1, dtype=np.int64), no_reasons(1))
            self.drive.act(command, 1.0)
            self.drive.advance(np.arange(1))
            self.check()
        return rows

    def turn(self, begin: Float, end: Float, duration_s: float) -> list[Float]:
        """Turn the tool on a cosine, and return the wrenches of the states."""
        steps = max(2, round(duration_s / self.period))
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, steps))[:, None]
        wrenches = []
        for turn in begin + share * (end - begin):
            self.lead(np.zeros((1, 3)), turn[None])
            wrenches.append(self.state.wrench)
        return wrenches


def fit_loop(push: Float, place: Float, lost: Float, speed: Float, joints: Float) -> Loop:
    """Equation (1) of a force (T,) to and fro, and displacement (T,), (D v)_i (T,), speeds of tool and joints (T,)."""
    rising = np.sign(np.gradient(push))
    along = rising * speed
    slides = (np.abs(push) < 0.9 * np.abs(push).max()) & (along > 0.5 * np.quantile(along, 0.9))
    basis = np.stack([place, rising, np.ones_like(place)], axis=1)[slides]
    (stiffness, friction, _), *_ = np.linalg.lstsq(basis, (push - lost)[slides], rcond=None)
    share = np.abs(speed[slides]).sum() / max(float(joints[slides].sum()), 1e-9)
    return Loop(float(stiffness), float(friction), float(friction * share), float(np.ptp(place)))


def fit_late(
    hertz: Sequence[float], response: Sequence[complex], axis: int, matrices: tuple[Float, Float, Float], period: float
) -> Late:  # fmt: skip
    """Equation (2) from responses X / f [m/N] at frequencies [Hz].

    Args:
        hertz: of the sines.
        response: to each.
        axis: 0 to 2, of base.
        matrices: M, D and K, each (6, 6), base axes.
        period: h [s].
    """
    turn, (inertia, damping, stiffness) = 2.0 * np.pi * np.asarray(hertz), matrices
    model = [np.linalg.inv(stiffness + 1j * w * damping - w**2 * inertia)[axis, axis] for w in turn]
    ratio = np.asarray(response) / np.array(model)
    delays = 1e-3 * np.arange(101)
    off = np.abs(np.exp(-1j * turn * (delays[:, None] + 0.5 * period)) - ratio)
    best = int(np.argmin(np.sum(off**2, axis=1)))
    return Late(float(delays[best]), float(np.sqrt(np.mean(off[best] ** 2))))


def identify_impedance(task: Task, link: Link, say: Callable[[str], None], point: Float) -> Identified:
    """Push and turn the tool in free air, and measure what the robot renders.

    Args:
        task: the cell.
        link: to the robot, which takes impedances, at rest in free air.
        say: prints what is done.
        point: (3,) centre of compliance in the tool frame [m], where the robot's own end-effector frame has to be.

    Raises:
        SkillframeError: the link failed, or the tool touched something.
    """
    found, tool = at_rest(link), _Tool(task, link, point)
    try:
        say(f"a force of {PROBES.push_n:.0f} N along x, y and z to and fro")
        loops = [_loop(tool, axis) for axis in range(3)]
        axis = int(np.argmax([each.way for each in loops]))
        say(f"sines of {PROBES.sine_n:.0f} N along {'xyz'[axis]}")
        response = [_sine(tool, axis, hertz) for hertz in PROBES.sines_hz]
        say("the tool turns by 14 degrees to four sides")
        turned = _turned(tool)
    finally:
        if not link.fault:
            link.halt()
    _add_rendered(found, tool, loops, axis, response)
    add_sensor(found, fit_sensor(*turned))
    return found


def _loop(tool: _Tool, axis: int) -> Loop:
    count = round(PROBES.push_s / tool.period)
    phase = np.arange(2 * count) / count
    pushes = np.zeros((2 * count, 3))
    pushes[:, axis] = PROBES.push_n * (1.0 - 4.0 * np.abs((phase + 0.25) % 1.0 - 0.5))
    rows = tool.lead(pushes, np.zeros_like(pushes))[count:]  # the first time leads the joints off their rest
    lost = rows[:, 3:9] @ tool.damping[axis]
    return fit_loop(pushes[count:, axis], rows[:, axis], lost, rows[:, 3 + axis], rows[:, 9])


def _sine(tool: _Tool, axis: int, hertz: float) -> complex:
    time = tool.period * np.arange(round(max(2.0, 6.0 / hertz) / tool.period))
    fade = np.minimum(1.0, np.minimum(time, time[-1] - time) / 0.3)
    pushes = np.zeros((len(time), 3))
    pushes[:, axis] = PROBES.sine_n * fade * np.sin(2.0 * np.pi * hertz * time)
    rows = tool.lead(pushes, np.zeros_like(pushes))
    stamps = rows[:, 10] - rows[0, 10]
    keep = stamps < time[-1] - 0.3
    return response_of(stamps[keep], pushes[keep, axis], rows[keep, axis], hertz)


def _turned(tool: _Tool) -> tuple[Float, Float]:
    """Rotations (k, 3, 3) of the tool at rest, and mean wrenches (k, 6) there."""
    rotations, wrenches, here = [], [], np.zeros(3)
    for there in MOTIONS.tilt_rad * np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 0]]):
        tool.turn(here, there, MOTIONS.tilt_s)
        tool.turn(there, there, MOTIONS.held_s)  # until it stands
        wrenches.append(np.mean(tool.turn(there, there, MOTIONS.held_s), axis=0))
        rotations.append(tool.rotation())
        here = there
    return np.array(rotations), np.array(wrenches)


def _add_rendered(
    found: Identified, tool: _Tool, loops: Sequence[Loop], axis: int, response: Sequence[complex]
) -> None:  # fmt: skip
    """Add stiffness and friction of each axis along which the tool slid, and the delay along `axis`."""
    commanded = PROBES.stiffness[0]
    slid = [each.way > PROBES.least * 2.0 * PROBES.push_n / commanded for each in loops]
    stiffness = tool.held.stiffness.copy()
    stiffness[axis, axis] = loops[axis].stiffness
    late = fit_late(PROBES.sines_hz, response, axis, (tool.inertia, tool.damping, stiffness), tool.period)
    behind = 4.0 * PROBES.push_n / PROBES.push_s * late.delay_s
    joint = 0.0
    for name, each, known in zip("xyz", loops, slid, strict=True):
        if not known:
            problem = "neither stiffness nor friction is found there: its joints stick, or something holds it"
            found.lines.append(Line(f"along {name} the tool hardly moves under {PROBES.push_n:.0f} N", problem))
            continue
        friction = max(0.0, each.friction - behind)
        joint = max(joint, friction * each.joint / each.friction if friction else 0.0)
        text = (
            f"along {name} {each.stiffness:.0f} N/m where {commanded:.0f} was sent, and friction of {friction:.1f} N: "
            f"a dead band of {1e3 * friction / each.stiffness:.1f} mm to each side"
        )
        wrong = abs(each.stiffness / commanded - 1.0) > PROBES.wrong
        problem = "the robot renders another stiffness than it is sent: look for its own limits and units"
        found.lines.append(Line(text, problem if wrong else ""))
    if not slid[axis]:
        return
    found.vary["robot.joint_friction"] = [0.0, rounded_up(joint)]
    text, problem = f"feed-forward acts {1e3 * late.delay_s:.0f} ms late", ""
    if late.residual > PROBES.unexplained:
        problem = f"{100.0 * late.residual:.0f} % of its response is not explained by stiffness, inertia and a delay"
    elif late.delay_s > PROBES.late_s:
        problem = "couplings between axes lose damping: relieve this computer and the network"
    found.lines.append(Line(text, problem))
    found.lines.append(Line("bandwidth and delay of stiffness and damping are the robot's own, and not identified"))
