"""Records demonstrations of the simulated teacher with the world, sensors and executor of a run.

A failed demonstration (jammed, over a limit, out of time) is counted and repeated with the next seed of its slot.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import STANDARD, Demonstration
from skillframe.document import PLACES, as_plain
from skillframe.errors import InputError, SkillframeError
from skillframe.execution import Result, Setup, Trace, require_starts, simulate
from skillframe.extend import Recording
from skillframe.frames import Float, Pose, matrix_from_quaternion, move_wrench, rotate
from skillframe.handover import SLOW_TICKS
from skillframe.robot import RobotModel, guess_note
from skillframe.skill import Ended, Skill
from skillframe.world import Scene, SensorSettings, State, Task, fixture_poses, places_in_base
from skillframe_teaching.eyes import SeeingTeacher
from skillframe_teaching.staged import hand_of, teacher_for
from skillframe_teaching.teacher import TeacherSettings

MOST_ATTEMPTS = 20
FIX = "lower the noise or choose another start"
"""Advice where all attempts failed."""
AT_ONCE_S = 0.1
"""Time [s] before which any failure but the time limit is due to the start, not to the teacher's noise."""
SIDE_BY_SIDE = 4
"""Attempts simulated together after a failure: four take little longer than one."""
MOST_AT_ONCE = 100
"""Demonstrations simulated together, which bounds the memory for traces."""
RESTS_M = 1e-4
"""Motion [m] below which a teacher who holds on lets go."""
Done = Callable[[State], NDArray[np.bool_]]
Try = tuple[int, int]
"""Slot of a demonstration, and number of the attempt."""
Watch = Callable[[float, float], None]
"""Called with the simulated and the maximum time [s]."""
ESTIMATED = SensorSettings(force_noise=1.0, torque_noise=0.07)
"""A teleoperated machine's wrench is often an estimate, with 0.4 to 2.3 N of noise on recordings."""


def by_hand(scene: Scene) -> TeacherSettings:
    """Default settings of a teacher with a hand on the robot."""
    return TeacherSettings()


def at_a_distance(scene: Scene) -> TeacherSettings:
    """Default settings of a teacher at a teleoperation station: 0.1 s one way, the master's motion doubled."""
    return TeacherSettings(kind="teleoperation", delay_s=0.1, scale=2.0)


def record(
    robot: RobotModel,
    scene: Scene,
    settings: TeacherSettings,
    *,
    count: int,
    seed: int,
    draws: Mapping[str, float] | None = None,
    rate_hz: float = 500.0,
    duration_s: float | None = None,
    sensors: SensorSettings | None = None,
    progress: Callable[[str], None] | None = None,
    watch: Watch | None = None,
    attempts: int = MOST_ATTEMPTS,
    at_once: int = 1,
    sensed: bool = True,
) -> Recording:
    """Demonstrate a scene `count` times, with the starts of its task in turn.

    Args:
        robot: the robot.
        scene: the scene.
        settings: of the teacher.
        count: number of demonstrations.
        seed: determines everything random.
        draws: quantities of all demonstrations (`start.*` is added to the task's start).
        rate_hz: sample rate of the files.
        duration_s: longest demonstration; None: `longest_s`.
        sensors: noise of the sensors; by default a wrist sensor's, or an estimate's for teleoperation.
        progress: called with messages.
        watch: called with the simulated and the maximum time [s].
        attempts: most attempts per slot.
        at_once: attempts simulated together at first, faster if the first is likely to fail. Results do not depend on
            it.
        sensed: False records the arm's own reversed command wrench in place of the sensor's, as an arm without a sensor
            would; it includes inertia of the tool and friction of the joints.

    Raises:
        InputError: not sensed without teleoperation, or a start in penetration.
        SkillframeError: a slot still fails after all attempts, with the reason.
    """
    if not sensed and settings.kind != "teleoperation":
        raise InputError(
            "record: sensed", "a kinesthetic teacher moves the arm without its controller", "teach by teleoperation"
        )
    longest = longest_s(scene) if duration_s is None else duration_s
    sensors = sensors or (ESTIMATED if settings.kind == "teleoperation" else SensorSettings())

    def attempt(tries: Sequence[Try]) -> Result:
        return _attempt(robot, scene, settings, tries, seed, draws or {}, rate_hz, longest, sensors, watch)

    def keep(trace: Trace, slot: int, number: int) -> Demonstration:
        trace = trace if sensed else replace(trace, wrench=-trace.command_wrench)
        return demonstration_from(
            trace, scene, settings, sensors, places=places_in_base(robot, scene), seed=seed, slot=slot, attempt=number
        )  # fmt: skip

    plain = scene.task.direction is not None and not scene.task.then
    could_see = plain and settings.kind == "kinesthetic" and settings.vision_error is None
    fix = (
        f"{FIX}, or give the teacher vision (--set teacher.vision_error=0.5mm; in Python vision_error=5e-4)"
        if could_see
        else FIX
    )
    return collect(robot, scene, count, attempt, keep, progress, attempts, at_once, fix)


