"""The two-arm insertion over tilts, joint friction, configurations and postures: the table of the two-arm paper.

'+' turns the peg about the fixture's y axis (level, across the insertion): its tip end moves up. Postures: "upright",
both arms on the floor; "mirrored", the arm that holds the hole mirrored at the level plane through the insertion axis,
so that it hangs. (Mirroring both arms is reversing the sign of the tilt, gravity being compensated.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pinocchio as pin
from skillframe_dualarm.document import Phase
from skillframe_dualarm.runtime import DualArm

from skillframe.errors import UnknownName
from skillframe.execution.arms import ArmsResult, simulate_arms
from skillframe.execution.executor import Setup
from skillframe.frames import rotate
from skillframe.robot.model import RobotModel
from skillframe.world.placement import nominal_fixture
from skillframe.world.scene import Scene
from skillframe_papers.rows.outcome import classify

POSTURES = ("upright", "mirrored")
PUBLISHED = {
    "A": {"largest_deg": 4.0}, "B": {"largest_deg": 12.0, "time_s": 26.5, "joint_path_rad": 1.45},
    "C": {"largest_deg": 0.0}, "D": {"largest_deg": 8.0, "time_s": 13.0, "joint_path_rad": 0.99},
    "E": {"largest_deg": 12.0, "time_s": 5.0, "joint_path_rad": 0.59},
}  # fmt: skip
"""Table I and the figures at 8 degrees, both arms together; C failed at 4 degrees, the smallest tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One insertion.

    Attributes:
        tilt_deg: at the start; joint_friction: of joints 1-4 [Nm]; outcome: of `CLASSES`.
        force_n: largest contact force; joint_path_rad: way of all joints, by arm; turned_deg: about the tilt axis.
    """

    tilt_deg: float
    joint_friction: float
    outcome: str
    time_s: float
    force_n: float
    joint_path_rad: tuple[float, float]
    turned_deg: tuple[float, float]
    reason: str


def posed(robot: RobotModel, scene: Scene, posture: str) -> tuple[RobotModel, Scene]:
    """Robot and scene in a posture of `POSTURES`.

    Raises:
        UnknownName: no such posture.
    """
    if posture not in POSTURES:
        raise UnknownName("posture", posture, POSTURES)
    if posture == "upright" or scene.holder is None:
        return robot, scene
    model = robot.model.copy()
    first = model.supports[model.frames[robot.tool_frames[1]].parentJoint][1]
    height = robot.spec.workspace.fixture[2]
    half_turn = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 2.0 * height]))
    model.jointPlacements[first] = half_turn * model.jointPlacements[first]
    turned_grip = replace(scene.holder, quaternion=(0.0, 0.0, 1.0, 0.0))  # the hole is round: its grip may be, too
    return replace(robot, model=model), replace(scene, holder=turned_grip)


def insert(
    robot: RobotModel, scene: Scene, phase: Phase, tilts_deg: Sequence[float], frictions: Sequence[float],
    *, posture: str = "upright", seed: int = 0, duration_s: float = 30.0, to_the_bottom: bool = False,
) -> list[Row]:  # fmt: skip
    """Insertions of every friction and tilt in one batch, frictions first.

    Each ends where the goal is reached, 10 mm above the bottom, or, with `to_the_bottom`, where the skill ends.
    """
    robot, scene = posed(robot, scene, posture)
    friction, tilt = np.array(list(product(frictions, tilts_deg)), dtype=float).T
    points = np.array([arm.center_of_compliance for arm in phase.arms])
    setup = Setup(
        robot=robot, scene=scene, center_of_compliance=points, stop_when=None if to_the_bottom else scene.goal
    )
    draws = {"start.tilt_y": np.radians(tilt), "robot.joint_friction": friction}
    rngs = [np.random.default_rng([seed, i]) for i in range(len(tilt))]
    result = simulate_arms(DualArm(phase), setup, draws, rngs, duration_s=duration_s)
    return rows_of(result, robot, tilt, friction)


def rows_of(result: ArmsResult, robot: RobotModel, tilt_deg: np.ndarray, friction: np.ndarray) -> list[Row]:
    """The result as rows. Tilts are about the fixture's y axis."""
    axis = rotate(nominal_fixture(robot).rotation, np.array([0.0, 1.0, 0.0]))
    outcome = classify(result, np.radians(tilt_deg), axis)
    path, turned = result.joint_path_rad.sum(-1), np.degrees(result.turned_rad @ axis)
    return [
        Row(
            tilt_deg=float(tilt_deg[i]), joint_friction=float(friction[i]), outcome=outcome[i],
            time_s=float(result.duration_s[i]), force_n=float(result.peak_force_n[i]),
            joint_path_rad=(float(path[i, 0]), float(path[i, 1])),
            turned_deg=(float(turned[i, 0]), float(turned[i, 1])), reason=str(result.reason[i]),
        )
        for i in range(len(tilt_deg))
    ]  # fmt: skip


def largest(rows: Sequence[Row], sign: int, friction: float) -> float:
    """Largest tilt [deg] of a sign up to which every insertion succeeds, or 0 if the smallest one fails."""
    reached = 0.0
    for row in sorted(rows, key=lambda r: abs(r.tilt_deg)):
        if row.joint_friction == friction and row.tilt_deg * sign > 0.0:
            if row.outcome != "success":
                break
            reached = abs(row.tilt_deg)
    return reached
