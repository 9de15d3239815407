"""Start of a trial: true fixture pose and the robot's configuration.

`fixture.*` moves the true fixture, unknown to the robot; `start.*` moves the tip's start (tilts turn about the tip).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skillframe.frames import Float, Pose, matrix_from_quaternion
from skillframe.robot.kinematics import inverse_kinematics
from skillframe.robot.model import RobotModel
from skillframe.world.convert import held
from skillframe.world.plant import displacement
from skillframe.world.scene import Scene


def nominal_fixture(robot: RobotModel) -> Pose:
    """Nominal fixture pose in base from robot.toml."""
    place = robot.spec.workspace
    return Pose(np.array(place.fixture, dtype=float), matrix_from_quaternion(place.orientation))


def fixture_poses(robot: RobotModel, draws: Mapping[str, Float], count: int) -> Pose:
    """True fixture pose in base of each trial."""
    nominal = nominal_fixture(robot)
    moved = displacement(draws, "fixture", count)
    if moved is None:
        moved = Pose(np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))
    return nominal.compose(moved)


def places_in_base(robot: RobotModel, scene: Scene) -> dict[str, Pose]:
    """Poses in base of the scene's places, for the nominal fixture."""
    fixture = nominal_fixture(robot)
    return {
        name: fixture.compose(Pose(np.array(position), matrix_from_quaternion(quaternion)))
        for name, (position, quaternion) in scene.places.items()
    }


def start_poses(robot: RobotModel, scene: Scene, draws: Mapping[str, Float], count: int) -> Pose:
    """Tool frame's start pose in base of each trial."""
    zero = np.zeros(count)
    offset = np.stack([np.asarray(draws.get(f"start.offset_{a}", zero)) for a in "xyz"], axis=-1)
    tilt = np.stack([np.asarray(draws.get(f"start.tilt_{a}", zero)) for a in "xyz"], axis=-1)
    moved = displacement({f"start.tilt_{a}": tilt[:, i] for i, a in enumerate("xyz")}, "start", count)
    assert moved is not None
    tip = np.array(scene.start_tip) + offset
    tip[:, 2] += scene.start_lift(offset, tilt)
    orientation = moved.rotation @ matrix_from_quaternion(scene.start_quaternion)
    in_fixture = Pose(tip, orientation).at(-np.array(scene.tool.frames["tip"]))
    return nominal_fixture(robot).compose(in_fixture)


def start_configurations(robot: RobotModel, scene: Scene, draws: Mapping[str, Float], count: int) -> Float:
    """Start configurations (N, nq) of the tool, and of a fixture held by a second arm.

    Raises:
        UnreachablePose: the robot cannot reach a pose.
    """
    poses = start_poses(robot, scene, draws, count)
    solutions = [
        inverse_kinematics(robot, 0, Pose(poses.position[i], poses.rotation[i]), robot.home) for i in range(count)
    ]
    if scene.holder is not None and held(robot, scene):
        grip = Pose(np.array(scene.holder.position), matrix_from_quaternion(scene.holder.quaternion)).inverse()
        hand = fixture_poses(robot, draws, count).compose(grip)
        solutions = [
            inverse_kinematics(robot, 1, Pose(hand.position[i], hand.rotation[i]), q) for i, q in enumerate(solutions)
        ]
    return np.stack(solutions)
