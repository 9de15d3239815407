"""The two-arm insertion over tilts, joint friction, configurations and postures: the table of the two-arm paper.

'+' turns the peg about the fixture's y axis (level, across the insertion): its tip end moves up. Postures: "upright",
both arms on the floor; "mirrored", the arm that holds the hole mirrored at the level plane through the insertion axis,
so that it hangs. (Mirroring both arms is reversing the sign of the tilt, gravity being compensated.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from skillframe_dualarm.document import Phase
from skillframe_dualarm.dual_peg import REACH
from skillframe_dualarm.runtime import DualArm

from skillframe.errors import UnknownName
from skillframe.execution.arms import ArmsResult, simulate_arms
from skillframe.execution.executor import Setup
from skillframe.frames import Float, rotate
from skillframe.robot.model import RobotModel
from skillframe.world.placement import nominal_fixture
from skillframe.world.scene import Scene
from skillframe_papers.rows.blocks import Blocks
from skillframe_papers.rows.outcome import classify

POSTURES = ("upright", "mirrored")
Arms = tuple[float, float]
PUBLISHED = {
    "A": {"largest_deg": 4.0}, "B": {"largest_deg": 12.0, "time_s": 26.5}, "C": {"largest_deg": 0.0},
    "D": {"largest_deg": 8.0, "time_s": 13.0}, "E": {"largest_deg": 12.0, "time_s": 5.0},
}  # fmt: skip
"""Table I and times from 8 degrees. C failed at 4 degrees, the smallest tried."""
MOTION: dict[str, tuple[Arms, Arms, Arms]] = {
    "B": ((1.45, 0.0), (1.18, 0.0), (1.1, 0.0)),
    "D": ((0.64, 0.35), (0.53, 0.23), (0.47, 0.19)),
    "E": ((0.41, 0.18), (0.36, 0.15), (0.32, 0.13)),
}
"""Table II from 8 degrees, by arm [rad]: way of all joints, the same weighted by link length, largest of a joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One insertion.

    Attributes:
        tilt_deg: at the start; joint_friction: of joints 1-4 [Nm]; outcome: of `CLASSES`.
        force_n: largest contact force; turned_deg: about the tilt axis, by arm.
        joint_path_rad: way of all joints, by arm; weighted_rad: the same, see `link_weights`.
        largest_joint_rad: way of the joint that moved most, by arm.
    """

    tilt_deg: float
    joint_friction: float
    outcome: str
    time_s: float
    force_n: float
    joint_path_rad: Arms
    weighted_rad: Arms
    largest_joint_rad: Arms
    turned_deg: Arms
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


def raised(robot: RobotModel, height_m: float) -> RobotModel:
    """The robot with its fixture at another height over the floor [m]."""
    x, y, _ = robot.spec.workspace.fixture
    return replace(robot, spec=replace(robot.spec, workspace=replace(robot.spec.workspace, fixture=(x, y, height_m))))


def sticking(robot: RobotModel, arm: int) -> RobotModel:
    """The robot with joint friction in one arm alone: 0, the master, or 1, the slave."""
    other = robot.spec.arm[1 - arm].name
    none = {name: 0.0 for name in robot.model.names if name.startswith(f"{other}_")}
    return replace(robot, spec=replace(robot.spec, friction_share={**robot.spec.friction_share, **none}))


def link_weights(robot: RobotModel) -> Float:
    """Weight (2, J) of each joint: length of the chain from it to the flange over that of the whole chain.

    The paper says "weighted by link length" and no more; this is our reading. Both arms are alike.
    """
    model, found = robot.model, []
    for frame in robot.tool_frames:
        flange = model.frames[frame]
        joints = list(model.supports[flange.parentJoint])[1:]
        steps = [model.jointPlacements[j].translation for j in joints[1:]] + [flange.placement.translation]
        beyond = np.cumsum([float(np.linalg.norm(step)) for step in steps][::-1])[::-1]
        found.append(beyond / beyond[0])
    return np.array(found)


def insert(
    robot: RobotModel, scene: Scene, phase: Phase, tilts_deg: Sequence[float], frictions: Sequence[float],
    *, posture: str = "upright", seed: int = 0, duration_s: float = 30.0, to_the_bottom: bool = False,
) -> list[Row]:  # fmt: skip
    """Insertions of every friction and tilt, frictions first. Arguments as `side_by_side`."""
    asked = [Asked(phase, tilts_deg, frictions)]
    return side_by_side(
        robot, scene, asked, posture=posture, seed=seed, duration_s=duration_s, to_the_bottom=to_the_bottom
    )[0]


def at_start(tilt_rad: Float) -> dict[str, Float]:
    """Quantities of a pair whose peg starts tilted, and its arm with it: what is commanded goes along the peg."""
    return {"start.tilt_y": tilt_rad}


def in_the_grasp(tilt_rad: Float) -> dict[str, Float]:
    """Of a pair whose peg sits askew in the master's grip, its tip in its place: the arm goes along the hole.

    The grip is turned about the wrist, so that it is moved by as much as the tip would go.
    """
    return {
        "grasp.tilt_y": tilt_rad, "grasp.offset_x": -REACH * np.sin(tilt_rad),
        "grasp.offset_z": REACH * (1.0 - np.cos(tilt_rad)),
    }  # fmt: skip


class Asked(NamedTuple):
    """Insertions of one phase: every friction [Nm] and tilt [degrees], frictions first."""

    phase: Phase
    tilts_deg: Sequence[float]
    frictions: Sequence[float]


def side_by_side(
    robot: RobotModel, scene: Scene, asked: Sequence[Asked], *, posture: str = "upright", seed: int = 0,
    duration_s: float = 30.0, to_the_bottom: bool = False, tilted: Callable[[Float], dict[str, Float]] = at_start,
) -> list[list[Row]]:  # fmt: skip
    """Insertions, those about the same points in one simulation: each is, to the last bit, what it is alone.

    Each ends where the goal is reached, 10 mm above the bottom, or, with `to_the_bottom`, where the skill ends.

    Args:
        robot: of two arms.
        scene: what they put together.
        asked: phases, and from where.
        posture: of `POSTURES`.
        seed: of the sensors' noise.
        duration_s: after which an insertion has failed.
        to_the_bottom: see above.
        tilted: quantities of tilts [rad]: how they come about.

    Returns:
        by what was asked, its rows.
    """
    robot, scene = posed(robot, scene, posture)
    alike: dict[bytes, list[int]] = {}
    for i, each in enumerate(asked):
        alike.setdefault(_points(each.phase).tobytes(), []).append(i)
    found = dict[int, list[Row]]()
    for which in alike.values():
        pairs = [np.array(list(product(asked[i].frictions, asked[i].tilts_deg)), dtype=float) for i in which]
        friction, tilt = np.concatenate(pairs).T
        setup = Setup(
            robot=robot, scene=scene, center_of_compliance=_points(asked[which[0]].phase),
            stop_when=None if to_the_bottom else scene.goal,
        )  # fmt: skip
        draws = {**tilted(np.radians(tilt)), "robot.joint_friction": friction}
        rngs = [np.random.default_rng([seed, i]) for pair in pairs for i in range(len(pair))]
        skill = Blocks([DualArm(asked[i].phase) for i in which], [len(pair) for pair in pairs])
        rows = iter(rows_of(simulate_arms(skill, setup, draws, rngs, duration_s=duration_s), robot, tilt, friction))
        found |= {i: list(islice(rows, len(pair))) for i, pair in zip(which, pairs, strict=True)}
    return [found[i] for i in range(len(asked))]


def _points(phase: Phase) -> Float:
    """Centres of compliance (2, 3), in each arm's tool frame [m]."""
    return np.array([arm.center_of_compliance for arm in phase.arms])


