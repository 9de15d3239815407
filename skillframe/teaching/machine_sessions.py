"""Record demonstrations of a hydraulic machine from a simulated operator at a scaled master.

The operator's desired motion goes through the machine's own loop, as any run does: first a swing in the air, in which
friction and payload are identified, then the operator teaches. A demonstration holds what the machine knows of itself,
the pose from its encoders and the force from its pressures; there is no force sensor and no truth in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import cos, sin

import numpy as np

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.convention import STANDARD
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.suspicions import UNMEASURED
from skillframe.errors import InputError
from skillframe.execution.executor import Result, Setup, simulate
from skillframe.execution.trace import Trace
from skillframe.frames import Float
from skillframe.machine.law.hydraulic import plane_axes
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import RobotModel
from skillframe.skill import Status
from skillframe.teaching.sessions import (
    Recording,
    Try,
    Watch,
    collect,
    demonstration_from,
    progress_callback,
    start_columns,
)  # fmt: skip
from skillframe.teaching.teleoperation import Operator, OperatorSettings, require_stable_loop
from skillframe.world.placement import fixture_poses
from skillframe.world.scene import Scene

__all__ = ["aimed", "demonstration_of_machine", "operate", "record_operated"]

LONGEST_S = 30.0


def record_operated(
    robot: RobotModel,
    scene: Scene,
    settings: OperatorSettings,
    *,
    count: int,
    seed: int,
    draws: Mapping[str, float] | None = None,
    rate_hz: float = 100.0,
    duration_s: float = LONGEST_S,
    progress: Callable[[str], None] | None = None,
    watch: Watch | None = None,
) -> Recording:
    """Demonstrate a scene `count` times. The arguments are those of `skillframe.teaching.sessions.record`.

    Raises:
        InputError: the force reflection would be unstable, or the scene's task has no direction.
        SkillframeError: a slot still fails after 20 attempts; says with what.
    """
    require_stable_loop(settings)
    _require_direction(scene)

    def attempt(tries: Sequence[Try]) -> Result:
        rngs = [np.random.default_rng([seed, slot, number]) for slot, number in tries]
        columns = start_columns(scene, [slot for slot, _ in tries], draws or {})
        return operate(robot, scene, settings, columns, rngs, rate_hz=rate_hz, duration_s=duration_s, watch=watch)

    def keep(trace: Trace, slot: int, number: int) -> Demonstration:
        return demonstration_of_machine(trace, scene, settings, seed=seed, slot=slot, attempt=number)

    return collect(robot, scene, count, attempt, keep, progress)


def operate(
    robot: RobotModel,
    scene: Scene,
    settings: OperatorSettings,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    rate_hz: float = 100.0,
    duration_s: float = LONGEST_S,
    watch: Watch | None = None,
) -> Result:
    """Operators teach len(rngs) machines in lock-step, each until the task is done. Returns traces too.

    A trial is a success where the task is done, wherever the scene's goal is: an operator who pushes hard may leave the
    tool deeper in a soft corner than a run is to end.

    Args:
        robot: a machine with `[[actuation]]`.
        scene: the task.
        settings: operator, master and channel.
        draws: quantities per trial, (N,) each.
        rngs: a generator per trial.
        rate_hz: of the traces.
        duration_s: longest demonstration, without the swing in the air.
        watch: told now and then how many seconds are simulated, and of how many at most.
    """
    _require_direction(scene)
    operator = Operator(scene.task, fixture_poses(robot, draws, len(rngs)), settings)
    setup = Setup(robot=robot, scene=scene, stop_when=scene.task.done or scene.goal)
    told = progress_callback(watch, duration_s)
    result = simulate(operator, setup, draws, rngs, duration_s=duration_s, trace_hz=rate_hz, progress=told)
    done = result.status == Status.SUCCESS
    return replace(result, success=done, failure=np.where(done, "", result.failure))


def _require_direction(scene: Scene) -> None:
    if scene.task.direction is None:
        raise InputError(f"world {scene.name}", "gives the operator nowhere to push", "choose another world")


def demonstration_of_machine(
    trace: Trace, scene: Scene, settings: OperatorSettings, **provenance: int
) -> Demonstration:
    """What the machine knew of itself: pose, estimated wrench, the estimate's sigma, and whether pistons slid."""
    plain = demonstration_from(trace, scene, settings, None, places=None, **provenance)
    meta = {key: value for key, value in plain.meta.items() if key != "sensor"}
    meta |= {
        "wrench": dict(STANDARD), "wrench_source": "estimated from chamber pressures, without a force sensor",
        UNMEASURED: [name for name, column in zip(WRENCH, plain.wrench.T, strict=True) if not column.any()],
    }  # fmt: skip
    sigma = trace.machine["force_sigma"]
    extra = {"sigma_1": sigma[:, 0], "sigma_2": sigma[:, 1], "force_valid": trace.machine["force_valid"]}
    return replace(plain, meta=meta, extra={name: column.copy() for name, column in extra.items()})


def aimed(robot: RobotModel, scene: Scene, angle: float) -> Scene:
    """The same scene with an operator who pushes at an angle in the machine's plane.

    Args:
        robot: a machine with `[[actuation]]`.
        scene: its task's direction is replaced.
        angle: from the first axis of the plane to the second [rad]; at -pi/2 a crane pushes straight down.
    """
    first, second = plane_axes(ClosedChain(robot))
    direction = np.zeros(3)
    direction[[first, second]] = cos(angle), sin(angle)
    x, y, z = (float(v) for v in direction)
    return replace(scene, task=replace(scene.task, direction=(x, y, z)))
