"""Jacobian, wrist sensor and quaternions in C are those of numpy beside them, to the last bit."""

import numpy as np
import pytest

from skillframe.frames import quaternion_from_matrix, rotation_matrix
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from skillframe.world.quantities import SensorSettings
from skillframe.world.reading import Quaternions
from skillframe.world.sensors import BLOCK, Sensors
from tests import fmu_cache
from tests.laws.crane_plants import crane, empty_scene
from tests.laws.runs import generators, robot, scene

COUNT = 3
compiler = fmu_cache.compiler


@pytest.fixture(autouse=True)
def _with_a_compiler(compiler):
    pass


def plant(name, native, monkeypatch):
    """Three robots somewhere else each, as they fall."""
    model, task = (crane().robot, empty_scene()) if name == "crane" else (robot(name), scene("peg_in_hole"))
    if not native:
        monkeypatch.setattr("skillframe.world.reading.library", lambda source: None)
    now = Plant(model, task, COUNT, fixture_poses(model, {}, COUNT), {"robot.mass_scale": np.linspace(0.9, 1.1, COUNT)})
    now.reset(np.tile(model.home, (COUNT, 1)))
    position, velocity = now.state
    rng = np.random.default_rng(5)
    position[:, -4:] += 0.05 * rng.normal(size=(COUNT, 4))
    velocity[:] = rng.normal(size=velocity.shape)
    now.batch.forward()
    assert (now._compiled is None) != native
    return now


@pytest.mark.parametrize("name", ["panda", "crane", "free_tool"])
def test_jacobians_follow_the_moving_joints_and_are_the_callers_own(name, monkeypatch):
    quick, plain = (plant(name, native, monkeypatch) for native in (True, False))
    kept = []
    for offset in (np.array([0.1, -0.2, 0.3]), np.linspace(-1.0, 1.0, 9).reshape(COUNT, 3)):
        for now in (quick, plain):
            now.step(np.zeros((COUNT, now.model.nv)), np.arange(COUNT))
        one, other = quick.kinematics(offset), plain.kinematics(offset)
        np.testing.assert_array_equal(one.jacobian, other.jacobian)
        kept.append((one.jacobian, other.jacobian))
    for one, other in kept:
        np.testing.assert_array_equal(one, other)


def test_readings_of_the_wrist_agree_before_and_after_a_tare_and_over_blocks_of_noise(monkeypatch):
    now, seen = plant("panda", True, monkeypatch), []
    for native in (True, False):
        if not native:
            monkeypatch.setattr("skillframe.world.reading.library", lambda source: None)
        sensors = Sensors(SensorSettings(), now, generators(COUNT), {})
        assert (sensors._compiled is None) != native
        rows = []
        for _ in range(BLOCK + 20):
            pose, wrench = sensors.sample(now.tool_pose())
            rows.append(wrench)
        sensors.set_tare(np.mean(rows, axis=0), pose.rotation)
        rows += [sensors.sample(now.tool_pose())[1] for _ in range(20)]
        seen.append(np.array(rows))
    np.testing.assert_array_equal(*seen)
    # the mean of 20 samples of 0.3 N is 0 within 0.07 N; without the tare there are biases of 1 N and the arm's fall
    assert np.abs(seen[0][-20:].mean(axis=0)).max() < 0.5 < np.abs(seen[0][:BLOCK].mean(axis=0)).max()


@pytest.mark.parametrize("lost", [False, True])
def test_quaternions_agree_near_every_half_circle_and_where_a_trial_is_lost(lost, compiler):
    axes = np.concatenate([np.eye(3), -np.eye(3), np.ones((1, 3)) / np.sqrt(3.0), np.zeros((1, 3))])
    near = 1e-3 * np.random.default_rng(6).normal(size=(len(axes), 3))
    first, second = (rotation_matrix(angle * axes + near) for angle in (np.pi, 2.0))
    if lost:
        first[3, 1, 2] = second[2, 0, 0] = np.nan
    now = Quaternions(len(axes))
    assert now._rows is not None
    np.testing.assert_array_equal(now.of(first, second), quaternion_from_matrix(np.stack([first, second])))