def longest_s(scene: Scene) -> float:
    """Time limit of a demonstration [s]: 12 s, or 3 s per stage if that is more."""
    return max(12.0, 3.0 * (1 + len(scene.task.then)))


def collect(
    robot: RobotModel,
    scene: Scene,
    count: int,
    attempt: Callable[[Sequence[Try]], Result],
    keep: Callable[[Trace, int, int], Demonstration],
    progress: Callable[[str], None] | None,
    attempts: int = MOST_ATTEMPTS,
    at_once: int = 1,
    fix: str = FIX,
) -> Recording:
    """Run attempts until every slot has its demonstration.

    After a failure four attempts are simulated together, then twenty. The first success counts, as if attempts had been
    made in sequence. `attempt` runs slots, each with the number of its attempt; `keep` makes a slot's demonstration.

    Raises:
        SkillframeError: a slot still fails after all attempts, with the reason.
    """
    done: dict[int, Demonstration] = {}
    rejected: list[str] = []
    latest = 0.0
    failures: list[str] = []
    if progress is not None:
        progress(beginning(robot, scene, count))
    number = 0
    while number < attempts:
        ahead = range(number, min(number + max(SIDE_BY_SIDE * number, at_once), attempts))
        tries = deque((slot, each) for each in ahead for slot in range(count) if slot not in done)
        while some := _still_due(tries, done):
            result = attempt(some)
            require_starts(result.ended_by, result.reason)
            assert result.traces is not None
            ended = np.where(result.ended_by == Ended.TIME.value, np.inf, result.duration_s)  # [s]
            ends = zip(some, result.success, result.failure, ended, result.traces, strict=True)
            for (slot, each), good, failure, lasted, trace in ends:
                if slot in done:
                    continue
                if good:
                    done[slot] = keep(trace, slot, each)
                else:
                    latest = max(latest, lasted)
                    rejected.append(f"demonstration {slot}, attempt {each}: {failure}")
                    failures.append(failure)
        first, number = not number, ahead.stop
        if progress is not None:
            progress(f"{len(done)} of {count} demonstrations recorded, {len(rejected)} rejected")
            if rejected and (note := guess_note(robot.spec)):
                progress(f"note: {note}")
            if len(done) < count and first:
                progress(f"note: {_commonest(failures)}; {fix}. It goes on meanwhile, at most {attempts} attempts each")
        if len(done) == count:
            return Recording(demonstrations=[done[slot] for slot in range(count)], rejected=rejected)
    fix = fix if latest > AT_ONCE_S else "choose another start: none of these got away from its own"
    raise SkillframeError(
        f"world {scene.name}: the teacher failed {attempts} times for one demonstration "
        f"(last: {rejected[-1]}); {fix}" + (f"; {note}" if (note := guess_note(robot.spec)) else "")
    )


def _commonest(failures: Sequence[str]) -> str:
    causes = Counter(re.split(r"[:,(]|\d", failure)[0].strip() for failure in failures)
    cause, often = causes.most_common(1)[0]
    return f"{often} of {len(failures)} failed alike: {next(each for each in failures if each.startswith(cause))}"


def _still_due(tries: deque[Try], done: Mapping[int, Demonstration]) -> list[Try]:
    some: list[Try] = []
    while tries and len(some) < MOST_AT_ONCE:
        one = tries.popleft()
        if one[0] not in done:
            some.append(one)
    return some


def beginning(robot: RobotModel, scene: Scene, count: int) -> str:
    """Message at the start of a recording."""
    return f"{robot.spec.name} in {scene.name}: recording {count} demonstration{'s' * (count != 1)} ..."