def rows_of(result: ArmsResult, robot: RobotModel, tilt_deg: np.ndarray, friction: np.ndarray) -> list[Row]:
    """The result as rows. Tilts are about the fixture's y axis."""
    axis = rotate(nominal_fixture(robot).rotation, np.array([0.0, 1.0, 0.0]))
    outcome = classify(result, np.radians(tilt_deg), axis)
    turned, ways = np.degrees(result.turned_rad @ axis), result.joint_path_rad
    path, weighted, most = ways.sum(-1), (ways * link_weights(robot)).sum(-1), ways.max(-1)
    return [
        Row(
            tilt_deg=float(tilt_deg[i]), joint_friction=float(friction[i]), outcome=outcome[i],
            time_s=float(result.duration_s[i]), force_n=float(result.peak_force_n[i]),
            joint_path_rad=_arms(path[i]), weighted_rad=_arms(weighted[i]), largest_joint_rad=_arms(most[i]),
            turned_deg=_arms(turned[i]), reason=str(result.reason[i]),
        )
        for i in range(len(tilt_deg))
    ]  # fmt: skip


def _arms(values: Float) -> Arms:
    return float(values[0]), float(values[1])


def largest(rows: Sequence[Row], sign: int, friction: float) -> float:
    """Largest tilt [deg] of a sign up to which every insertion succeeds, or 0 if the smallest one fails."""
    reached = 0.0
    for row in sorted(rows, key=lambda r: abs(r.tilt_deg)):
        if row.joint_friction == friction and row.tilt_deg * sign > 0.0:
            if row.outcome != "success":
                break
            reached = abs(row.tilt_deg)
    return reached
