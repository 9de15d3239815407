"""The plants of a batch: the truth, and the nominal one that a controller knows."""

from __future__ import annotations

from skillframe.execution.setup import Setup
from skillframe.world.encoders import JointEncoders
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Draws, Plant


def varied_plants(setup: Setup, draws: Draws, count: int) -> tuple[Plant, Plant]:
    """The plant at its starts, and the controller's nominal one: the same object where nothing of the robot differs.

    Raises:
        UnreachablePose: the robot cannot reach a start.
    """
    robot, scene, dt = setup.robot, setup.scene, 1.0 / setup.robot.spec.control.tick_hz
    fixture = fixture_poses(robot, draws, count)
    plant = Plant(robot, scene, count, fixture, draws, timestep=dt)
    differs = any(key.startswith("grasp.") or key in ("robot.mass_scale", "robot.payload") for key in draws)
    differs = differs or robot.spec.encoders is not None  # what it knows of the state is not the plant's
    differs = differs or robot.spec.mount is not None
    nominal = Plant(robot, scene, count, fixture, {}, timestep=dt, rigid=True) if differs else plant
    plant.reset(start_configurations(robot, scene, draws, count))
    return plant, nominal


def encoders_of(setup: Setup, plant: Plant) -> JointEncoders | None:
    """The encoders of a plant at rest at its starts, or None where the state is known exactly."""
    declared, dt = setup.robot.spec.encoders, 1.0 / setup.robot.spec.control.tick_hz
    return None if declared is None else JointEncoders(declared, plant.model, plant.state[0], dt)
