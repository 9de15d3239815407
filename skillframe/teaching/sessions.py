"""Record demonstrations from the simulated teacher: the same world, sensors and executor as a run, then one file each.

A demonstration that fails (jams, breaks a limit, runs out of time) is redrawn with the next seed of its slot and
counted; the count is part of the result and of the file's metadata.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.convention import STANDARD
from skillframe.demonstration.places import KEY, as_plain
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, SkillframeError
from skillframe.execution.executor import Result, Setup, simulate
from skillframe.execution.prepare import drive_maker
from skillframe.execution.trace import Trace
from skillframe.extend.reading import is_data_set, write_data_set, write_demonstration
from skillframe.frames import Float, Pose, matrix_from_quaternion, move_wrench, rotate
from skillframe.handover import SLOW_TICKS
from skillframe.robot.guesses import guess_note
from skillframe.robot.model import RobotModel
from skillframe.skill import Skill
from skillframe.teaching.blind import BlindSettings
from skillframe.teaching.eyes import LookingTeacher
from skillframe.teaching.staged import hand_of, teacher_for
from skillframe.teaching.teacher import TeacherSettings
from skillframe.teaching.teleoperation import OperatorSettings
from skillframe.world.placement import fixture_poses, places_in_base
from skillframe.world.scene import Scene, State, Task
from skillframe.world.sensors import SensorSettings

MOST_ATTEMPTS = 20
FIX = "lower the noise or choose another start"
"""What to do where all attempts at a demonstration failed."""
SIDE_BY_SIDE = 4
"""How many attempts follow each that failed, at once: four take little longer than one (ours)."""
MOST_AT_ONCE = 100
"""Demonstrations that are simulated side by side, so that memory does not grow with the traces of a thousand."""
RESTS_M = 1e-4
"""A person who holds on lets go once the part goes no further than this (ours): what still moves is not at its end."""
Done = Callable[[State], NDArray[np.bool_]]
Try = tuple[int, int]
"""A demonstration that is wanted, and the number of the attempt at it."""
Watch = Callable[[float, float], None]
"""Told how many seconds are simulated, and of how many at most."""
ESTIMATED = SensorSettings(force_noise=1.0, torque_noise=0.07)
"""A teleoperated machine's wrench is often an estimate: 0.4 to 2.3 N of noise are seen on such recordings."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recording(Sequence[Demonstration]):
    """Demonstrations in order, and how many attempts failed on the way, with their reasons. A sequence of the first."""

    demonstrations: list[Demonstration]
    rejected: list[str]

    def __len__(self) -> int:
        """Number of demonstrations."""
        return len(self.demonstrations)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> list[Demonstration]: ...
    def __getitem__(self, index: int | slice) -> Demonstration | list[Demonstration]:
        """One demonstration, or some."""
        return self.demonstrations[index]

    def __repr__(self) -> str:
        seconds = ", ".join(f"{d.duration:.2f} s" for d in self)
        where = f" of {self[0].meta.get('task')}" if self else ""
        return f"Recording({len(self)}{where}: {seconds}; {len(self.rejected)} redrawn)"

    def save(self, path: Path | str) -> list[Path]:
        """Write each demonstration to a file. The ending chooses the format.

        Args:
            path: of one demonstration; several get NAME1, NAME2, ... in the same folder. A name without an ending is
                that of a new LeRobot data set, of which each is an episode.

        Returns:
            the files, or the data set's folder.

        Raises:
            InputError: an ending that no format writes, or a place that cannot be written to.
        """
        path, count = Path(path), len(self)
        if is_data_set(path):
            write_data_set(self.demonstrations, path)
            return [path]
        files = [path] if count == 1 else [path.with_name(f"{path.stem}{i + 1}{path.suffix}") for i in range(count)]
        for file, demonstration in zip(files, self, strict=True):
            write_demonstration(demonstration, file)
        return files


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
    """Demonstrate a scene `count` times. The starts of the scene's task are taken in turn.

    Args:
        robot: who is taught.
        scene: what is taught.
        settings: the person.
        count: demonstrations wanted.
        seed: everything random follows from it.
        draws: quantities that hold for every demonstration (`start.*` is added to the task's own start).
        rate_hz: sample rate of the files.
        duration_s: longest demonstration; None: `longest_s`.
        sensors: noise of the sensors; a wrist sensor's if not given, an estimate's for teleoperation.
        progress: told in words what happens.
        watch: told now and then how many seconds are simulated, and of how many at most.
        attempts: at a slot, at most.
        at_once: of these, how many are simulated side by side at first. It changes no result, only how long it takes:
            several where the first is likely to fail.
        sensed: False keeps, in place of the sensor's wrench, what the arm's own law exerts, reversed: all that an arm
            without a wrench sensor knows. What accelerates the tool, and what rubs in the joints, is taken for contact.

    Raises:
        InputError: not sensed, and not by teleoperation, where alone the law is the arm's and not the person's hand.
        SkillframeError: a slot still fails after all attempts; says with what.
    """
    if not sensed and settings.kind != "teleoperation":
        raise InputError("record: sensed", "a hand on the tool is no law of the arm's", "teach by teleoperation")
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
    could_look = plain and settings.kind == "kinesthetic" and settings.looks is None
    fix = f"{FIX}, or let the person look (--looks 0.5mm; in Python looks=5e-4)" if could_look else FIX
    return collect(robot, scene, count, attempt, keep, progress, attempts, at_once, fix)


