"""Robots and scenes that the tests of the world share. Loaded once."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.extend import make_scene
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant

INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'


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


@pytest.fixture
def slide(tmp_path, scene):
    """A plant whose robot is a link on a slide along x, with its flange 1 m above, at positions q (N,)."""

    def make(shapes, q, *fixture, toml="", more="", sprung=()):
        text = f"""<robot name="slide"><link name="base"/><link name="carriage">{INERTIAL}{shapes}</link>
        <link name="flange"/>{more}<joint name="x" type="prismatic"><parent link="base"/><child link="carriage"/>
        <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="100" velocity="1"/></joint><joint name="up" type="fixed">
        <parent link="carriage"/><child link="flange"/><origin xyz="0 0 1"/></joint></robot>"""
        (tmp_path / "slide.urdf").write_text(text)
        arm = '[[arm]]\nname = "arm"\ntool_frame = "flange"\n'
        (tmp_path / "robot.toml").write_text(f'urdf = "slide.urdf"\n{arm}{toml}')
        model = load_model(load_robot(tmp_path / "robot.toml"))
        now = dataclasses.replace(scene("free"), fixture=fixture, sprung=sprung)
        plant = Plant(model, now, len(q), fixture_poses(model, {}, len(q)), {})
        plant.reset(np.array(q, dtype=float)[:, None])
        return plant

    return make
