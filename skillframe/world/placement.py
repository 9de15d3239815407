"""Where a trial starts: the fixture's true pose, and the robot's configuration for a start relative to the nominal one.

The robot is told where the fixture is *nominally*. `fixture.*` moves the true fixture, so it is an error the skill does
not know of; `start.*` moves the start of the tip, in the nominal fixture's axes (tilts turn about the tip).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skillframe.config.ranges import require_within
from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose, matrix_from_quaternion
from skillframe.robot.kinematics import inverse_kinematics
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import RobotSpec
from skillframe.world.convert import held
from skillframe.world.faults import fault_problem
from skillframe.world.plant import displacement
from skillframe.world.quantities import FAULTS, QUANTITIES, RANGES, UNITS
from skillframe.world.scene import Scene

_FAULTS = frozenset({"fault.time", "fault.cylinder", *(each.name for each in FAULTS)})
_OF_SERVOS = ("actuator.friction_scale", "actuator.delay")
_ACTUATOR = tuple(name for name in QUANTITIES if name.startswith("actuator."))


def check_quantities(draws: Mapping[str, Float], robot: RobotModel | None = None) -> None:
    """Refuse a quantity that nothing reads, and values that cannot be.

    Args:
        draws: values (N,) by quantity.
        robot: who runs; refuses quantities of actuators or sensors that it does not have.

    Raises:
        UnknownName: with the nearest name.
        InputError: a value beyond the quantity's range, or a quantity that the robot lacks.
    """
    for key, values in draws.items():
        if key not in QUANTITIES:
            raise UnknownName("quantity", key, QUANTITIES)
        if robot is not None and (lacking := lacks(key, robot.spec)):
            raise InputError(key, f"{robot.spec.name} {lacking}", "leave it out")
        for value in (float(np.min(values)), float(np.max(values))):
            require_within(value, value, UNITS[key], RANGES[key], key)
        if key in _FAULTS and (problem := fault_problem(key, np.asarray(values, dtype=float), robot)):
            raise InputError(key, *problem)


def lacks(key: str, spec: RobotSpec) -> str:
    """Why a quantity would do nothing on this robot, or "" if it does something."""
    if key in _FAULTS and not spec.hydraulic:
        return "is no hydraulic machine, whose faults alone are simulated"
    if not spec.actuation:
        return "has no actuators of its own" if key in (*_ACTUATOR, "robot.nominal_payload") else ""
    if spec.servo:
        lacking = key == "robot.nominal_payload" or (key in _ACTUATOR and key not in _OF_SERVOS)
        return "is driven by servos, which have no such quantity" if lacking else ""
    number = key.rpartition("_")[2]
    if key in _ACTUATOR and number.isdigit() and int(number) > len(spec.actuation):
        return f"has {len(spec.actuation)} cylinders"
    if key.startswith("sensor.") and key not in _FAULTS:
        return "has no wrench sensor: its contact force is estimated from pressures"
    return "moves in a plane, and does not turn its tool to a start" if key.startswith("start.tilt_") else ""


def nominal_fixture(robot: RobotModel) -> Pose:
    """Where the fixture stands for this robot: position (3,), upright unless robot.toml turns it."""
    place = robot.spec.workspace
    return Pose(np.array(place.fixture, dtype=float), matrix_from_quaternion(place.attitude))


def fixture_poses(robot: RobotModel, draws: Mapping[str, Float], count: int) -> Pose:
    """True pose of the fixture in base for each trial."""
    nominal = nominal_fixture(robot)
    moved = displacement(draws, "fixture", count)
    if moved is None:
        moved = Pose(np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3)))
    return nominal.compose(moved)


def places_in_base(robot: RobotModel, scene: Scene) -> dict[str, Pose]:
    """The scene's places for this robot, where the fixture is said to stand: (3,), (3, 3) in base each."""
    fixture = nominal_fixture(robot)
    return {
        name: fixture.compose(Pose(np.array(position), matrix_from_quaternion(quaternion)))
        for name, (position, quaternion) in scene.places.items()
    }


def start_poses(robot: RobotModel, scene: Scene, draws: Mapping[str, Float], count: int) -> Pose:
    """Pose of the tool frame at the start of each trial, in base."""
    zero = np.zeros(count)
    offset = np.stack([np.asarray(draws.get(f"start.offset_{a}", zero)) for a in "xyz"], axis=-1)
    tilt = np.stack([np.asarray(draws.get(f"start.tilt_{a}", zero)) for a in "xyz"], axis=-1)
    moved = displacement({f"start.tilt_{a}": tilt[:, i] for i, a in enumerate("xyz")}, "start", count)
    assert moved is not None
    tip = np.array(scene.start_tip) + offset
    tip[:, 2] += scene.start_lift(offset, tilt)
    attitude = moved.rotation @ matrix_from_quaternion(scene.start_quaternion)
    in_fixture = Pose(tip, attitude).at(-np.array(scene.tool.frames["tip"]))
    return nominal_fixture(robot).compose(in_fixture)


def start_configurations(robot: RobotModel, scene: Scene, draws: Mapping[str, Float], count: int) -> Float:
    """Configurations (N, nq) that put the tool frame at its start poses, and a fixture in hand at the fixture's.

    Raises:
        UnreachablePose: the robot cannot get there.
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
