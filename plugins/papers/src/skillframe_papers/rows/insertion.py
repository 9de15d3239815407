"""Two-arm insertions over tilts, joint friction, configurations and postures (two-arm paper).

'+' turns the peg about the fixture's level y axis, tip end up. "upright": both arms on the floor; "mirrored": the arm
with the hole mirrored at the level plane through the insertion axis, hanging. (Mirroring both arms reverses the tilt,
as gravity is compensated.)
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
from skillframe.execution import ArmsResult, Setup, simulate
from skillframe.frames import Float, rotate
from skillframe.robot import RobotModel
from skillframe.world import Scene, nominal_fixture
from skillframe_papers.rows.blocks import Blocks

POSTURES = ("upright", "mirrored")
CLASSES = ("success", "jam", "common rotation", "turned away")
Arms = tuple[float, float]
PUBLISHED = {
    "A": {"largest_deg": 4.0}, "B": {"largest_deg": 12.0, "time_s": 26.5}, "C": {"largest_deg": 0.0},
    "D": {"largest_deg": 8.0, "time_s": 13.0}, "E": {"largest_deg": 12.0, "time_s": 5.0},
}  # fmt: skip
"""Table I and times from 8 degrees; C failed at 4 degrees, the smallest tried."""
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
    turned_grip = replace(scene.holder, quaternion=(0.0, 0.0, 1.0, 0.0))  # the hole is round, so its grip may turn
    return replace(robot, model=model), replace(scene, holder=turned_grip)


def raised(robot: RobotModel, height_m: float) -> RobotModel:
    """The robot with its fixture at another height over the floor [m]."""
    x, y, _ = robot.spec.workspace.fixture
    return replace(robot, spec=replace(robot.spec, workspace=replace(robot.spec.workspace, fixture=(x, y, height_m))))


def sticking(robot: RobotModel, arm: int) -> RobotModel:
    """The robot with joint friction in one arm: 0 master, 1 slave."""
    other = robot.spec.arm[1 - arm].name
    none = {name: 0.0 for name in robot.model.names if name.startswith(f"{other}_")}
    return replace(robot, spec=replace(robot.spec, friction_share={**robot.spec.friction_share, **none}))


def link_weights(robot: RobotModel) -> Float:
    """Weight (2, J) of each joint: its distance to the flange over the whole chain's length.

    This is a reading of the paper's "weighted by link length".
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
    """Insertions of every friction and tilt, frictions first, with the arguments of `side_by_side`."""
    asked = [Asked(phase, tilts_deg, frictions)]
    return side_by_side(
        robot, scene, asked, posture=posture, seed=seed, duration_s=duration_s, to_the_bottom=to_the_bottom
    )[0]


def at_start(tilt_rad: Float) -> dict[str, Float]:
    """Quantities of a pair whose peg and arm start tilted, with commands along the peg."""
    return {"start.tilt_y": tilt_rad}


def in_the_grasp(tilt_rad: Float) -> dict[str, Float]:
    """Quantities of a pair whose peg is tilted in the grasp, its tip in place, the arm along the hole.

    The grasp turns about the wrist, hence the offsets.
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
    """Insertions side by side where points agree, bitwise equal to separate ones.

    Each ends at the goal, 10 mm above the bottom, or with its skill.

    Args:
        robot: of two arms.
        scene: parts to assemble.
        asked: phases with their tilts and frictions.
        posture: of `POSTURES`.
        seed: of the sensors' noise.
        duration_s: time limit.
        to_the_bottom: end with the skill.
        tilted: quantities of tilts [rad].

    Returns:
        rows by entry of `asked`.
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
        result = simulate(skill, setup, draws, rngs, duration_s=duration_s)
        assert isinstance(result, ArmsResult)
        rows = iter(rows_of(result, robot, tilt, friction))
        found |= {i: list(islice(rows, len(pair))) for i, pair in zip(which, pairs, strict=True)}
    return [found[i] for i in range(len(asked))]


def _points(phase: Phase) -> Float:
    """Centres of compliance (2, 3), in each arm's tool frame [m]."""
    return np.array([arm.center_of_compliance for arm in phase.arms])


def classify(result: ArmsResult, tilt_rad: Float, axis: Float) -> list[str]:
    """One of `CLASSES` per trial, by the turns theta_1, theta_2 of the tools about the tilt axis.

    The pair turned by (theta_1 + theta_2) / 2 and the arms relative to each other by theta_1 - theta_2. The paper's
    classes are (a) jamming, (b) success and (c) both arms rotating the wrong way, here split into together and apart.

    Args:
        result: of a two-arm run.
        tilt_rad: (N,) tilt of the tool at the start.
        axis: (3,) unit vector of the tilt in base.
    """
    turned = result.turned_rad @ axis  # (N, 2)
    common, relative = turned.mean(-1), turned[:, 0] - turned[:, 1]
    away = result.final_error_rad - np.abs(tilt_rad) > np.radians(3.0)
    together = (np.abs(common) > np.radians(5.0)) & (np.abs(common) > np.abs(relative))
    names = np.where(together, "common rotation", np.where(away, "turned away", "jam"))
    return [str(name) for name in np.where(result.success, "success", names)]


def rows_of(result: ArmsResult, robot: RobotModel, tilt_deg: np.ndarray, friction: np.ndarray) -> list[Row]:
    """The result as rows, tilts about the fixture's y axis."""
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
    """Largest tilt [deg] of a sign up to which all succeed, or 0."""
    reached = 0.0
    for row in sorted(rows, key=lambda r: abs(r.tilt_deg)):
        if row.joint_friction == friction and row.tilt_deg * sign > 0.0:
            if row.outcome != "success":
                break
            reached = abs(row.tilt_deg)
    return reached
