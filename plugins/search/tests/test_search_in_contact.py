"""Searches in the simulated world: short runs that end in each way there is."""

from functools import cache

import numpy as np
import pytest
from search_runs import PARAMS, document, goals, robot, scene, search
from skillframe_search.example import example
from skillframe_teaching.blind import BlindSettings, record_blind

from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_world, prepare
from skillframe.skill import Status

PLANE = (0.004, 0.004, 0.0)


def given(algorithm="sampling", **changes):
    """An example document at the tip: 4 s of search around the start, no simulated demonstration needed."""
    found = example(algorithm)
    phase = found["phases"][0]
    for key, value in changes.items():
        group, _, name = key.partition("__")
        phase[group] = {**phase[group], name: value} if name else value
    frame = {**found["frame"], "learned_at": [0.0, 0.0, 0.2], "center_of_compliance": [0.0, 0.0, 0.2]}
    return {**found, "frame": frame}


def run(found, offset, count=1, duration=6.0, params=None):
    skill, setup = prepare(robot(), load_world("peg_in_hole", {**PARAMS["peg_in_hole"], **(params or {})}), found)
    draws = {f"start.offset_{axis}": np.broadcast_to(value, count) for axis, value in zip("xyz", offset, strict=True)}
    rngs = [np.random.default_rng([1, i]) for i in range(count)]
    return simulate(skill, setup, draws, rngs, duration_s=duration, trace_hz=100.0)


@pytest.mark.slow
def test_a_spiral_finds_a_hole_2_mm_away_and_says_so_from_contact_as_well_as_slightly_above():
    result = run(given("spiral"), offset=(0.002, 0.0, np.array([0.0, -0.001, 0.003])), count=3)
    assert result.success.all()
    assert all(reason.startswith("fell in after") for reason in result.reason)


@cache
def beside():
    """Two searches of 2 s where there is no hole."""
    return run(given("spiral", stop__time_s=2.0), offset=(0.019, 0.0, 0.0), count=2)


def test_where_there_is_no_hole_it_fails_in_its_time_and_does_not_cry_found():
    result = beside()
    assert (result.status == Status.FAILURE).all()
    assert all("did not fall in" in reason for reason in result.reason)
    # 1 mm of approach and 3 N at 1000 N/m, both at 5 mm/s, take 0.8 s; then 2 s of search
    np.testing.assert_allclose(result.duration_s, 2.8, atol=0.2)


@pytest.mark.slow
def test_it_presses_with_its_push_while_it_slides():
    """Ten newtons within 3 % in the mean, once the push has grown. The sensor's bias is removed by the tare."""
    trace = beside().traces[0]
    late = trace.time > 1.0
    assert trace.wrench_true[late, 2].mean() == pytest.approx(10.0, rel=0.03)


@pytest.mark.slow
def test_what_was_learned_at_the_wrist_presses_alike_at_the_tip():
    """The same search with its centre elsewhere: the feed-forward is moved, the way of the tip is the same."""
    at_tip = given()
    at_wrist = {**at_tip, "frame": {**at_tip["frame"], "learned_at": [0.0, 0.0, 0.0]}}
    one, two = (run(found, offset=(0.019, 0.0, 0.0), duration=1.5).traces[0] for found in (at_tip, at_wrist))
    # the way bends by less than a micrometre, because what holds the tool upright differs and moves the touch
    np.testing.assert_allclose(one.desired_position[:, :2], two.desired_position[:, :2], atol=1e-6)


@pytest.mark.slow
@pytest.mark.figures
def test_a_blind_person_s_searches_teach_one_that_finds_the_hole():
    """The whole chain on 8 goals: at least half found in 20 s, where a random walk finds a quarter."""
    learned = document("peg_in_hole", PLANE)
    result, seconds = search(learned, "peg_in_hole", goals(8, PLANE))
    assert np.isfinite(seconds).sum() >= 4
    assert not any(reason.startswith("fell in") for reason in result.reason[~result.success])


@pytest.mark.slow
def test_the_learned_spread_and_force_are_near_the_person_s():
    """Believed 4 mm: he stops where he finds it and shows less. Within 40 %. Pushed with 10 N, within 10 %."""
    phase = document("peg_in_hole", PLANE, push=None)["phases"][0]
    deviation = np.sqrt(np.diag(phase["exploration"]["covariance"]))
    assert ((deviation > 0.0024) & (deviation < 0.0056)).all()
    assert phase["push"]["force"] == pytest.approx(10.0, rel=0.1)


@pytest.mark.slow
def test_the_socket_is_learned_in_three_dimensions():
    settings = BlindSettings(believed=scene("socket").task.believed, time_s=15.0)
    recording = record_blind(robot(), scene("socket"), settings, count=2, seed=4)
    from plugins.search.tests.test_learning import phase_of

    assert phase_of(*recording.demonstrations, at="tip").searched == ("across_1", "across_2", "turn")
