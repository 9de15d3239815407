"""Bodies that cannot have come as far as they were measured to be apart: not looked at, and nothing is missed."""

import dataclasses

import numpy as np
import pytest

from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.collisions import Collisions
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom
from tests.laws.runs import setup
from tests.unit.world.conftest import INERTIAL
from tests.unit.world.test_collisions import BOX, SPHERE, ring_of_the_carriage, shape


def both_ways(plant, postures):
    """Touches over a path, by one that measured where it began and every fifth posture after, and by one that never
    did and so looks at everything; and at how many postures the first did look."""
    rows, told, asked, looks = np.arange(plant.count), Collisions(plant), [], []
    look = told._probe.overlaps
    told._probe.overlaps = lambda *posture: (looks.append(1), look(*posture))[1]
    for k, q in enumerate(postures):
        plant.reset(q)
        if k % 5 == 0:
            told.measure(plant, rows)
        asked.append((told.touches(plant, rows), Collisions(plant).touches(plant, rows)))
    return asked, len(looks)


def test_bodies_that_came_not_so_far_are_not_looked_at_and_nothing_that_touches_is_missed(robot, scene):
    """A Panda above the valley, its joints moved at random by small and by large steps."""
    now, rng, count = setup("panda", "valley"), np.random.default_rng(0), 8
    plant = Plant(now.robot, now.scene, count, fixture_poses(now.robot, {}, count), {})
    steps = rng.normal(size=(30, count, now.robot.model.nq)) * rng.choice([1e-3, 0.2], size=(30, 1, 1))
    asked, looks = both_ways(plant, now.robot.home + np.cumsum(steps, axis=0))
    assert all(told == fresh for told, fresh in asked)
    assert sum(len(fresh) for _, fresh in asked) > 10  # the walk does run into things
    assert looks < 0.9 * 30 * count


def test_a_body_that_only_turns_is_looked_at_before_its_end_touches(tmp_path, scene):
    """A ball 0.5 m from its joint's axis, its origin on the axis. The wall's face is 0.15 m from the ball; turned by
    0.4 rad the ball stands 0.5 sin 0.4 + 0.05 - 0.2 = 45 mm behind it; turned by 0.1 rad it is 0.1 m away."""
    inside = shape('<sphere radius="0.05"/>', xyz="0.5 0 0")
    (tmp_path / "arm.urdf").write_text(
        f"""<robot name="arm"><link name="base"/><link name="bar">{INERTIAL}{inside}</link><link name="flange"/>
        <joint name="z" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="9" velocity="9"/></joint><joint name="up" type="fixed">
        <parent link="bar"/><child link="flange"/><origin xyz="0 0 1"/></joint></robot>"""
    )
    (tmp_path / "robot.toml").write_text('urdf = "arm.urdf"\n[[arm]]\nname = "arm"\ntool_frame = "flange"\n')
    model = load_model(load_robot(tmp_path / "robot.toml"))
    wall = Geom(kind="box", size=(1.0, 0.1, 1.0), position=(0.5, 0.3, 0.0))  # half sizes: its face is at y = 0.2
    plant = Plant(model, dataclasses.replace(scene("free"), fixture=(wall,)), 1, fixture_poses(model, {}, 1), {})
    asked, looks = both_ways(plant, [np.array([[q]]) for q in (0.0, 0.01, 0.1, 0.4)])
    depth = 0.5 * np.sin(0.4) + 0.05 - 0.2
    assert [[touch.depth for touch in told] for told, _ in asked] == [[], [], [], [pytest.approx(depth, abs=1e-6)]]
    assert looks <= 2  # 2 (0.55 m) 0.01 is less than 0.15 m; at 0.1 rad it may look


def test_a_body_that_slides_is_looked_at_once_it_came_half_as_far_as_it_was_away(slide):
    """0.35 m lay between them; two bodies could have come that far, so 0.17 m are clear and 0.18 m are not."""
    asked, looks = both_ways(slide(SPHERE, [0.5], BOX), [np.array([[q]]) for q in (0.5, 0.33)])
    assert (looks, [told for told, _ in asked]) == (0, [[], []])
    asked, looks = both_ways(slide(SPHERE, [0.5], BOX), [np.array([[q]]) for q in (0.5, 0.32, 0.14)])
    assert (looks, [len(told) for told, _ in asked]) == (2, [0, 0, 1])


def test_a_shape_that_is_not_convex_is_looked_at_although_its_distance_is_not_known(slide, tmp_path):
    """A ball 1 m beside the ring is all that is measured, and it is far from the post."""
    shapes = ring_of_the_carriage(tmp_path) + shape('<sphere radius="0.01"/>', "collision", xyz="0 1 0")
    plant = slide(shapes, [0.0], Geom(kind="box", size=(0.04, 0.04, 0.2)))
    asked, _ = both_ways(plant, [np.array([[q]]) for q in (0.0, 0.08)])
    assert [[touch.cause for touch in told] for told, _ in asked] == [
        [],
        ["link 'carriage' is 20 mm inside the fixture"],
    ]
