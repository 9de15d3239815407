"""A trial's result is the same to the last bit in whatever company it runs: chunks, order, alone.

It is what makes the replay of one trial of a campaign the very row of its table.
"""

import numpy as np
import pytest

from skillframe.execution.executor import simulate
from skillframe.execution.trace import Trace
from skillframe.world.quantities import SensorSettings
from tests.laws.pushing import Push, impedance
from tests.laws.runs import setup

CASES = {
    "valley": (impedance("x"), {"start.offset_x": 0.02, "start.tilt_y": 0.1, "world.friction": 0.3}),
    "peg_in_hole": (impedance("xy", "xyz"), {"start.tilt_y": 0.1, "start.offset_x": 0.001, "fixture.offset_x": 0.001}),
    "hose_coupler": (impedance("x", "y"), {"grasp.tilt_y": 0.02, "grasp.offset_x": 0.001, "start.tilt_x": 0.05}),
    "funnel": (impedance("xy"), {"start.offset_y": 0.015, "robot.mass_scale": 1.1, "sensor.force_bias_x": 2.0}),
}
RESULTS = ("success", "status", "duration_s", "peak_force_n", "final_error_m", "final_error_rad", "energy_j")


def draws_of(world, count):
    """Random draws within the sizes of a case, by trial. Friction and masses are factors about nominal."""
    rng = np.random.default_rng(5)
    made = {}
    for key, size in CASES[world][1].items():
        unit = rng.uniform(-1.0, 1.0, count)
        one_sided = key in ("world.friction", "robot.mass_scale")
        made[key] = size * (1.0 + 0.3 * unit) if one_sided else size * unit
    return made


def outcomes(robot, world, trials, duration):
    """Result rows and traces of some trials run together, by trial."""
    draws = {key: values[trials] for key, values in draws_of(world, 24).items()}
    setting = setup(robot, world, sensors=SensorSettings())
    rngs = [np.random.default_rng([11, int(trial)]) for trial in trials]
    skill = Push((0.0, 0.0, -1.0), CASES[world][0], speed=0.05)
    result = simulate(skill, setting, draws, rngs, duration_s=duration, trace_hz=200.0)
    return {
        int(trial): (*(getattr(result, name)[i] for name in RESULTS), result.reason[i], result.traces[i])
        for i, trial in enumerate(trials)
    }


def assert_identical(ones, others):
    for trial, one in others.items():
        assert one[:-1] == ones[trial][:-1], trial
        for name in Trace.__slots__:
            if name != "meta":
                np.testing.assert_array_equal(getattr(one[-1], name), getattr(ones[trial][-1], name), err_msg=name)


def check(robot, world, duration, alone):
    trials = np.arange(24)
    whole = outcomes(robot, world, trials, duration)
    touched = [np.abs(one[-1].wrench_true).max() > 0 for one in whole.values()]
    assert np.mean(touched) > 0.9  # the runs get into contact, where a difference would show
    assert_identical(whole, outcomes(robot, world, trials[:5], duration))
    assert_identical(whole, outcomes(robot, world, trials[5:], duration))
    assert_identical(whole, outcomes(robot, world, trials[::-1].copy(), duration))
    for trial in alone:
        assert_identical(whole, outcomes(robot, world, np.array([trial]), duration))


@pytest.mark.parametrize("robot", [pytest.param("free_tool", marks=pytest.mark.slow), "panda"])
def test_the_valley_s_rows_are_identical_in_chunks_in_reverse_and_alone(robot):
    check(robot, "valley", 0.5, alone=(0, 17))


@pytest.mark.parametrize("robot", ["free_tool", pytest.param("panda", marks=pytest.mark.slow)])
def test_a_varied_mass_and_a_second_nominal_batch_change_nothing_of_that(robot):
    check(robot, "funnel", 0.4, alone=(3,))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["free_tool", "panda"])
@pytest.mark.parametrize("world", ["peg_in_hole", "hose_coupler"])
@pytest.mark.figures
def test_rows_with_meshes_in_contact_are_identical_in_chunks_in_reverse_and_alone(robot, world):
    check(robot, world, 1.0, alone=range(0, 24, 4))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["free_tool", "panda"])
@pytest.mark.figures
def test_the_valley_s_rows_are_identical_one_by_one_to_the_end(robot):
    check(robot, "valley", 1.5, alone=range(24))
