r"""A simulated teacher who searches blindfolded, guided by a belief about the goal and by contact.

In the published experiments ([5]) teachers were blindfolded and the relative pose of start and goal was varied. Their
motion was not published, so **every figure here is an assumption**:

    goal - start ~ N(centre, believed^2), cut at 2.5 standard deviations      sampled for each demonstration
    via points: a local step of lognormal length (6 in 10), else a sample of the belief
    between them: minimum jerk, s = 10 u^3 - 15 u^4 + 6 u^5, lasting length / speed + 0.15 s, then a dwell
    push: force + Ornstein-Uhlenbeck noise; in 15 of 100 segments the part is lifted for most of the way
    hand: 1000 N/m across the push, none along it, and an integrator of 0.2 s that overcomes friction

The search ends when the part falls in or time is up.

Every search is a demonstration, whether it finds the goal or not. One that breaks a limit is counted and repeated with
the next seed of its slot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError, SkillframeError
from skillframe.execution import Result, Setup, simulate
from skillframe.extend import Recording
from skillframe.frames import Float, Pose, cross, norm, rotation_matrix, unit
from skillframe.robot import RobotModel, guess_note
from skillframe.skill import Command, Impedance, Observation, Reasons, Skill, Status, no_reasons
from skillframe.world import Scene, SensorSettings, Vector
from skillframe_teaching.sessions import (
    MOST_ATTEMPTS,
    Watch,
    beginning,
    demonstration_from,
    progress_callback,
)

LEVER = 0.023  # m per rad: weight of rotation in the length of a step
CUT = 2.5
"""Limit of the search in standard deviations of the belief."""
REST_S = 1.0  # rise time of the push before the search
SMOOTH_S = 0.1  # time constant of the push
LEAN_S, LEAN_M = 0.2, 0.004  # time constant and limit of the integrator


@dataclass(frozen=True, slots=True, kw_only=True)
class BlindSettings:
    """Settings of a blindfolded teacher.

    Attributes:
        believed: standard deviations of goal minus start: two along the surface [m], one about its normal [rad].
        centre: mean of goal minus start, in the same units.
        time_s: length of the search.
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
        """Believed spreads (3,) [m], rotation scaled by `LEVER`."""
        return np.array(self.believed) * [1.0, 1.0, LEVER]

    def draw(self, rng: np.random.Generator) -> Float:
        """Sample (3,) of the goal relative to the start [m], rotation scaled by `LEVER`."""
        while True:
            sample = rng.standard_normal(3)
            if norm(sample) <= CUT:
                return np.array(self.centre) * [1.0, 1.0, LEVER] + self.scale * sample


class _Script(NamedTuple):
    """One trial by tick: place across the surface [m] and its rate [m/s] (T, 3), push [N] (T,)."""

    place: Float
    rate: Float
    push: Float


