"""The crane finds out about its valves in the air, and its law goes by it."""

import numpy as np
import pytest
from skillframe_papers.rows.crane_runs import MOVING, Follow

from skillframe.execution.executor import Setup, begin
from skillframe.execution.prepare import load_robot_model, load_world

pytestmark = pytest.mark.slow
WORN = {
    "actuator.deadband": np.array([0.0, 0.02, 0.01]), "actuator.supply_pressure": np.array([190e5, 155e5, 205e5]),
    "actuator.delay": np.array([0.0, 0.02, 0.005]), "actuator.friction_scale": np.array([1.0, 0.8, 1.2]),
}  # fmt: skip


def standing(time):
    return np.zeros(3), np.zeros(3)


def test_overlap_supply_and_delay_of_every_valve_are_found_in_the_swing_before_a_run():
    """To 5 deviations and, of lift and tilt, a tenth of the largest overlap; the law goes by what was found."""
    world = load_world("pallets", {})
    rngs = [np.random.default_rng([17, i]) for i in range(3)]
    loop = begin(Follow(standing, MOVING), Setup(robot=load_robot_model("hiab_xs031"), scene=world), WORN, rngs, None)
    loop.prepare()
    found, true = loop.drive.valves, WORN["actuator.deadband"][:, None]
    error = np.abs(found.overlap - true)
    assert np.all(error < 5.0 * found.overlap_deviation)
    assert error[:, :2].max() < 2e-3
    supply = WORN["actuator.supply_pressure"][:, None]
    np.testing.assert_allclose(found.supply, np.tile(supply, 3), atol=3e5)
    np.testing.assert_allclose(found.lag[:, :2].mean(axis=1), 0.01 + WORN["actuator.delay"], atol=0.005)
    np.testing.assert_array_equal(loop.drive.law.deadband, found.compensated)
    np.testing.assert_array_equal(loop.drive.law.supply, found.supply)
