"""The rate of a real robot from real and simulated trials: a martingale, its coverage, and what the command refuses."""

import json
from itertools import product

import numpy as np
import pytest
from skillframe_certify.joined import can_draw, join, joined, log_mean
from skillframe_certify.real_trials import Real

from skillframe import Campaign, learn, record
from skillframe.campaign.sampling import Axis
from skillframe.campaign.statistics import clopper_pearson, confidence_sequence
from skillframe.cli.main import run
from skillframe.errors import InputError


def counts_of(y, f):
    return tuple(int(np.sum((y == a) & (f == b))) for a, b in product((True, False), repeat=2))


@pytest.mark.parametrize(("both", "real", "only"), [(0.7, 0.05, 0.1), (0.2, 0.3, 0.4), (0.97, 0.0, 0.02)])
def test_the_wealth_has_mean_one_at_the_true_rates(both, real, only):
    p = np.array([both, real, only, 1.0 - both - real - only])
    wealth = [np.exp(log_mean(np.eye(4, dtype=int)[i], both + real, both + only)) for i in range(4)]
    assert p @ wealth == pytest.approx(1.0, rel=1e-12)


def test_the_wealth_falls_in_the_real_rate_and_rises_in_the_simulated_one():
    """So the lower end of the simulation's interval gives the lower end of the real one."""
    counts = np.array([30, 2, 3, 5])
    assert np.all(np.diff([log_mean(counts, theta, 0.8) for theta in np.linspace(0.01, 0.99, 50)]) < 0.0)
    assert np.all(np.diff([log_mean(counts, 0.6, m) for m in np.linspace(0.01, 0.99, 50)]) > 0.0)


def test_a_robot_that_fails_where_its_simulation_fails_needs_fewer_trials_and_another_one_few_more():
    y = np.arange(100) < 80
    same, none = joined(counts_of(y, y), (1600, 2000)), joined(counts_of(y, np.arange(100) % 5 > 0), (1600, 2000))
    assert same.alone == none.alone == confidence_sequence(80, 100)
    assert same.interval.low < 0.8 < same.interval.high and same.worth > 200
    assert none.interval.width < 1.1 * none.alone.width


def test_failing_is_the_mirror_of_success():
    one, other = joined((40, 3, 5, 12), (700, 1000)), joined((12, 5, 3, 40), (300, 1000))
    assert one.interval.low == pytest.approx(1.0 - other.interval.high, abs=1e-6)
    assert one.interval.high == pytest.approx(1.0 - other.interval.low, abs=1e-6)


def test_each_end_is_where_the_mean_reaches_the_level_that_is_left_for_it():
    """A tenth of 5 % is the simulation's own, and each end of the rest has half."""
    counts, (low, high) = (30, 2, 3, 5), clopper_pearson(800, 1000, 0.005)
    found, level = joined(counts, (800, 1000)).interval, np.log(2.0 / 0.045)
    assert log_mean(np.array(counts), found.low, low) == pytest.approx(level, abs=1e-4)
    assert log_mean(np.array(counts[::-1]), 1.0 - found.high, 1.0 - high) == pytest.approx(level, abs=1e-4)


def test_no_trial_says_nothing_and_all_successes_leave_the_top_open():
    assert joined((0, 0, 0, 0), (90, 100)).interval == (0.0, 1.0)
    assert joined((50, 0, 0, 0), (1000, 1000)).interval.high == 1.0


@pytest.mark.parametrize(("rate", "differs", "wrong"), [(0.9, 0.05, 0.05), (0.7, 0.3, 0.05), (0.8, 0.05, 0.4)])
def test_an_interval_that_is_looked_at_three_times_misses_the_rate_rarely(rate, differs, wrong):
    """At most one in twenty over all looks together, also where the simulation is wrong one way.

    `differs` and `wrong` are the chances that a simulated trial fails where the real one succeeds, and the other way.
    """
    rng, missed, repeats = np.random.default_rng(20), 0, 60
    mean = rate * (1.0 - differs) + (1.0 - rate) * wrong
    for _ in range(repeats):
        y = rng.random(100) < rate
        f = np.where(y, rng.random(100) >= differs, rng.random(100) < wrong)
        simulated = (int(rng.binomial(2000, mean)), 2000)
        intervals = [joined(counts_of(y[:n], f[:n]), simulated).interval for n in (20, 60, 100)]
        missed += any(not low <= rate <= high for low, high in intervals)
    assert missed <= 3


@pytest.mark.parametrize(
    ("axis", "inside", "outside"),
    [
        (Axis(kind="uniform", numbers=(-0.1, 0.2)), 0.2, 0.21),
        (Axis(kind="normal", numbers=(0.0, 0.002)), -0.011, 2.5),
        (Axis(kind="choice", numbers=(0.1, 0.2)), 0.2, 0.15),
    ],
)
def test_a_sample_that_the_campaign_cannot_draw_is_found(axis, inside, outside):
    assert can_draw(axis, inside) and not can_draw(axis, outside)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A finished campaign in the valley, whose starts are too far aside in some trials."""
    place = tmp_path_factory.mktemp("joined")
    learn(record("valley", robot="free_tool", count=2, seed=3).demonstrations).save(place / "push.skill.json")
    vary = {"start.offset_x": {"uniform": [-0.07, 0.07]}, "world.friction": {"uniform": [0.1, 0.3]}}
    Campaign(
        world="valley", robot="free_tool", skills=[str(place / "push.skill.json")], trials=60, seed=5, duration_s=6.0,
        vary=vary,
    ).run(place / "results")  # fmt: skip
    return place / "results"


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_each_real_trial_is_simulated_with_its_samples(campaign, tmp_path, capsys):
    """The robot that is entered is the simulation itself with other friction, so most outcomes are alike."""
    offsets = np.linspace(-0.069, 0.069, 12)
    for i, offset in enumerate(offsets):
        won = ["--success"] if abs(offset) < 0.06 else ["--failure"]
        said = ["--skill", "push", *won, "--samples", f"start.offset_x={offset}"]
        assert run(["trials", "enter", str(tmp_path / "bench"), *said]) == 0, i
    capsys.readouterr()
    words = ["trials", "rate", str(tmp_path / "bench"), "--campaign", str(campaign)]
    assert run([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert sum(found["counts"]) == 12 and found["counts"][0] + found["counts"][1] == 10
    assert found["simulated"][1] == 60 and found["interval"][0] < 10 / 12 < found["interval"][1]
    assert run(words) == 0
    assert "real trials     10 of 12 succeeded" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.parametrize(
    ("samples", "said"),
    [
        ({"start.offset_x": 0.08}, "is no sample of"),
        ({"offset": 0.0}, "the campaign varies start.offset_x"),
    ],
)
def test_trials_of_another_distribution_are_refused(campaign, samples, said):
    with pytest.raises(InputError, match=said):
        join(campaign, [Real("push", True, "", samples, 0)])
