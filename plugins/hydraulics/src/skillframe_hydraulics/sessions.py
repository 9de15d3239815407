"""Records demonstrations of a hydraulic machine by a simulated operator at a scaled master.

After the identifying swing the operator's motion goes through the machine's own control loop. A demonstration holds the
pose from encoders and the force from pressures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import cos, sin

import numpy as np
from skillframe_teaching.sessions import (
    Try,
    Watch,
    collect,
    demonstration_from,
    progress_callback,
    start_columns,
)  # fmt: skip

from skillframe.demonstration import STANDARD, UNMEASURED, WRENCH, Demonstration
from skillframe.errors import InputError
from skillframe.execution import Result, Setup, Trace, simulate
from skillframe.extend import Recording
from skillframe.frames import Float
from skillframe.robot import ClosedChain, RobotModel
from skillframe.skill import Status
from skillframe.world import Scene, fixture_poses
from skillframe_hydraulics.law.hydraulic import tool_axes
from skillframe_hydraulics.teleoperation import Operator, OperatorSettings, require_stable_loop

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
    """Demonstrate a scene `count` times. Arguments as `skillframe_teaching.sessions.record`.

    Raises:
        InputError: the force reflection would be unstable, or the scene's task has no direction.
        SkillframeError: a slot still fails after 20 attempts, with the reason.
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
    """Operators teach len(rngs) machines, each until the task is done. Returns traces too.

    A trial succeeds when the task is done, whatever the scene's goal: an operator may push deeper into a soft corner.
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
    """A demonstration with the machine's pose, estimated wrench, its sigma, and whether pistons slid."""
    plain = demonstration_from(trace, scene, settings, None, places=None, **provenance)
    meta = {key: value for key, value in plain.meta.items() if key != "sensor"}
    meta |= {
        "wrench": dict(STANDARD), "wrench_source": "estimated from chamber pressures, without a force sensor",
        UNMEASURED: [name for name, column in zip(WRENCH, plain.wrench.T, strict=True) if not column.any()],
    }  # fmt: skip
    sigma = trace.machine["force_sigma"]
    extra = {f"sigma_{i}": column for i, column in enumerate(sigma.T, 1)} | {
        "force_valid": trace.machine["force_valid"]
    }
    return replace(plain, meta=meta, extra={name: column.copy() for name, column in extra.items()})


def aimed(robot: RobotModel, scene: Scene, angle: float) -> Scene:
    """The scene with a push at an angle in the machine's plane [rad], from its first to its second axis.

    At -pi/2 a crane pushes straight down. A machine that moves in space pushes in the upright plane through its base
    and the fixture, from outwards to up.
    """
    axes = tool_axes(ClosedChain(robot))
    if len(axes) == 3:
        out = np.array([*robot.spec.workspace.fixture[:2], 0.0])
        axes = np.array([out / max(float(np.linalg.norm(out)), 1e-9), [0.0, 0.0, 1.0]])
    direction = np.array([cos(angle), sin(angle)]) @ axes
    x, y, z = (float(v) for v in direction)
    return replace(scene, task=replace(scene.task, direction=(x, y, z)))
