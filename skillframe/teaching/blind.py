r"""A simulated person who searches blindfolded: no sight, no sound, only a belief of where the goal may be.

Published (seed, section on search; [5]): teachers were blindfolded and the relative pose of start and goal was varied.
How they moved was not published, so **every figure here is our assumption**, not human data:

    goal - start ~ N(centre, believed^2), cut at 2.5 standard deviations            drawn again for each demonstration
    via points: a local step of lognormal length (6 in 10), else a fresh draw of the belief
    between them: minimum jerk, s = 10 u^3 - 15 u^4 + 6 u^5, lasting length / speed + 0.15 s, then a dwell
    push: force + Ornstein-Uhlenbeck noise; in 15 of 100 segments a tap, the part just lifted for most of the way
    hand: 1000 N/m across the push, none along it; it leans on until the part is where he means it, within 0.2 s,
    because he feels where the part is (or friction alone would hold it 2 mm behind)

The teacher ends when the part falls in (he feels it) or when his time is up. It is a skill, run by the one executor in
the same world with the same sensors as any run. Rotation about the push is searched too if its belief is not zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, cross, norm, rotation_matrix, unit
from skillframe.skill import Command, Impedance, Observation, Reasons, Skill, Status, no_reasons
from skillframe.world.scene import Vector

LEVER = 0.023  # m per rad: what a turn counts as in the length of a step
CUT = 2.5
"""Standard deviations at which a belief ends: nobody looks farther away."""
REST_S = 1.0  # the push grows for this long before the hand moves
SMOOTH_S = 0.1  # how gently the push changes
LEAN_S, LEAN_M = 0.2, 0.004  # how fast, and how far at most, the hand leans on


@dataclass(frozen=True, slots=True, kw_only=True)
class BlindSettings:
    """How a blindfolded person searches (see the module's text).

    Attributes:
        believed: standard deviations of goal minus start: two along the surface [m], one about its normal [rad].
        centre: mean of goal minus start, alike.
        time_s: how long the person searches.
        speed: [m/s], between via points.
        force: of the push [N]; force_noise: its standard deviation [N].
        local: share of via points that are a local step; step: their median length [m].
        dwell_s: shortest and longest pause at a via point.
        taps: share of segments with the part lifted.
        tremor: amplitude [m] at 8 Hz.
        stiffness, turn_stiffness: of the hand across the push [N/m, Nm/rad].
    """

    kind: str = "blind"
    believed: Vector = (0.004, 0.004, 0.0)
    centre: Vector = (0.0, 0.0, 0.0)
    time_s: float = 30.0
    speed: float = 0.02
    force: float = 10.0
    force_noise: float = 2.0
    local: float = 0.6
    step: float = 0.003
    dwell_s: tuple[float, float] = (0.1, 0.4)
    taps: float = 0.15
    tremor: float = 1e-4
    stiffness: float = 1000.0
    turn_stiffness: float = 60.0

    def __post_init__(self) -> None:
        if min(self.believed) < 0.0 or max(self.believed[:2]) <= 0.0:
            raise InputError(
                "blind teacher", f"a belief of {self.believed} leaves nothing to search", "give positive spreads"
            )
        if min(self.time_s, self.speed, self.force, self.stiffness, self.turn_stiffness, self.step) <= 0.0:
            raise InputError("blind teacher", "time, speed, force, step and stiffness must be positive", "change it")

    @property
    def scale(self) -> Float:
        """(3,) believed spreads in metres, the turn through `LEVER`."""
        return np.array(self.believed) * [1.0, 1.0, LEVER]

    def draw(self, rng: np.random.Generator) -> Float:
        """(3,) a goal relative to the start out of the belief, the turn through `LEVER` [m]."""
        while True:
            sample = rng.standard_normal(3)
            if norm(sample) <= CUT:
                return np.array(self.centre) * [1.0, 1.0, LEVER] + self.scale * sample


class _Script(NamedTuple):
    """One trial's plan, a row per tick: where across the surface, how fast (T, 3) [m, m/s], how hard (T,) [N]."""

    place: Float
    rate: Float
    push: Float


class BlindTeacher(Skill):
    """A blindfolded person's hand on N tools.

    Args:
        direction: (3,) unit vector along which the person pushes, base axes.
        settings: how the person searches.
    """

    FELT_M = 0.003  # a drop that the person feels as falling in

    def __init__(self, direction: Float, settings: BlindSettings) -> None:
        self._push, self._settings = unit(np.asarray(direction, dtype=float)), settings
        across = np.eye(3)[0 if abs(self._push[0]) < 0.9 else 1]
        first = unit(across - (across @ self._push) * self._push)
        self._axes = np.stack([first, cross(-self._push, first), -self._push])  # last: the turn's axis

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take hold of the tool where it is, and decide the way blindly."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        scripts = [_script(self._settings, rng, observation.dt) for rng in rngs]
        self._place, self._rate, self._force = (np.stack(part) for part in zip(*scripts, strict=True))
        along = np.outer(self._push, self._push)
        stiff, turning = self._settings.stiffness, self._settings.turn_stiffness
        stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
        stiffness[:3, :3], stiffness[3:, 3:] = stiff * (np.eye(3) - along), turning * np.eye(3)
        # 60 Ns/m across; 200 Ns/m along, because a person lets a part down rather than drops it
        damping[:3, :3], damping[3:, 3:] = 60.0 * np.eye(3) + 140.0 * along, 1.5 * np.eye(3)
        self._impedance, self._tick = Impedance(stiffness, damping), 0
        self._level, self._lean = np.full(len(rngs), np.nan), np.zeros((len(rngs), 2))

    def step(self, observation: Observation) -> Command:
        """Follow the script. End where the part has fallen in."""
        tick = min(self._tick, self._place.shape[1] - 1)
        place, rate, force = self._place[:, tick], self._rate[:, tick], self._force[:, tick]
        self._tick += 1
        count = len(place)
        where = (observation.pose.position - self._home.position) @ self._axes[:2].T
        self._lean = np.clip(self._lean + (place[:, :2] - where) * (observation.dt / LEAN_S), -LEAN_M, LEAN_M)
        position = self._home.position + (place[:, :2] + self._lean) @ self._axes[:2]
        normal = self._axes[2]
        rotation = rotation_matrix(place[:, 2:] / LEVER * normal) @ self._home.rotation
        twist = np.concatenate([rate[:, :2] @ self._axes[:2], rate[:, 2:] / LEVER * normal], axis=-1)
        feedforward = np.concatenate([force[:, None] * self._push, np.zeros((count, 3))], axis=-1)
        status, reason = self._judge(observation, over=self._tick > self._place.shape[1])
        return Command(Pose(position, rotation), twist, self._impedance, feedforward, status, reason)

    def _judge(self, observation: Observation, over: bool) -> tuple[NDArray[np.int64], Reasons]:
        """The lowest level of the first second of contact is the surface. From there a drop is felt."""
        depth = (observation.pose.position - self._home.position) @ self._push
        if self._tick * observation.dt <= REST_S:
            self._level = np.fmax(self._level, depth)
        fallen = depth - self._level > self.FELT_M
        status = np.where(fallen | over, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        reason = no_reasons(len(depth))
        reason[status == Status.SUCCESS] = f"searched for {self._settings.time_s:g} s without finding it"
        reason[fallen] = "felt it fall in"
        return status, reason


def _script(settings: BlindSettings, rng: np.random.Generator, dt: float) -> _Script:
    """Via points joined by minimum jerk, dwells, and the push."""
    total = round(settings.time_s / dt)
    rest = round(REST_S / dt)
    place, rate, wanted = [np.zeros((rest, 3))], [np.zeros((rest, 3))], [np.full(rest, settings.force)]
    here, length = np.zeros(3), rest
    while length < total:
        there = _via(settings, rng, here)
        moving = max(round((float(norm(there - here)) / settings.speed + 0.15) / dt), 2)
        pausing = round(rng.uniform(*settings.dwell_s) / dt)
        u = (np.arange(moving) + 1.0)[:, None] / moving
        place += [here + (there - here) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2), np.tile(there, (pausing, 1))]
        rate += [(there - here) * 30.0 * u**2 * (1.0 - u) ** 2 / (moving * dt), np.zeros((pausing, 3))]
        lifted = round(0.8 * moving) if rng.random() < settings.taps else 0
        wanted += [np.full(lifted, -0.8), np.full(moving + pausing - lifted, settings.force)]
        here, length = there, length + moving + pausing
    push = _felt(np.concatenate(wanted)[:total], settings, rng, dt)
    return _Script(_shaken(np.concatenate(place)[:total], settings, rng, dt), np.concatenate(rate)[:total], push)


def _via(settings: BlindSettings, rng: np.random.Generator, here: Float) -> Float:
    """The next place: a local step inside the belief, or a fresh draw of it."""
    searched = settings.scale > 0.0
    for _ in range(20):  # a step that would leave the belief is drawn again
        if rng.random() >= settings.local:
            break
        there = here + rng.lognormal(np.log(settings.step), 0.5) * unit(rng.standard_normal(3) * searched)
        away = (there - np.array(settings.centre) * [1.0, 1.0, LEVER])[searched] / settings.scale[searched]
        if norm(away) <= CUT:
            return there
    return settings.draw(rng)


def _felt(wanted: Float, settings: BlindSettings, rng: np.random.Generator, dt: float) -> Float:
    """The push [N]: what is wanted, noise of 0.5 s, and no sudden change. It grows from nothing over the rest."""
    noise, level = rng.standard_normal(len(wanted)), 0.0
    push, felt = np.empty(len(wanted)), 0.0
    for k, target in enumerate(wanted.tolist()):
        level += -level * dt / 0.5 + settings.force_noise * np.sqrt(2.0 * dt / 0.5) * noise[k]
        grown = min(1.0, k * dt / REST_S)
        felt += (target + level * (target > 0.0) - felt) * dt / SMOOTH_S
        push[k] = grown * felt
    return push


def _shaken(place: Float, settings: BlindSettings, rng: np.random.Generator, dt: float) -> Float:
    """Tremor at 8 Hz across the surface, growing from nothing over the rest."""
    time = np.arange(len(place)) * dt
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    grown = np.minimum(time / REST_S, 1.0)[:, None]
    shaken = place.copy()
    shaken[:, :2] += settings.tremor * grown * np.sin(2.0 * np.pi * 8.0 * time[:, None] + phase)
    return shaken
