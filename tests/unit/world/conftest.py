"""Robots and scenes that the tests of the world share. Loaded once."""

from functools import cache

import numpy as np
import pytest

from skillframe.extend.worlds import make_scene, world_types
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant


@cache
def robot_model(name):
    return load_model(load_robot(name))


@pytest.fixture
def robot():
    return robot_model


@pytest.fixture
def scene():
    records = {record.name: record for record in world_types()}
    return lambda name, **params: make_scene(records[name], params)


@pytest.fixture
def plant(robot, scene):
    """A plant of some trials at their starts, by names and draws."""

    def make(robot_name="free_tool", world="valley", draws=None, count=1, **params):
        draws = {key: np.broadcast_to(np.asarray(value, dtype=float), (count,)) for key, value in (draws or {}).items()}
        model, task = robot(robot_name), scene(world, **params)
        made = Plant(model, task, count, fixture_poses(model, draws, count), draws)
        made.reset(start_configurations(model, task, draws, count))
        return made

    return make