def _attempt(
    robot: RobotModel, scene: Scene, settings: TeacherSettings, tries: Sequence[Try], seed: int,
    draws: Mapping[str, float], rate_hz: float, duration_s: float, sensors: SensorSettings | None,
    watch: Watch | None,
) -> Result:  # fmt: skip
    columns = start_columns(scene, [slot for slot, _ in tries], draws)
    teacher = person_for(scene, fixture_poses(robot, columns, len(tries)), settings, robot.spec.servo)
    last = (scene.task, *scene.task.then)[-1]
    setup = Setup(
        robot=robot.guided(), scene=scene, center_of_compliance=np.array(scene.tool.frames[scene.tool.hand]),
        sensors=sensors or SensorSettings(), filter_wrench=False,
        stop_when=_held(last, last.done or scene.goal, robot.spec.control.tick_hz),
        attempts_at=tuple(slot for slot, _ in tries),
    )  # fmt: skip
    rngs = [np.random.default_rng([seed, slot, number]) for slot, number in tries]
    told = progress_callback(watch, duration_s)
    return simulate(teacher, setup, columns, rngs, duration_s=duration_s, trace_hz=rate_hz, progress=told)


def person_for(scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool) -> Skill:
    """The teacher of a scene, with vision if `settings.vision_error` is set."""
    if settings.vision_error is None:
        return teacher_for(scene, fixture, settings, firmly)
    return SeeingTeacher(scene, fixture, settings, hand_of(scene.task, firmly))


def _held(task: Task, done: Done, tick_hz: float) -> Done:
    """`done`, once it has held for `task.held_s` with the tip at rest. Called every `SLOW_TICKS`."""
    ticks = task.held_s * tick_hz / SLOW_TICKS
    times, reached = np.zeros(()), np.full((), -np.inf)

    def held(state: State) -> NDArray[np.bool_]:
        nonlocal times, reached
        times = np.where(done(state), times + 1.0, 0.0)
        if task.held_s and task.direction is not None:
            along = state.tip.position @ np.array(task.direction)
            further = along > reached + RESTS_M
            times, reached = np.where(further, 0.0, times), np.where(further, along, reached)
        found: NDArray[np.bool_] = times > ticks
        return found

    return held


def progress_callback(watch: Watch | None, duration_s: float) -> Callable[[float], None] | None:
    """Adapter from `watch` to a progress callback with the simulated time, or None."""
    return None if watch is None else lambda now: watch(now, duration_s)


def start_columns(scene: Scene, slots: Sequence[int], draws: Mapping[str, float]) -> dict[str, Float]:
    """Quantities (N,) of the slots: the task's starts in turn plus `start.*` draws, others as given."""
    starts = [{**scene.task.starts[slot % len(scene.task.starts)]} for slot in slots]
    for start in starts:
        for key, value in draws.items():
            start[key] = start.get(key, 0.0) + value if key.startswith("start.") else value
    keys = sorted({key for start in starts for key in start})
    return {key: np.array([start.get(key, 0.0) for start in starts]) for key in keys}


def demonstration_from(
    trace: Trace, scene: Scene, settings: Any,
    sensors: SensorSettings | None = None, *, places: Mapping[str, Pose] | None = None,
    **provenance: int,
) -> Demonstration:  # fmt: skip
    """A demonstration at the tool point from a trace at the handle, with the unfiltered wrench.

    `settings` is the dataclass of the teacher, with `kind`. `places` are poses in base to be named in the recording.
    """
    pose = Pose(trace.position, matrix_from_quaternion(trace.quaternion))
    handle: Float = np.array(trace.meta["center_of_compliance"])
    noise = sensors or SensorSettings()
    meta = {
        "task": scene.name, "teacher": settings.kind, "rate": float(1.0 / np.median(np.diff(trace.time))),
        "frames": {name: list(point) for name, point in scene.tool.frames.items()}, "hand": scene.tool.hand,
        "contact": bool(scene.fixture), "simulated": {**asdict(settings), **provenance},
        "robot": trace.meta["robot"], "world": {"name": scene.name, "params": scene.params},
        "sensor": {"force_noise": noise.force_noise, "torque_noise": noise.torque_noise},
        "stages": [time for time, _ in trace.meta["events"]], "wrench": dict(STANDARD),
        **({PLACES: as_plain(dict(places))} if places else {}),
    }  # fmt: skip
    return Demonstration(
        time=trace.time.copy(), position=pose.at(-handle).position, quaternion=trace.quaternion.copy(),
        wrench=move_wrench(trace.wrench, rotate(pose.rotation, -handle)), meta=meta, source=scene.name,
    )  # fmt: skip
