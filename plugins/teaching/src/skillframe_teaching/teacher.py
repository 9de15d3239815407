r"""A simulated teacher: a compliant hand that holds the tool at a handle, pushes and turns it.

It is a skill with the handle as centre of compliance, in the same world and with the same sensors as any run. It knows
the task (`Scene.task`) and the fixture's pose, which the learner does not. The hand is a Maxwell element, with assumed
figures:

    d = unit(d_0 + o),  do = -o dt / 0.5 s + sigma sqrt(2 dt / 0.5 s) N(0, 1)     aim
    x_h += v_h d dt;  x_h -= e_perp dt / tau;  push limited to F_max              e = x_h - x(t - delay)
    s = min(1, max(0, r / 2 mm)) times v_h and F_max, - D (1 - s) d_0.v d_0       r distance to where the push stops
    F = K_h (x_h - x) + B_h (v_h d - v) + tremor

People are softer when they align a part than when they slide it, hence one hand per task. Teleoperation delays
observations and commands, and scales tremor by the motion scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose, matrix_from_quaternion, norm, rotate, rotation_matrix, rotation_vector, unit
from skillframe.signals import require_delay
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.world import Task

AIM_TIME, TREMOR_TIME = 0.5, 0.1  # correlation times of aim and tremor [s]
SLOWING_S = 0.2  # a carrying hand decelerates over this time before its goal
STOPPING_M, STOPPING_NS_M = 0.002, 600.0
BLOCK = 500
KINDS = ("kinesthetic", "teleoperation", "disassembly")
BY_ROW = ("_noise", "_aim", "_tremor", "_position", "_rotation", "_direction", "_goal", "_aligned", "_turn")
"""A teacher's state by trial, besides random generators and delays."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hand:
    """A hand: stiffness [N/m], damping [Ns/m] and relaxation time [s] in translation, and the same in rotation.

    It pushes at `speed` [m/s]; an active one turns the part at `turn_rate` [rad/s] with at most `torque_max` [Nm]. A
    hand that `gives_way` retreats at its largest push; another one slows down with the push and stays stiff.
    """

    stiffness: float
    damping: float
    relaxation: float
    turn_stiffness: float
    turn_damping: float
    speed: float = 0.02
    turn_rate: float = 0.0
    torque_max: float = 1.5
    gives_way: bool = True


HANDS = {
    "sliding": Hand(stiffness=1000.0, damping=60.0, relaxation=1.0, turn_stiffness=20.0, turn_damping=1.0),
    "aligning": Hand(
        stiffness=400.0, damping=40.0, relaxation=0.3, turn_stiffness=3.0, turn_damping=0.3, turn_rate=0.15,
        speed=0.03,
    ),
    "lever": Hand(
        stiffness=400.0, damping=40.0, relaxation=0.3, turn_stiffness=15.0, turn_damping=0.8, turn_rate=0.25,
        torque_max=3.0,
    ),
    "carrying": Hand(
        stiffness=1000.0, damping=60.0, relaxation=1.0, turn_stiffness=20.0, turn_damping=1.0, speed=0.15,
        turn_rate=0.8,
    ),
    "hold": Hand(stiffness=1000.0, damping=60.0, relaxation=1.0, turn_stiffness=20.0, turn_damping=1.0),
    "master": Hand(
        stiffness=1200.0, damping=25.0, relaxation=0.25, turn_stiffness=20.0, turn_damping=1.0, gives_way=False
    ),
}  # fmt: skip


