"""What phases explain against chance."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_segmenter.explained import near_cuts, share_of, words


def test_phases_that_say_everything_explain_all_and_those_that_say_nothing_none():
    labels = [np.repeat([0, 1], 50), np.repeat([0, 1], (20, 80))]
    seen = [np.eye(2)[each] for each in labels]
    assert share_of(seen, labels) == pytest.approx(1.0)
    noise = [np.random.default_rng(i).normal(size=(2000, 3)) for i in range(2)]
    halves = [np.repeat([0, 1], 1000)] * 2
    assert share_of(noise, halves) == pytest.approx(0.0, abs=0.01)  # a mean of 1000 has a variance of 1/1000


def test_a_phase_that_means_something_else_in_each_recording_explains_less_than_nothing():
    labels = [np.repeat([0, 1], 50)] * 2
    seen = [np.eye(2)[labels[0]], np.eye(2)[1 - labels[1]]]
    # every window is 2 away, squared, from what the other recording says, and 1/2 from its mean
    assert share_of(seen, labels) == pytest.approx(1.0 - 2.0 / 0.5)


def test_the_share_of_one_recording_is_the_variance_between_its_phases():
    labels = np.repeat([0, 1, 2], 40)
    x = np.random.default_rng(0).normal(size=(120, 2)) + labels[:, None]
    means = np.array([x[labels == k].mean(axis=0) for k in range(3)])
    between = ((means[labels] - x.mean(axis=0)) ** 2).sum() / ((x - x.mean(axis=0)) ** 2).sum()
    assert share_of([x], [labels]) == pytest.approx(between)


def test_a_phase_that_no_other_recording_has_is_judged_by_the_mean():
    labels = [np.repeat([0, 1], 50), np.zeros(100, dtype=int)]
    x = np.random.default_rng(0).normal(size=(100, 2))
    # of the second recording's means there is one for phase 0, its own mean; phase 1 gets the same
    assert share_of([x + 1.0, x], labels) == pytest.approx(share_of([x + 1.0, x], [0 * labels[0], labels[1]]), abs=0.1)


def test_moments_near_a_cut_are_counted_once_and_none_without_cuts():
    assert near_cuts(np.array([1.0, 2.0, 3.0]), np.array([1.2, 0.9, 2.4])) == 1
    assert near_cuts(np.array([1.0]), np.array([])) == 0


def test_chance_is_told_in_words():
    touches = {"changes": 4, "near": 3, "chance": 0.7, "within_s": 0.25}
    found = {"share": 0.62, "chance": 0.3, "p": 0.005, "shifts": 199, "recordings": 3, "cuts": 2, "touches": touches}
    assert words(found)[0].endswith("against 30% for time-shifted data (p = 0.005, 199 shifts)")
    assert words(found)[1] == "contact begins or ends 4 times, 3 of them within 0.25 s of a cut; by chance 0.7"
    assert "no better than chance" in words({**found, "p": 0.4})[0]
    many = {**touches, "changes": 46}
    assert words({**found, "cuts": 0, "touches": many}) == ["nothing is cut, though contact begins or ends 46 times"]
    for changes in (4, 12):  # four a recording are a person who touches twice
        assert words({**found, "cuts": 0, "touches": {**touches, "changes": changes}}) == []
    assert "one recording" in words({**found, "recordings": 1})[0]


def test_a_share_that_rounds_to_nothing_has_no_sign_and_one_change_is_once():
    touches = {"changes": 1, "near": 0, "chance": 0.1, "within_s": 0.25}
    found = {"share": -0.004, "chance": -0.06, "p": 0.1, "shifts": 199, "recordings": 3, "cuts": 3, "touches": touches}
    share, contact = words(found)
    assert share.startswith("phases explain 0% of") and "against -6% for time-shifted data (p = 0.1" in share
    assert contact.startswith("contact begins or ends once, 0 of them")
