import numpy as np
import pytest

from skillframe.frames import move_wrench, rotate, rotation_vector
from skillframe.world.quantities import SensorSettings
from skillframe.world.sensors import BLOCK, Sensors, at_point

SILENT = SensorSettings(
    force_noise=0.0, torque_noise=0.0, force_bias=0.0, torque_bias=0.0, position_noise=0.0, rotation_noise=0.0
)


def generators(count, seed=0):
    return [np.random.default_rng([seed, i]) for i in range(count)]


def hold(plant):
    plant.step(plant.kinematics(np.zeros(3)).bias.copy(), np.arange(plant.count))


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_in_the_air_the_wrench_without_weight_is_zero_at_any_attitude(plant, tilt):
    now = plant("panda", "free", {"start.tilt_x": tilt, "start.tilt_y": -tilt})
    hold(now)
    _, wrench = Sensors(SILENT, now, generators(1), {}).sample(now.tool_pose())
    np.testing.assert_allclose(wrench, 0.0, atol=1e-9)


def test_taring_removes_the_bias_whatever_it_is(plant):
    now = plant("free_tool", "free", {"start.tilt_x": 0.4}, count=2)
    biased = {"sensor.force_bias_x": np.array([5.0, -3.0]), "sensor.torque_bias_z": np.array([0.4, 0.1])}
    sensors = Sensors(SILENT, now, generators(2), biased)
    hold(now)
    pose, before = sensors.sample(now.tool_pose())
    expected = np.zeros((2, 6))
    expected[:, 0], expected[:, 5] = biased["sensor.force_bias_x"], biased["sensor.torque_bias_z"]
    in_sensor = rotate(np.swapaxes(pose.rotation, 1, 2)[:, None], before.reshape(2, 2, 3)).reshape(2, 6)
    np.testing.assert_allclose(in_sensor, expected, atol=1e-9)  # biases live in the sensor's axes
    sensors.set_tare(before, pose.rotation)
    np.testing.assert_allclose(sensors.sample(now.tool_pose())[1], 0.0, atol=1e-9)


def test_noise_has_the_stated_size_and_no_mean(plant):
    """4000 samples: the standard deviation is known to 1.1 %, the mean to 1.6 % of it. Five times that is allowed."""
    now = plant("free_tool", "free", count=8)
    hold(now)
    settings = SensorSettings(force_bias=0.0, torque_bias=0.0)
    sensors, truth = Sensors(settings, now, generators(8), {}), now.tool_pose()
    wrenches, positions, turns = [], [], []
    for _ in range(500):
        pose, wrench = sensors.sample(truth)
        wrenches.append(wrench)
        positions.append(pose.position - truth.position)
        turns.append(rotation_vector(pose.rotation @ np.swapaxes(truth.rotation, 1, 2)))
    figures = {
        settings.force_noise: np.array(wrenches)[..., :3],
        settings.position_noise: np.array(positions),
        settings.rotation_noise: np.array(turns),
    }
    for size, samples in figures.items():
        assert samples.std() == pytest.approx(size, rel=0.055)
        assert abs(samples.mean()) < 5 * size / np.sqrt(samples.size)


def test_a_trial_s_noise_depends_on_its_own_generator_only(plant):
    alone, both = plant("free_tool", "free"), plant("free_tool", "free", count=2)
    hold(alone)
    hold(both)
    settings = SensorSettings()
    first = Sensors(settings, alone, generators(2)[1:], {})
    second = Sensors(settings, both, generators(2), {})
    for _ in range(BLOCK + 3):  # beyond one block of draws
        single, pair = first.sample(alone.tool_pose()), second.sample(both.tool_pose())
        np.testing.assert_array_equal(single[1][0], pair[1][1])
        np.testing.assert_array_equal(single[0].rotation[0], pair[0].rotation[1])


def test_noise_can_be_drawn_per_trial(plant):
    now = plant("free_tool", "free", count=2)
    hold(now)
    drawn = {"sensor.force_noise": np.array([0.0, 1.0])}
    settings = SensorSettings(force_bias=0.0, torque_bias=0.0, rotation_noise=0.0)
    sensors = Sensors(settings, now, generators(2), drawn)
    samples = np.array([sensors.sample(now.tool_pose())[1] for _ in range(400)])[..., :3]
    np.testing.assert_allclose(samples[:, 0], 0.0, atol=1e-9)
    assert samples[:, 1].std() == pytest.approx(1.0, rel=0.1)  # 1200 samples: 2 %


def test_a_wrench_is_taken_at_another_point_by_the_lever():
    rng = np.random.default_rng(0)
    wrench, offset = rng.normal(size=(2, 6)), np.array([0.0, 0.0, 0.2])
    turn = np.broadcast_to(np.eye(3), (2, 3, 3))
    np.testing.assert_allclose(at_point(wrench, turn, offset), move_wrench(wrench, offset))