def firm(hand: Hand) -> Hand:
    """A hand for an arm with gear friction: four times as stiff in rotation, with twice the torque.

    A peg that leans on its rim would otherwise come to rest on `panda_servo`.
    """
    return replace(
        hand, turn_stiffness=4.0 * hand.turn_stiffness, turn_damping=4.0 * hand.turn_damping,
        torque_max=2.0 * hand.torque_max,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class TeacherSettings:
    """Settings of a teacher.

    Attributes:
        kind: "kinesthetic" or "disassembly" (the hand is on the robot), or "teleoperation" (delay and scale apply).
        aim_noise: standard deviation of the pushing direction per axis [rad, 0deg to 90deg].
        speed: of the push [m/s]; None for the hand's own.
        force_max: largest push [N].
        tremor_force: [N].
        tremor_torque: [Nm].
        delay_s: one-way delay of teleoperation [s, 0s to 1s].
        scale: motion of the robot over motion of the master.
        vision_error: standard deviation of the seen hole entrance per axis [m, 0mm to 100mm]; None: without vision.
    """

    kind: str = "kinesthetic"
    aim_noise: float = 0.13962634015954636
    speed: float | None = None
    force_max: float = 15.0
    tremor_force: float = 0.5
    tremor_torque: float = 0.03
    delay_s: float = 0.0
    scale: float = 1.0
    vision_error: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UnknownName("teacher", self.kind, KINDS)
        require_delay(self.delay_s, "teacher: delay_s")
        if self.vision_error is not None and (self.kind != "kinesthetic" or not 0.0 <= self.vision_error < np.inf):
            what = f"is {self.vision_error!r} for a {self.kind} teacher"
            raise InputError("teacher: vision_error", what, "give metres, 0 or more, for a kinesthetic one, or None")


class Teacher(Skill):
    """A teacher's hand on N tools, for the true pose of the `fixture` per trial, (N, 3) and (N, 3, 3)."""

    def __init__(self, task: Task, fixture: Pose, settings: TeacherSettings, hand: Hand | None = None) -> None:
        if task.hand not in HANDS:
            raise UnknownName("hand", task.hand, HANDS)
        self._task, self._hand, self._settings, self._fixture = task, hand or HANDS[task.hand], settings, fixture

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold the tool where it is."""
        count, hand = len(rngs), self._hand
        self._rngs, self._next = list(rngs), BLOCK
        self._noise = np.zeros((count, BLOCK, 9))
        self._aim, self._tremor = np.zeros((count, 3)), np.zeros((count, 6))
        self._position = observation.pose.position.copy()
        self._rotation = observation.pose.rotation.copy()
        self._impedance = Impedance(
            np.diag([hand.stiffness] * 3 + [hand.turn_stiffness] * 3),
            np.diag([hand.damping] * 3 + [hand.turn_damping] * 3),
        )
        turned = self._fixture.rotation
        task = self._task
        self._direction = None if task.direction is None else rotate(turned, np.array(task.direction))
        self._goal = None if task.to is None else self._fixture.at(np.array(task.to)).position
        self._aligned = None if task.aligned is None else turned @ matrix_from_quaternion(task.aligned)
        self._turn = None if task.turn is None else rotate(turned, np.array(task.turn))
        self._delay = _Delay(round(self._settings.delay_s / observation.dt))
        self._arrival = _Delay(round(self._settings.delay_s / observation.dt))

    def take_over(self, other: Teacher, observation: Observation) -> None:
        """Continue for another hand of the same teacher, with its force, aim, tremor and delays."""
        self.start(observation, other._rngs)
        self._noise, self._next, self._aim, self._tremor = other._noise, other._next, other._aim, other._tremor
        self._delay, self._arrival = other._delay, other._arrival
        lead = other._position - observation.pose.position
        self._position = observation.pose.position + lead * (other._hand.stiffness / self._hand.stiffness)
        turned = rotation_vector(other._rotation @ np.swapaxes(observation.pose.rotation, -1, -2))
        scale = other._hand.turn_stiffness / self._hand.turn_stiffness
        self._rotation = rotation_matrix(scale * turned) @ observation.pose.rotation

    @property
    def impedance(self) -> Impedance:
        """Impedance of the hand, (6, 6) each."""
        return self._impedance

    def some(self, rows: NDArray[np.intp]) -> Teacher:
        """An independent teacher for some of the tools, in their current state."""
        part = Teacher(self._task, Pose(*(v[rows] for v in self._fixture)), self._settings, self._hand)
        part._rngs, part._next, part._impedance = [self._rngs[i] for i in rows], self._next, self._impedance
        for name in BY_ROW:
            value = getattr(self, name)
            setattr(part, name, None if value is None else value[rows])
        part._delay, part._arrival = self._delay.some(rows), self._arrival.some(rows)
        return part

    def beside(self, other: Teacher) -> Teacher:
        """One teacher for these tools and those of another with the same task, in this order."""
        places = zip(self._fixture, other._fixture, strict=True)
        both = Teacher(self._task, Pose(*map(np.concatenate, places)), self._settings, self._hand)
        both._rngs, both._next, both._impedance = [*self._rngs, *other._rngs], self._next, self._impedance
        for name in BY_ROW:
            mine, theirs = getattr(self, name), getattr(other, name)
            setattr(both, name, None if mine is None else np.concatenate([mine, theirs]))
        both._delay, both._arrival = self._delay.beside(other._delay), self._arrival.beside(other._arrival)
        return both

    def step(self, observation: Observation) -> Command:
        """Move the hand by one tick."""
        noise = self._draw()
        seen_position, seen_rotation = self._delay.push(observation.pose.position, observation.pose.rotation)
        share = self._share(Pose(seen_position, seen_rotation))
        if observation.time[0] < self._task.waits_s:
            velocity = turning = self._follow(seen_position, observation.dt)
        else:
            velocity = self._push(noise[:, :3], seen_position, observation.dt, share)
            turning = self._turn_hand(seen_rotation, observation.dt)
        tremor = self._shake(noise[:, 3:], observation.dt)
        if self._task.stop is not None and self._direction is not None:
            along = (observation.twist[:, :3] * self._direction).sum(-1, keepdims=True)
            tremor[:, :3] -= STOPPING_NS_M * (1.0 - share) * along * self._direction
        position, rotation, twist = self._arrival.push(
            self._position.copy(), self._rotation, np.concatenate([velocity, turning], axis=-1)
        )
        count = len(self._rngs)
        return Command(
            Pose(position, rotation), twist, self._impedance, tremor, np.full(count, Status.RUNNING), no_reasons(count)
        )

    def _draw(self) -> Float:
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[i] = rng.standard_normal((BLOCK, 9))
            self._next = 0
        self._next += 1
        sample: Float = self._noise[:, self._next - 1]
        return sample

    def _follow(self, seen: Float, dt: float) -> Float:
        """Follow the tool without a push. Returns a zero velocity (N, 3)."""
        error = self._position - seen
        self._position = self._position - error * (dt / self._hand.relaxation)
        return np.zeros_like(error)

    def _push(self, noise: Float, seen: Float, dt: float, share: float | Float) -> Float:
        """Advance the hand's position, with a share of speed and push. Returns its velocity (N, 3)."""
        settings, hand = self._settings, self._hand
        if self._direction is None and self._goal is None:
            return self._follow(seen, dt)
        error = self._position - seen
        direction = self._aimed(noise, seen, dt)
        along = (error * direction).sum(-1, keepdims=True)
        sideways = error - along * direction
        excess = np.maximum(along - share * settings.force_max / hand.stiffness, 0.0)
        velocity: Float = share * self._speed() * direction
        if not hand.gives_way:
            left = 1.0 - along * (hand.stiffness / settings.force_max)
            velocity, excess = np.clip(left, 0.0, 1.0) * velocity, np.where(share < 1.0, excess, 0.0)
        self._position = self._position + velocity * dt - sideways * (dt / hand.relaxation) - excess * direction
        return velocity

    def _share(self, seen: Pose) -> float | Float:
        """Share (N, 1) of speed and push, by the distance left to where the teacher stops the part."""
        stop = self._task.stop
        if stop is None or self._direction is None:
            return 1.0
        away = self._fixture.at(np.array(stop.at)).position - seen.at(np.array(stop.point)).position
        left = (away * self._direction).sum(-1, keepdims=True)
        share: Float = np.clip(left / STOPPING_M, 0.0, 1.0)
        return share

    def _speed(self) -> float | Float:
        own = self._hand.speed if self._settings.speed is None or self._goal is not None else self._settings.speed
        if self._goal is None:
            return own
        return np.minimum(own, norm(self._goal - self._position) / SLOWING_S)[:, None]

    def _aimed(self, noise: Float, seen: Float, dt: float) -> Float:
        """Direction of the push (N, 3), for a hand seen at (N, 3)."""
        straight = self._direction if self._goal is None else unit(self._goal - self._position)
        assert straight is not None
        self._aim += -self._aim * (dt / AIM_TIME) + self._settings.aim_noise * np.sqrt(2.0 * dt / AIM_TIME) * noise
        result: Float = unit(straight + self._aim)
        return result

    def _turn_hand(self, seen: Float, dt: float) -> Float:
        """Advance the hand's orientation. Returns its angular velocity (N, 3)."""
        hand = self._hand
        if self._aligned is not None:
            remaining = rotation_vector(self._aligned @ np.swapaxes(self._rotation, -1, -2))
            rate = unit(remaining) * np.minimum(hand.turn_rate, norm(remaining) / dt)[..., None]
        elif self._turn is not None:
            rate = hand.turn_rate * self._turn
        else:
            return np.zeros((len(seen), 3))
        turned = rotation_matrix(rate * dt) @ self._rotation
        lead = rotation_vector(turned @ np.swapaxes(seen, -1, -2))
        most = hand.torque_max / hand.turn_stiffness
        held = lead * np.minimum(1.0, most / np.maximum(norm(lead), 1e-12))[..., None]
        self._rotation = rotation_matrix(held) @ seen
        return np.zeros_like(rate)

    def _shake(self, noise: Float, dt: float) -> Float:
        settings = self._settings
        level = np.array([settings.tremor_force] * 3 + [settings.tremor_torque] * 3) * settings.scale
        self._tremor += -self._tremor * (dt / TREMOR_TIME) + level * np.sqrt(2.0 * dt / TREMOR_TIME) * noise
        return self._tremor.copy()


class _Delay:
    """Delays values by `ticks`, with the first value until then."""

    def __init__(self, ticks: int) -> None:
        self._ticks, self._line = ticks, list[tuple[Float, ...]]()

    def some(self, rows: NDArray[np.intp]) -> _Delay:
        part = _Delay(self._ticks)
        part._line = [tuple(value[rows] for value in values) for values in self._line]
        return part

    def beside(self, other: _Delay) -> _Delay:
        both = _Delay(self._ticks)
        lines = zip(self._line, other._line, strict=True)
        both._line = [tuple(map(np.concatenate, zip(*pair, strict=True))) for pair in lines]
        return both

    def push(self, *values: Float) -> tuple[Float, ...]:
        if not self._ticks:
            return values
        self._line.append(tuple(v.copy() for v in values))
        return self._line.pop(0) if len(self._line) > self._ticks else self._line[0]