def longest_s(scene: Scene) -> float:
    """How long a person may take [s]: 12 s, or 3 s for each stage of a task of many (our choice)."""
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
    """Let a teacher attempt what is still missing until every slot has its demonstration.

    What failed is attempted four times side by side, then twenty times, or as often as is left. The first that succeeds
    is kept, as if they had been made one after the other; what comes after it is not counted.

    Args:
        robot: for the messages.
        scene: for the messages.
        count: slots to be filled.
        attempt: runs slots, each with the number of its attempt.
        keep: makes the demonstration of a slot from its trace and the number of the attempt.
        progress: told in words what happens.
        attempts: at a slot, at most.
        at_once: of these, how many are run side by side at first.
        fix: what to do where all fail.

    Raises:
        SkillframeError: a slot still fails after all attempts; says with what.
    """
    done: dict[int, Demonstration] = {}
    rejected: list[str] = []
    if progress is not None:
        progress(beginning(robot, scene, count))
    number = 0
    while number < attempts:
        ahead = range(number, min(number + max(SIDE_BY_SIDE * number, at_once), attempts))
        tries = deque((slot, each) for each in ahead for slot in range(count) if slot not in done)
        while some := _still_due(tries, done):
            result = attempt(some)
            assert result.traces is not None
            ends = zip(some, result.success, result.failure, result.traces, strict=True)
            for (slot, each), good, failure, trace in ends:
                if slot in done:
                    continue
                if good:
                    done[slot] = keep(trace, slot, each)
                else:
                    rejected.append(f"demonstration {slot}, attempt {each}: {failure}")
        number = ahead.stop
        if progress is not None:
            progress(f"{len(done)} of {count} demonstrations recorded, {len(rejected)} rejected")
            if rejected and (note := guess_note(robot.spec)):
                progress(f"note: {note}")
        if len(done) == count:
            return Recording(demonstrations=[done[slot] for slot in range(count)], rejected=rejected)
    raise SkillframeError(
        f"world {scene.name}: the teacher failed {attempts} times for one demonstration "
        f"(last: {rejected[-1]}); {fix}" + (f"; {note}" if (note := guess_note(robot.spec)) else "")
    )


def _still_due(tries: deque[Try], done: Mapping[int, Demonstration]) -> list[Try]:
    """The next that are run side by side, taken off without those that have succeeded meanwhile."""
    some: list[Try] = []
    while tries and len(some) < MOST_AT_ONCE:
        one = tries.popleft()
        if one[0] not in done:
            some.append(one)
    return some


def beginning(robot: RobotModel, scene: Scene, count: int) -> str:
    """Said once nothing speaks against the recording any more."""
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
        attempts_at=tuple(slot for slot, _ in tries), make_drive=drive_maker(robot),
    )  # fmt: skip
    rngs = [np.random.default_rng([seed, slot, number]) for slot, number in tries]
    told = progress_callback(watch, duration_s)
    return simulate(teacher, setup, columns, rngs, duration_s=duration_s, trace_hz=rate_hz, progress=told)


def person_for(scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool) -> Skill:
    """Who demonstrates a scene: somebody who looks, if the settings say how exactly, or the teacher of its stages."""
    if settings.looks is None:
        return teacher_for(scene, fixture, settings, firmly)
    return LookingTeacher(scene, fixture, settings, hand_of(scene.task, firmly))


def _held(task: Task, done: Done, tick_hz: float) -> Done:
    """`done`, once it has been so for `task.held_s` without the tip going further. It is asked every `SLOW_TICKS`."""
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
    """Progress of a simulation for `watch`: simulated time and longest duration [s]. None without a watch."""
    return None if watch is None else lambda now: watch(now, duration_s)


def start_columns(scene: Scene, slots: Sequence[int], draws: Mapping[str, float]) -> dict[str, Float]:
    """Quantities (N,) of the slots: the task's starts in turn, `start.*` draws added to them, others as given."""
    starts = [{**scene.task.starts[slot % len(scene.task.starts)]} for slot in slots]
    for start in starts:
        for key, value in draws.items():
            start[key] = start.get(key, 0.0) + value if key.startswith("start.") else value
    keys = sorted({key for start in starts for key in start})
    return {key: np.array([start.get(key, 0.0) for start in starts]) for key in keys}


def demonstration_from(
    trace: Trace, scene: Scene, settings: TeacherSettings | BlindSettings | OperatorSettings,
    sensors: SensorSettings | None = None, *, places: Mapping[str, Pose] | None = None,
    **provenance: int,
) -> Demonstration:  # fmt: skip
    """A demonstration at the tool point out of a trace taken at the handle. The wrench is as sensed, not filtered.

    `places` are poses in base that the recording is to name.
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
        **({KEY: as_plain(dict(places))} if places else {}),
    }  # fmt: skip
    return Demonstration(
        time=trace.time.copy(), position=pose.at(-handle).position, quaternion=trace.quaternion.copy(),
        wrench=move_wrench(trace.wrench, rotate(pose.rotation, -handle)), meta=meta, source=scene.name,
    )  # fmt: skip
