"""What if: effects are told where there is one, and not where there is none."""

import numpy as np
import pytest
from skillframe_reports.results import read_results
from skillframe_reports.what_if import what_if

from skillframe.campaign.statistics import Plan

HEAD = "trial,skill,seed,actuator.supply_pressure,robot.payload,success,failure,duration_s,peak_force_n,final_error_m"


def table(trials, truth, seed=0):
    """Trials of a machine whose success, force [N] and error [m] `truth` draws from supply [Pa] and payload [kg]."""
    rng = np.random.default_rng(seed)
    rows = [HEAD]
    for i in range(trials):
        supply, payload = rng.uniform(100e5, 200e5), rng.uniform(300.0, 475.0)
        success, force, error = truth(rng, supply, payload)
        rows.append(
            f"{i},a,1,{supply!r},{payload!r},{int(success)},{'' if success else 'weak'},2.0,{force!r},{error!r}"
        )
    return "\n".join(rows) + "\n"


def page(text, trials, tmp_path):
    names = ("actuator.supply_pressure", "robot.payload")
    return what_if(read_results(tmp_path / "results.csv", names, Plan(trials=trials, skills=1), text), ())


def weak_below_150_bar(rng, supply, payload):
    return supply > 150e5, rng.normal(5e3, 100.0), rng.normal(1e-3, 1e-4) + 1e-5 * (payload - 300.0)


def test_what_a_quantity_does_is_told_and_what_it_does_not_do_is_not(tmp_path):
    text = page(table(240, weak_below_150_bar), 240, tmp_path)
    supply = text.split("<h4>Actuator supply pressure</h4>")[1].split("<h4>Robot")[0]
    payload = text.split("<h4>Robot payload</h4>")[1].split("<h4>Actuator")[0]
    assert "Success changes with it" in supply and "0 of 60 at 101 to" in supply and "60 of 60 at" in supply
    assert "Error at the end: no effect seen" in supply
    assert "Success: no effect seen" in payload
    assert "Error at the end changes with it" in payload  # 0.01 mm a kilogram, where it scatters by 0.1 mm


def test_a_change_that_is_sure_and_tiny_is_not_told_as_one_that_matters(tmp_path):
    """2 um of error against 8 um, in 240 trials: sure, and nothing that anybody could measure."""
    text = page(table(240, lambda rng, s, p: (True, 10.0, 2e-6 + (s - 100e5) * 6e-13)), 240, tmp_path)
    assert "Error at the end hardly changes with it: by less than 0.1 mm (p = " in text
    assert "end changes with it" not in text and "p says how sure it is, and not how large" in text


def test_of_few_failures_nothing_is_said_of_success(tmp_path):
    text = page(table(200, lambda rng, supply, payload: (rng.random() > 0.05, 1.0, 1e-3)), 200, tmp_path)
    assert "failures are too few to decide" in text


@pytest.mark.slow
def test_where_nothing_matters_no_more_than_one_page_in_twenty_says_that_something_does(tmp_path):
    false = 0
    for seed in range(120):
        text = page(table(80, lambda rng, s, p: (rng.random() < 0.5, rng.normal(), rng.normal()), seed), 80, tmp_path)
        false += "changes with it" in text
    assert false <= 12  # of 120 at most 6 are expected; more than 12 has a chance of 1 %


def test_force_and_error_are_of_trials_that_began(tmp_path):
    """A machine that rings in its swing has pushed on nothing, which is no small force."""
    text = table(80, lambda rng, supply, payload: (True, 100.0, 1e-3)).splitlines()
    ended = [line.replace(",1,,2.0,100.0,", ",0,the machine rings,0.0,0.0,") for line in text[1:41]]
    found = page("\n".join([text[0], *ended, *text[41:]]) + "\n", 80, tmp_path)
    assert "median 100," in found and "median 0," not in found


def test_a_campaign_that_stopped_early_is_drawn_and_not_tested(tmp_path):
    text, plan = table(60, weak_below_150_bar), Plan(trials=100, skills=1)
    results = read_results(tmp_path / "r.csv", ("robot.payload",), plan, text)
    text = what_if(results, ())
    assert "not tested" in text and "changes with it" not in text and "<svg" in text
