"""The crane finds out about its valves in the air, and in contact it presses evenly."""

import copy
import json

import numpy as np
import pytest

from skillframe.executor import Setup, simulate
from skillframe.machine import MachineLoop
from skillframe.prepare import load_robot_model, load_world, prepare
from skillframe.reproduce.crane_runs import MOVING, Follow
from tests.crane_corner import SKILL, draws

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
    loop = MachineLoop(
        Follow(standing, MOVING), Setup(robot=load_robot_model("hiab_xs031"), scene=world), WORN, rngs, None
    )
    loop.tare()
    found, true = loop.valves, WORN["actuator.deadband"][:, None]
    error = np.abs(found.overlap - true)
    assert np.all(error < 5.0 * found.overlap_deviation)
    assert error[:, :2].max() < 2e-3
    supply = WORN["actuator.supply_pressure"][:, None]
    np.testing.assert_allclose(found.supply, np.tile(supply, 3), atol=3e5)
    np.testing.assert_allclose(found.lag[:, :2].mean(axis=1), 0.01 + WORN["actuator.delay"], atol=0.005)
    np.testing.assert_array_equal(loop.law.deadband, found.compensated)
    np.testing.assert_array_equal(loop.law.supply, found.supply)


@pytest.mark.needs_plugins
def test_a_tool_that_goes_on_pressing_into_the_corner_presses_evenly():
    """Ripple of the true force over the last 4 s.

    It was 750 to 1000 N when friction was compensated by tanh(v / 5 mm/s).
    """
    document = copy.deepcopy(json.loads(SKILL.read_text(encoding="utf-8")))
    document["phases"][0]["stop"] |= {"stall_s": 1e3, "time_limit_s": 1e3}
    skill, setup = prepare(load_robot_model("hiab_xs031"), load_world("pallets", {}), document)
    _, drawn = draws(2, 5)
    rngs = [np.random.default_rng([5, i]) for i in range(2)]
    result = simulate(skill, setup, drawn, rngs, duration_s=18.0, trace_hz=100.0)
    for trace in result.traces:
        last = trace.wrench_true[trace.time > 14.0][:, [0, 2]]
        assert len(last) > 350
        assert np.hypot(*last.std(axis=0)) < 450.0
        assert np.hypot(*last.mean(axis=0)) > 3000.0
