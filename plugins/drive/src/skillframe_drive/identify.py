r"""What a robot's controller and its surroundings add to robot.toml, measured by small motions in free air.

Response of a robot that takes joint positions: its last joint follows sines of 1 degree. Amplitude and phase at each
frequency are those of a delay T and a second-order loop, with the commands held over their period h:

    H(i v) = w^2 / (w^2 - v^2 + 2 i zeta w v) exp(-i v (T + h / 2))                                             (1)

T is a whole number of milliseconds, as robot.toml takes it. T and w give the total delay that the damping rests on.

Friction of a robot that takes joint torques: each joint moves to and fro at a constant speed. At one place, gravity's
error is the same both ways, so that half the difference of the mean torques is the friction which the robot's own
compensation leaves. What a robot that takes impedances renders is found by `skillframe_drive.impedance`.

Force sensor: at several orientations R of the tool, the wrench in base axes is

    f = R b + m g,     t = R c + R r x m g                                                                     (2)

linear in the sensor's bias b, c, the mass m that the robot's payload setting lacks, and its moment m r. A tare removes
the bias, but not the weight's turning, and the robot's own estimate of the weight is the robot's to correct.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from skillframe.demonstration import GRAVITY
from skillframe.errors import SkillframeError
from skillframe.execution import Setup
from skillframe.frames import Float, skew
from skillframe.robot import LOOP_DAMPING, Control, tool_pose
from skillframe_drive.link import Link, RobotState
from skillframe_drive.real import MOST_MISSED, RealLimb
from skillframe_drive.runs import Line, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class Motions:
    """The motions of an identification.

    Attributes:
        sine_rad: amplitude of the last joint's sines [rad].
        sines_hz: their frequencies [Hz]; below the bandwidth of arms, where a delay shows, and near it.
        stroke_rad: way of a joint to each side, for its friction [rad].
        stroke_rad_s: its speed [rad/s], slow enough that inertia and viscous friction are small.
        tilt_rad: turn of the last joints but one and two to each side, for the force sensor [rad].
        tilt_s: duration of each such turn [s].
        held_s: time of rest over which a wrench is averaged [s].
        follow_hz: natural frequency at which a torque-controlled joint is led along its motion [Hz].
        most_n: change of the force in base axes that ends the identification, as free air has none [N]. Sensors and
            payload settings err by some newtons when the tool turns.
        late: share by which the total delay may exceed robot.toml's; the damping's margin is 2.6.
    """

    sine_rad: float = math.radians(1.0)
    sines_hz: tuple[float, ...] = (1.0, 2.0, 4.0, 6.0)
    stroke_rad: float = 0.02
    stroke_rad_s: float = 0.08
    tilt_rad: float = 0.25
    tilt_s: float = 1.5
    held_s: float = 0.3
    follow_hz: float = 4.0
    most_n: float = 15.0
    late: float = 0.2


MOTIONS = Motions()


class Response(NamedTuple):
    """Delay [s] and bandwidth [Hz] of a position loop, and the share of its response that equation (1) leaves."""

    delay_s: float
    bandwidth_hz: float
    residual: float

    def total_s(self, control: Control) -> float:
        """Delay from a wrench to the motion that answers it [s], as `skillframe.robot.interface` defines it."""
        return replace(control, delay_s=self.delay_s, bandwidth_hz=self.bandwidth_hz).admittance.total_delay


class Sensor(NamedTuple):
    """Errors of a wrench sensor: bias (6,) in its own axes, mass [kg], and its centre (3,) [m] in the tool frame."""

    bias: Float
    mass: float
    center: Float


class Identified(NamedTuple):
    """What was measured: lines with problems, and lines of robot.toml and campaign.toml by table."""

    lines: list[Line]
    robot: dict[str, float]
    vary: dict[str, list[float]]


def fit_response(hertz: Sequence[float], response: Sequence[complex], period: float) -> Response:
    """Delay and bandwidth of equation (1) from complex responses at frequencies [Hz], with commands every `period`."""
    turn = 2.0j * np.pi * np.asarray(hertz)
    given = np.asarray(response)

    def off(bandwidth: float, delay: float) -> float:
        w = 2.0 * np.pi * bandwidth
        model = w**2 / (w**2 + turn**2 + 2.0 * LOOP_DAMPING * w * turn) * np.exp(-turn * (delay + 0.5 * period))
        return float(np.sum(np.abs(model - given) ** 2))

    best = Response(0.0, 0.0, math.inf)
    for delay in 1e-3 * np.arange(101):  # arms are neither later than 100 ms nor faster than 100 Hz
        found = minimize_scalar(off, bounds=(0.5, 100.0), args=(delay,), method="bounded")
        if found.fun < best.residual:
            best = Response(float(delay), float(found.x), float(found.fun))
    return best._replace(residual=float(np.sqrt(best.residual / np.sum(np.abs(given) ** 2))))


def response_of(time: Float, sent: Float, measured: Float, hertz: float) -> complex:
    """Complex ratio of the sines of a frequency in `measured` (T,) and `sent` (T,), after the first period."""
    keep = time - time[0] > max(0.6, 1.0 / hertz)
    angle = 2.0 * np.pi * hertz * time[keep]
    basis = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)
    out, given = (np.linalg.lstsq(basis, each[keep], rcond=None)[0] for each in (measured, sent))
    return complex(out[0], out[1]) / complex(given[0], given[1])


def fit_sensor(rotations: Float, wrenches: Float) -> Sensor:
    """Bias and unknown payload of equation (2).

    Args:
        rotations: (k, 3, 3) of the tool in base, of at least three that differ in more than their turn about gravity.
        wrenches: (k, 6) mean wrenches at rest, base axes, at the tool frame's origin.
    """
    weight = np.tile(GRAVITY, (len(rotations), 1))[:, :, None]
    *bias, mass = np.linalg.lstsq(np.concatenate([rotations, weight], axis=2).reshape(-1, 4), wrenches[:, :3].ravel(),
                                  rcond=None)[0]  # fmt: skip
    lever = -skew(GRAVITY[None]) @ rotations  # R (m r) x g
    turning = np.concatenate([rotations, lever], axis=2).reshape(-1, 6)
    found = np.linalg.lstsq(turning, wrenches[:, 3:].ravel(), rcond=None)[0]
    center = found[3:] / mass if abs(mass) > 1e-3 else np.zeros(3)
    return Sensor(np.array([*bias, *found[:3]]), float(mass), center)


class Robot:
    """A robot in free air that is led along small motions of its joints."""

    def __init__(self, task: Task, link: Link, point: Float | None = None) -> None:
        center = np.zeros(3) if point is None else point
        self.setup = Setup(robot=task.robot, scene=task.scene, center_of_compliance=center)
        self.limb, self.link, self.period = RealLimb(self.setup, task.believed, link), link, link.period
        self.robot = task.robot
        self.state = link.read()
        self.start = self.state.position.copy()
        self.rest: Float | None = None

    def rotation(self) -> Float:
        """Rotation (3, 3) of the tool in base at the last state."""
        pose = tool_pose(self.robot.model, self.state.position, self.robot.tool_frames[0])
        return pose.rotation.reshape(3, 3)

    def follow(self, offsets: Float, rest: bool = False) -> tuple[list[RobotState], Float]:
        """Lead the joints along offsets (T, n) from the start, and return the states before each command, and torques.

        Raises:
            SkillframeError: the link failed, or the tool touched something.
        """
        states, torques = [], np.zeros_like(offsets)
        speed = np.gradient(offsets, self.period, axis=0)
        pull = np.gradient(speed, self.period, axis=0)
        stiff = 2.0 * np.pi * MOTIONS.follow_hz
        for k, offset in enumerate(offsets):
            if self.link.takes == "position":
                self.state = self.link.read()
                self.link.send(self.start + offset)
            else:
                bias = self.limb.kinematics(np.arange(1)).bias
                self.state, arm = self.limb.state, self.limb.plant.dofs
                error = self.start + offset - self.state.position
                asked = pull[k] + 2.0 * stiff * (speed[k] - self.state.velocity) + stiff**2 * error
                torques[k] = self.limb.mass_matrix()[0][np.ix_(arm, arm)] @ asked
                whole = bias.copy()
                whole[0, arm] += torques[k]
                self.limb.push(whole, np.arange(1))
            states.append(self.state)
            self.check()
        return states, torques

    def check(self) -> None:
        """Raise `SkillframeError` if the link failed, states were lost, or the force changed."""
        if self.link.fault:
            raise SkillframeError(f"the identification ended: {self.link.fault}")
        force = self.state.wrench[:3]
        self.rest = force.copy() if self.rest is None else self.rest
        self.rest += 0.02 * (force - self.rest)  # follows noise and the turning weight over 50 states
        off = float(np.linalg.norm(force - self.rest))
        if self.link.missed > MOST_MISSED:
            raise SkillframeError(f"the identification ended: {self.link.missed} states of the robot were lost")
        if off > MOTIONS.most_n:
            raise SkillframeError(
                f"the identification ended: the force changed by {off:.0f} N; begin in free air, 0.1 m from everything"
            )

    def go(self, begin: Float, end: Float, duration_s: float) -> None:
        """Move from one offset (n,) to another on a cosine, at rest at both ends."""
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, max(2, round(duration_s / self.period))))
        self.follow(begin + share[:, None] * (end - begin))


def at_rest(link: Link) -> Identified:
    """Measure the noise of the wrench at rest."""
    found = Identified([], {}, {})
    still = [link.read() for _ in range(round(MOTIONS.held_s / link.period))]
    noise = np.std([each.wrench for each in still], axis=0)
    found.lines.append(Line(f"noise of the wrench {noise[:3].max():.2f} N and {noise[3:].max():.3f} N m at rest"))
    found.vary["sensor.force_noise"] = [0.0, rounded_up(float(noise[:3].max()))]
    return found


def identify(task: Task, link: Link, say: Callable[[str], None]) -> Identified:
    """Move the robot by small motions in free air, and measure what robot.toml declares.

    Args:
        task: the cell.
        link: to the robot, which takes positions or torques, at rest in free air.
        say: prints what is done.

    Raises:
        SkillframeError: the link failed, or the tool touched something.
    """
    found = at_rest(link)
    robot, response = Robot(task, link), list[complex]()
    link.arm()  # from here a robot stops by itself when commands fail to come, so that all fits wait for the end
    try:
        if link.takes == "position":
            say("sines of 1 degree by the last joint")
            response = _response(robot)
        else:
            say("each joint moves by 1 degree to and fro")
            friction = _friction(robot)
            text = ", ".join(f"{each:.2f}" for each in friction)
            found.lines.append(Line(f"friction that is left in the joints: {text} N m"))
            found.vary["robot.joint_friction"] = [0.0, rounded_up(float(np.abs(friction).max()))]
        say("the tool turns by 14 degrees to four sides")
        turned = _turned(robot)
    finally:
        if not link.fault:
            link.halt()
    if response:
        _add_response(found, fit_response(MOTIONS.sines_hz, response, link.period), task.robot.spec.control)
    add_sensor(found, fit_sensor(*turned))
    return found


def _response(robot: Robot) -> list[complex]:
    """Complex response of the last joint at each frequency."""
    found = []
    for hertz in MOTIONS.sines_hz:
        time = robot.period * np.arange(round(max(2.0, 3.0 / hertz) / robot.period))
        fade = np.minimum(1.0, np.minimum(time, time[-1] - time) / 0.3)
        offsets = np.zeros((len(time), len(robot.start)))
        offsets[:, -1] = MOTIONS.sine_rad * fade * np.sin(2.0 * np.pi * hertz * time)
        states, _ = robot.follow(offsets)
        stamps = np.array([each.time for each in states])
        measured = np.array([each.position[-1] for each in states]) - robot.start[-1]
        keep = stamps - stamps[0] < time[-1] - 0.3
        found.append(response_of(stamps[keep], offsets[keep, -1], measured[keep], hertz))
    return found


def _friction(robot: Robot) -> Float:
    """Friction (n,) of each joint [N m or N]."""
    rise = MOTIONS.stroke_rad / MOTIONS.stroke_rad_s
    quarter = np.linspace(0.0, MOTIONS.stroke_rad, round(rise / robot.period))
    there, result = np.concatenate([quarter[:-1], quarter[::-1]]), np.zeros(len(robot.start))
    way = np.concatenate([there, -there])
    wide = max(1, round(0.02 / robot.period))
    way = np.convolve(np.pad(way, 2 * wide, mode="edge"), np.ones(wide) / wide, mode="same")[wide:-wide]
    middle = np.abs(way) < 0.8 * MOTIONS.stroke_rad
    speed = np.gradient(way, robot.period)
    for joint in range(len(robot.start)):
        offsets = np.zeros((len(way), len(robot.start)))
        offsets[:, joint] = way
        _, torques = robot.follow(np.tile(offsets, (2, 1)))
        again = torques[len(way) :, joint]  # the first stroke leads the joint off its rest
        up, down = (again[middle & (np.sign(speed) == sign)].mean() for sign in (1.0, -1.0))
        result[joint] = 0.5 * (up - down)
    return result


def _turned(robot: Robot) -> tuple[Float, Float]:
    """Rotations (k, 3, 3) of the tool at rest, and mean wrenches (k, 6) there."""
    rotations, wrenches, here = [], [], np.zeros(len(robot.start))
    for joint, sign in ((None, 0.0), (-2, 1.0), (-2, -1.0), (-3, 1.0), (-3, -1.0), (None, 0.0)):
        there = np.zeros(len(robot.start))
        if joint is not None:
            there[joint] = sign * MOTIONS.tilt_rad
        robot.go(here, there, MOTIONS.tilt_s)
        here = there
        held = np.tile(here, (round(MOTIONS.held_s / robot.period), 1))
        robot.follow(held)  # until it stands
        states, _ = robot.follow(held)
        wrenches.append(np.mean([each.wrench for each in states], axis=0))
        rotations.append(robot.rotation())
    return np.array(rotations), np.array(wrenches)


def _add_response(found: Identified, response: Response, control: Control) -> None:
    declared, total = control.admittance, response.total_s(control)
    text = (
        f"answers {1e3 * total:.1f} ms late: a delay of {1e3 * response.delay_s:.0f} ms and a bandwidth of "
        f"{response.bandwidth_hz:.1f} Hz; robot.toml gives {1e3 * declared.total_delay:.1f} ms"
    )
    problem = ""
    if response.residual > 0.1:
        problem = f"{100.0 * response.residual:.0f} % of its response is not explained by a delay and a position loop"
    elif total > (1.0 + MOTIONS.late) * declared.total_delay:
        problem = "the damping in contact would be too small: write the lines below into robot.toml and certify again"
    found.lines.append(Line(text, problem))
    found.robot.update(delay_s=round(response.delay_s, 3), bandwidth_hz=float(f"{response.bandwidth_hz:.3g}"))


def add_sensor(found: Identified, sensor: Sensor) -> None:
    """Add lines and ranges of the sensor's bias, and of the weight that the payload setting lacks."""
    force, torque = sensor.bias[:3], sensor.bias[3:]
    text = f"bias of the sensor {_vector(force, '.1f')} N and {_vector(torque, '.2f')} N m, which a run zeroes"
    found.lines.append(Line(text))
    for kind, values in (("force", force), ("torque", torque)):
        most = rounded_up(float(np.abs(values).max()))
        found.vary.update({f"sensor.{kind}_bias_{axis}": [-most, most] for axis in "xyz"})
    weight = f"weight in the measured wrench: {sensor.mass:+.3f} kg"
    problem = ""
    if abs(sensor.mass) > 0.05:
        at = f", {_vector(1e3 * sensor.center, '.0f')} mm from the tool frame's origin"
        problem = f"add it to the payload in the robot's own settings{at}"
    found.lines.append(Line(weight, problem))


def _vector(values: Float, form: str) -> str:
    return "[" + ", ".join(format(float(each), form) for each in values) + "]"


def rounded_up(value: float) -> float:
    """Round a positive value up to two digits."""
    if value <= 0.0:
        return 0.01
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.6g}")


def toml_lines(found: Identified) -> dict[str, Any]:
    """The lines as the tables "control" of robot.toml and "vary" of campaign.toml."""
    return {"control": dict(found.robot), "vary": {name: {"uniform": ends} for name, ends in found.vary.items()}}
