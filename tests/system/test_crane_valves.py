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


OTHER_OIL = {
    "actuator.deadband": np.array([0.01, 0.02, 0.01, 0.02]), "actuator.bulk_scale": np.array([0.75, 0.85, 1.15, 1.3]),
    "actuator.supply_pressure": np.array([150e5, 165e5, 180e5, 205e5]),
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


def test_oil_softer_or_stiffer_than_believed_shifts_what_is_found_by_what_is_stated_for_it():
    """In all, 3 deviations; by scatter alone the supply of the lift would be out by more than that."""
    world, rngs = load_world("pallets", {}), [np.random.default_rng([18, i]) for i in range(4)]
    setup = Setup(robot=load_robot_model("hiab_xs031"), scene=world)
    loop = begin(Follow(standing, MOVING), setup, OTHER_OIL, rngs, None)
    loop.prepare()
    found = loop.drive.valves
    off = np.abs(found.supply - OTHER_OIL["actuator.supply_pressure"][:, None])
    aside = np.abs(found.overlap - OTHER_OIL["actuator.deadband"][:, None])
    assert np.all(off < 3.0 * np.hypot(found.supply_deviation, found.supply_oil))
    assert np.all(aside < 3.0 * np.hypot(found.overlap_deviation, found.overlap_oil))
    assert np.any(off > 3.0 * found.supply_deviation)
