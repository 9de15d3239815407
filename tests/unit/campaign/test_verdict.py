"""The verdict of a campaign: pass, fail or undecided, and never by a sentence that is always the same."""

from dataclasses import replace

import numpy as np
import pytest
from campaign_fakes import FakeParams, run, start
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from skillframe.campaign.folder import load
from skillframe.campaign.spec import Expect
from skillframe.campaign.statistics import Interval, clopper_pearson, judged, trials_without_failure, verdict_of
from skillframe.campaign.summary import below_bar, read_summary


@given(wins=st.integers(0, 60), more=st.integers(0, 60), required=st.floats(0.0, 1.0))
def test_a_pass_lies_above_the_requirement_a_fail_below_and_the_rest_is_undecided(wins, more, required):
    interval = clopper_pearson(wins, wins + more) if wins + more else Interval(0.0, 1.0)
    word = verdict_of(required, interval, complete=True).word
    assert (word == "pass") == (interval.low >= required)
    assert (word == "fail") == (interval.high < required)


def test_a_bound_that_is_met_exactly_is_met():
    assert verdict_of(0.9, Interval(0.9, 0.95), complete=True).word == "pass"
    assert verdict_of(0.95, Interval(0.9, 0.95), complete=True).word == "undecided"


@pytest.mark.parametrize(
    ("required", "interval", "complete", "obstacle", "said"),
    [
        (None, Interval(0.9, 1.0), True, "", "requires nothing"),
        (0.5, Interval(0.9, 1.0), False, "", "has not ended"),
        (0.5, None, True, "", "allows no interval"),
        (0.5, Interval(0.9, 1.0), True, "the table was changed", "the table was changed"),
    ],
)
def test_what_cannot_be_concluded_is_undecided_and_says_why(required, interval, complete, obstacle, said):
    found = verdict_of(required, interval, complete=complete, obstacle=obstacle)
    assert found.word == "undecided"
    assert said in found.why


@given(required=st.floats(0.01, 0.995))
def test_the_trials_that_would_do_without_a_failure_do_and_one_fewer_does_not(required):
    n = trials_without_failure(required)
    # the bound is 0.025^(1/n); at the edge rounding may go either way
    assert clopper_pearson(n, n).low >= required - 1e-12
    assert n == 1 or clopper_pearson(n - 1, n - 1).low < required + 1e-12


def test_what_it_would_take_is_said_only_where_nothing_has_failed():
    assert "72 trials" in verdict_of(0.95, clopper_pearson(20, 20), complete=True).why  # ln 0.025 / ln 0.95 = 71.9
    assert "trials" not in verdict_of(0.95, clopper_pearson(19, 20), complete=True).why
    assert "ever fails" in verdict_of(1.0, clopper_pearson(20, 20), complete=True).why


def test_a_summary_holds_the_verdict_where_something_is_required_and_the_exit_code_goes_by_the_rate(campaign, tmp_path):
    assert "verdict" not in run(start(campaign(trials=6), tmp_path / "plain"))
    out = start(campaign(trials=6, extra="[expect]\nrate = 0.01"), tmp_path / "asked")
    summary = run(out)
    assert summary == read_summary(out)
    figures = summary["skills"]["a.skill.json"]
    assert 0.0 < figures["interval_95"][0] < figures["rate"] < figures["interval_95"][1] < 1.0
    assert (summary["verdict"]["skill"], summary["verdict"]["verdict"]) == ("a.skill.json", "pass")
    spec = load(out, FakeParams)
    near = replace(spec, expect=Expect(rate=figures["rate"]))
    assert judged(figures["rate"], figures, complete=True).word == "undecided"
    assert below_bar(near, summary) == ""


def test_by_the_interval_only_a_pass_ends_with_0_and_the_sentence_is_the_verdict_s(campaign, tmp_path):
    """The rate is reached in both; 6 trials show 0.01 and not the rate that they had."""
    out = start(campaign(trials=6, extra='[expect]\nrate = 0.01\nby = "interval"'), tmp_path / "out")
    summary, spec = run(out), load(out, FakeParams)
    assert spec.expect == Expect(rate=0.01, by="interval")
    assert below_bar(spec, summary) == ""
    near = replace(spec, expect=Expect(rate=summary["skills"]["a.skill.json"]["rate"], by="interval"))
    assert below_bar(near, summary).startswith("a.skill.json: undecided: the ")
    assert below_bar(replace(spec, expect=Expect(rate=1.0, by="interval")), summary).startswith("a.skill.json: fail: ")


def test_by_the_interval_a_skill_below_what_is_required_passes_in_at_most_one_campaign_in_40():
    """Summed over all counts: 20 trials of a skill of 0.8 against 0.9 pass in 21 % by the rate (docs), 0 here."""
    counts = np.arange(21)
    chance = binom.pmf(counts, 20, 0.8)
    assert chance[counts >= 18].sum() == pytest.approx(0.206, abs=0.001)
    for true in (0.5, 0.8, 0.95):
        shown = [verdict_of(true + 1e-9, clopper_pearson(int(s), 20), complete=True).word == "pass" for s in counts]
        assert binom.pmf(counts, 20, true)[shown].sum() <= 0.025


def test_what_decides_the_exit_code_is_in_the_plain_campaign_only_where_it_was_chosen(campaign, tmp_path):
    """Else the hashes of campaigns that were run before would change."""
    spec = load(start(campaign(trials=6, extra="[expect]\nrate = 0.5"), tmp_path / "out"), FakeParams)
    assert spec.plain()["expect"] == {"rate": 0.5, "skill": None}
    chosen = replace(spec, expect=Expect(rate=0.5, by="interval"))
    assert chosen.from_plain(chosen.plain()).expect == chosen.expect
