"""Joint encoders: whole counts, filtered differences, exact where nothing is declared, each row for itself."""

import mujoco
import numpy as np
import pytest

from skillframe.robot.tables import Encoders
from skillframe.world.sensors import JointEncoders

DT = 1e-3
SCENE = """<mujoco><worldbody>
  <body><joint name="turn" type="hinge"/><geom size="0.1"/>
    <body><joint name="slide" type="slide"/><geom size="0.1"/></body></body>
  <body><freejoint name="base"/><geom size="0.1"/></body>
  <body><joint name="sprung_latch" type="slide"/><geom size="0.1"/></body>
</worldbody></mujoco>"""
ENGINE = mujoco.MjModel.from_xml_string(SCENE)
TURN, SLIDE = 0, 1


def encoders(position=None, count=1, **settings):
    start = np.zeros((count, ENGINE.nq)) if position is None else position
    return JointEncoders(Encoders(**settings), ENGINE, start, DT)


def test_positions_are_the_nearest_whole_counts():
    read = encoders(bits=10, step_m=1e-3)
    position = np.random.default_rng(1).uniform(-3.0, 3.0, (1, ENGINE.nq))
    read.sample(position, np.zeros((1, ENGINE.nv)))
    for joint, count in ((TURN, 2.0 * np.pi / 1024), (SLIDE, 1e-3)):
        counts = read.position[0, joint] / count
        # to rounding of the division
        assert counts == pytest.approx(round(counts), abs=1e-9)
        assert abs(read.position[0, joint] - position[0, joint]) <= 0.5 * count * (1.0 + 1e-9)


def test_a_free_base_and_the_fixtures_own_parts_are_read_exactly():
    read = encoders(bits=10, step_m=1e-3)
    rng = np.random.default_rng(2)
    position, velocity = rng.uniform(-3.0, 3.0, (1, ENGINE.nq)), rng.uniform(-3.0, 3.0, (1, ENGINE.nv))
    read.sample(position, velocity)
    np.testing.assert_array_equal(read.position[0, 2:], position[0, 2:])
    np.testing.assert_array_equal(read.velocity[0, 2:], velocity[0, 2:])


def test_joints_without_a_resolution_are_read_exactly():
    read = encoders(bits=10)
    read.sample(np.full((1, ENGINE.nq), 0.12345), np.full((1, ENGINE.nv), 0.6789))
    assert (read.position[0, SLIDE], read.velocity[0, SLIDE]) == (0.12345, 0.6789)
    assert read.position[0, TURN] != 0.12345


@pytest.mark.parametrize("corner", [30.0, 100.0])
def test_the_velocity_of_a_steady_motion_rises_as_a_first_order_filter_does(corner):
    """v (1 - exp(-2 pi f t)) in closed form; 32 bits leave 1.5e-9 rad a count, over a tick 1.5e-6 rad/s."""
    read, speed = encoders(bits=32, corner_hz=corner), 0.7
    for tick in range(1, 40):
        read.sample(np.full((1, ENGINE.nq), speed * tick * DT), np.zeros((1, ENGINE.nv)))
        expected = speed * (1.0 - np.exp(-2.0 * np.pi * corner * tick * DT))
        assert read.velocity[0, TURN] == pytest.approx(expected, abs=3e-6)


def test_at_rest_the_velocity_is_zero_whatever_the_place():
    position = np.full((1, ENGINE.nq), 0.4321)
    read = encoders(position, bits=8, step_m=1e-3)
    read.sample(position, np.zeros((1, ENGINE.nv)))
    assert not read.velocity[0, :2].any()


def test_what_was_measured_is_not_changed_by_what_comes_later_to_the_truth():
    """The truth is a live view of the plant's state."""
    truth = np.full((1, ENGINE.nq), 0.5)
    read = encoders(truth, bits=12, step_m=1e-3)
    before = read.position.copy()
    truth += 1.0
    np.testing.assert_array_equal(read.position, before)


def test_rows_are_read_as_they_are_alone_to_the_last_bit():
    rng = np.random.default_rng(3)
    path = np.cumsum(rng.normal(0.0, 1e-3, (50, 3, ENGINE.nq)), axis=0)
    still = np.zeros((3, ENGINE.nv))
    together, alone = encoders(path[0], 3, bits=14, step_m=1e-5), encoders(path[0, 1:2], bits=14, step_m=1e-5)
    for now in path[1:]:
        together.sample(now, still)
        alone.sample(now[1:2], still[1:2])
        assert together.position[1].tobytes() == alone.position[0].tobytes()
        assert together.velocity[1].tobytes() == alone.velocity[0].tobytes()
