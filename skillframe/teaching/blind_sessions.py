"""Record blind searches: starts drawn from the person's belief, and every search kept, found or not.

A search that breaks a limit is redrawn with the next seed of its slot and counted. What a learner needs is where the
person looked and what it felt like, so that a search which did not find the goal in its time is a demonstration too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, SkillframeError
from skillframe.execution.executor import Result, Setup, simulate
from skillframe.execution.prepare import drive_maker
from skillframe.robot.guesses import guess_note
from skillframe.robot.model import RobotModel
from skillframe.skill import Status
from skillframe.teaching.blind import LEVER, BlindSettings, BlindTeacher
from skillframe.teaching.sessions import (
    MOST_ATTEMPTS,
    Recording,
    Watch,
    beginning,
    demonstration_from,
    progress_callback,
)
from skillframe.world.scene import Scene
from skillframe.world.sensors import SensorSettings

HANDLE = "grip"  # a part is held near its tip for a search, like a pen


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
    """Search a scene blindly `count` times, from a start of its own each time.

    Args:
        robot: who is taught.
        scene: where; its task's `direction` is the way the person pushes, and nothing else of the task is used.
        settings: the person.
        count: demonstrations wanted.
        seed: everything random follows from it.
        draws: quantities that hold for every demonstration (`start.*` is added to the drawn start).
        rate_hz: sample rate of the files.
        sensors: noise of the sensors.
        progress: told in words what happens.
        watch: told now and then how many seconds are simulated, and of how many at most.

    Raises:
        InputError: the world has no direction to push in.
        SkillframeError: a slot still fails after 20 attempts; says with what.
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
        sensors=sensors or SensorSettings(), filter_wrench=False, make_drive=drive_maker(robot),
    )  # fmt: skip
    rngs = [np.random.default_rng([seed, slot, attempt]) for slot in slots]
    teacher = BlindTeacher(np.array(scene.task.direction), settings)
    longest = settings.time_s + 1.0
    told = progress_callback(watch, longest)
    return simulate(teacher, setup, columns, rngs, duration_s=longest, trace_hz=rate_hz, progress=told), handle


def _start(settings: BlindSettings, rng: np.random.Generator) -> dict[str, float]:
    """A start from which the goal lies where the person believes it may: minus a draw of the belief."""
    x, y, turn = (float(value) for value in -settings.draw(rng))
    return {"start.offset_x": x, "start.offset_y": y, "start.tilt_z": turn / LEVER}