class BlindTeacher(Skill):
    """A blindfolded teacher's hand on N tools, pushing along `direction` (3,) in base axes."""

    FELT_M = 0.003  # a drop that the teacher feels

    def __init__(self, direction: Float, settings: BlindSettings) -> None:
        self._push, self._settings = unit(np.asarray(direction, dtype=float)), settings
        across = np.eye(3)[0 if abs(self._push[0]) < 0.9 else 1]
        first = unit(across - (across @ self._push) * self._push)
        self._axes = np.stack([first, cross(-self._push, first), -self._push])  # last: the rotation axis

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold the tool where it is, and plan the motion."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        scripts = [_script(self._settings, rng, observation.dt) for rng in rngs]
        self._place, self._rate, self._force = (np.stack(part) for part in zip(*scripts, strict=True))
        along = np.outer(self._push, self._push)
        stiff, turning = self._settings.stiffness, self._settings.turn_stiffness
        stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
        stiffness[:3, :3], stiffness[3:, 3:] = stiff * (np.eye(3) - along), turning * np.eye(3)
        # 60 Ns/m across; 200 Ns/m along, to let the part down gently
        damping[:3, :3], damping[3:, 3:] = 60.0 * np.eye(3) + 140.0 * along, 1.5 * np.eye(3)
        self._impedance, self._tick = Impedance(stiffness, damping), 0
        self._level, self._lean = np.full(len(rngs), np.nan), np.zeros((len(rngs), 2))

    def step(self, observation: Observation) -> Command:
        """Follow the plan until the part falls in."""
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
        depth = (observation.pose.position - self._home.position) @ self._push
        if self._tick * observation.dt <= REST_S:
            self._level = np.fmax(self._level, depth)
        fallen = depth - self._level > self.FELT_M
        status = np.where(fallen | over, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        reason = no_reasons(len(depth))
        reason[status == Status.SUCCESS] = f"searched for {self._settings.time_s:g} s without finding it"
        reason[fallen] = "noticed that the part fell in"
        return status, reason


def _script(settings: BlindSettings, rng: np.random.Generator, dt: float) -> _Script:
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
    searched = settings.scale > 0.0
    for _ in range(20):  # a step that leaves the belief is sampled again
        if rng.random() >= settings.local:
            break
        there = here + rng.lognormal(np.log(settings.step), 0.5) * unit(rng.standard_normal(3) * searched)
        away = (there - np.array(settings.centre) * [1.0, 1.0, LEVER])[searched] / settings.scale[searched]
        if norm(away) <= CUT:
            return there
    return settings.draw(rng)


def _felt(wanted: Float, settings: BlindSettings, rng: np.random.Generator, dt: float) -> Float:
    """Push [N]: the desired value with 0.5 s noise, smoothed, rising from zero during the rest."""
    noise, level = rng.standard_normal(len(wanted)), 0.0
    push, felt = np.empty(len(wanted)), 0.0
    for k, target in enumerate(wanted.tolist()):
        level += -level * dt / 0.5 + settings.force_noise * np.sqrt(2.0 * dt / 0.5) * noise[k]
        grown = min(1.0, k * dt / REST_S)
        felt += (target + level * (target > 0.0) - felt) * dt / SMOOTH_S
        push[k] = grown * felt
    return push


def _shaken(place: Float, settings: BlindSettings, rng: np.random.Generator, dt: float) -> Float:
    time = np.arange(len(place)) * dt
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    grown = np.minimum(time / REST_S, 1.0)[:, None]
    shaken = place.copy()
    shaken[:, :2] += settings.tremor * grown * np.sin(2.0 * np.pi * 8.0 * time[:, None] + phase)
    return shaken


HANDLE = "grip"  # near the tip, as a pen is held


def blindfolded(scene: Scene) -> BlindSettings:
    """Default settings of a blindfolded teacher, who believes what the task states of the goal's place."""
    return BlindSettings(believed=scene.task.believed)


def record_blind(
    robot: RobotModel,
    scene: Scene,
    settings: BlindSettings,
    *,
    count: int,
    seed: int,
    draws: Mapping[str, float] | None = None,
    rate_hz: float = 500.0,
    sensors: SensorSettings | None = None,
    progress: Callable[[str], None] | None = None,
    watch: Watch | None = None,
) -> Recording:
    """Search a scene blindly `count` times, each from its own start.

    Args:
        robot: the robot.
        scene: the scene, of whose task only `direction` is used, for the push.
        settings: of the teacher.
        count: number of demonstrations.
        seed: determines everything random.
        draws: quantities of all demonstrations (`start.*` is added to the sampled start).
        rate_hz: sample rate of the files.
        sensors: noise of the sensors.
        progress: called with messages.
        watch: called with the simulated and the maximum time [s].

    Raises:
        InputError: the world has no direction to push in.
        SkillframeError: a slot still fails after 20 attempts, with the reason.
    """
    if scene.task.direction is None or not scene.fixture:
        raise InputError(f"world {scene.name}", "has no surface to search on", "choose peg_in_hole or socket")
    done: dict[int, Demonstration] = {}
    rejected: list[str] = []
    if progress is not None:
        progress(beginning(robot, scene, count))
    for attempt in range(MOST_ATTEMPTS):
        slots = [slot for slot in range(count) if slot not in done]
        result, handle = _attempt(robot, scene, settings, slots, attempt, seed, draws or {}, rate_hz, sensors, watch)
        assert result.traces is not None
        for i, slot in enumerate(slots):
            if result.status[i] == Status.SUCCESS:
                felt = sensors or SensorSettings()
                kept = demonstration_from(
                    result.traces[i], scene, settings, felt, seed=seed, slot=slot, attempt=attempt
                )
                done[slot] = replace(kept, meta={**kept.meta, "hand": handle, "ending": str(result.reason[i])})
            else:
                rejected.append(f"demonstration {slot}, attempt {attempt}: {result.failure[i]}")
        if progress is not None:
            progress(f"{len(done)} of {count} searches recorded, {len(rejected)} rejected")
            if rejected and (note := guess_note(robot.spec)):
                progress(f"note: {note}")
        if len(done) == count:
            return Recording(demonstrations=[done[slot] for slot in range(count)], rejected=rejected)
    raise SkillframeError(
        f"world {scene.name}: the blind teacher failed {MOST_ATTEMPTS} times for one demonstration "
        f"(last: {rejected[-1]}); push less or raise the robot's limits"
        + (f"; {note}" if (note := guess_note(robot.spec)) else "")
    )


def _attempt(
    robot: RobotModel, scene: Scene, settings: BlindSettings, slots: list[int], attempt: int, seed: int,
    draws: Mapping[str, float], rate_hz: float, sensors: SensorSettings | None, watch: Watch | None,
) -> tuple[Result, str]:  # fmt: skip
    starts = [_start(settings, np.random.default_rng([seed, slot, attempt, 1])) for slot in slots]
    for start in starts:
        for key, value in draws.items():
            start[key] = start.get(key, 0.0) + value if key.startswith("start.") else value
    columns = {key: np.array([start[key] for start in starts]) for key in starts[0]}
    handle = HANDLE if HANDLE in scene.tool.frames else scene.tool.hand
    setup = Setup(
        robot=robot.guided(), scene=scene, center_of_compliance=np.array(scene.tool.frames[handle]),
        sensors=sensors or SensorSettings(), filter_wrench=False,
    )  # fmt: skip
    rngs = [np.random.default_rng([seed, slot, attempt]) for slot in slots]
    teacher = BlindTeacher(np.array(scene.task.direction), settings)
    longest = settings.time_s + 1.0
    told = progress_callback(watch, longest)
    return simulate(teacher, setup, columns, rngs, duration_s=longest, trace_hz=rate_hz, progress=told), handle


def _start(settings: BlindSettings, rng: np.random.Generator) -> dict[str, float]:
    x, y, turn = (float(value) for value in -settings.draw(rng))
    return {"start.offset_x": x, "start.offset_y": y, "start.tilt_z": turn / LEVER}
