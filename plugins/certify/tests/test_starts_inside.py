"""A start inside something in claims and comparisons: neither success nor failure, and no box may hold one."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from skillframe_certify import procedure
from skillframe_certify.box import Box
from skillframe_certify.claim import judge
from skillframe_certify.engine import Looked
from skillframe_certify.procedure import cleared, propose
from skillframe_certify.question import Question
from skillframe_certify.sensitivity import compared
from skillframe_certify.trials import read_trials

from skillframe.errors import InputError
from tests.unit.campaign.campaign_fakes import run, start, write_campaign
from tests.unit.campaign.test_refused_starts import some_inside


def test_a_comparison_says_how_many_rows_are_no_trials(tmp_path):
    folder = start(write_campaign(tmp_path / "in", trials=50), tmp_path / "out")
    run(folder, some_inside)
    table = read_trials(folder / "results.csv")
    assert len(table.rows) == 80
    assert table.doubts == ("20 of 100 rows are starts inside something: no trials, and in no figure here",)


def test_a_box_that_holds_a_refused_fresh_start_does_not_pass_and_the_start_is_no_trial():
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (400, 2))
    inside = points[:, 0] > 0.9
    whole, part = Box(np.full(2, -1.0), np.ones(2)), Box(np.array([-1.0, -1.0]), np.array([0.85, 1.0]))
    works = ~inside
    small, large = judge([part, whole], points, works, 0.9, 0.05, inside)
    assert small.passed
    assert small.refused == 0
    assert not large.passed
    assert large.refused == inside.sum()
    assert (large.trials, large.failures) == (400 - inside.sum(), 0)


def test_a_box_is_cut_until_no_start_in_it_is_inside_something(monkeypatch):
    """Of tilts above 0.5 and offsets above 0.2 at once the tool is inside: a corner that no look may meet."""
    monkeypatch.setattr(procedure, "load", lambda *_: SimpleNamespace(vary={}))
    monkeypatch.setattr(procedure, "replace", lambda base, **new: new)
    question = Question(rate=0.9, confidence=0.95, ranges={"a": (-1.0, 1.0), "b": (-1.0, 1.0)})

    def starts(spec):
        a, b = (np.array(spec["vary"][name].numbers) for name in "ab")
        return ["the tool is 3 mm inside the fixture" if x > 0.5 and y > 0.2 else "" for x, y in zip(a, b, strict=True)]

    whole = Box(np.full(2, -1.0), np.ones(2))
    box = cleared(Path(), question, whole, SimpleNamespace(params=None, starts=starts))
    assert box.high[0] <= 0.5 or box.high[1] <= 0.2
    assert box.share > 0.5

    def everywhere(spec):
        return ["the tool is 3 mm inside the fixture"] * spec["trials"]

    with pytest.raises(InputError, match=r"vary\.[ab]: holds .*, where the tool is 3 mm inside the fixture"):
        cleared(Path(), question, whole, SimpleNamespace(params=None, starts=everywhere))


def test_trials_that_were_looked_at_count_refused_starts_apart_and_none_of_them_fails():
    points = np.linspace(-1.0, 1.0, 4)[:, None]
    seen = Looked(points, np.array([True, True, False, False]), np.array([False, False, False, True]))
    assert seen.counts == {"trials": 3, "successes": 2, "refused": 1}
    assert [*seen.fails] == [False, False, True, False]
    both = seen.with_more(Looked(points, np.ones(4, dtype=bool)))
    assert both.counts == {"trials": 7, "successes": 6, "refused": 1}
    (held,) = compared(seen, [("x", Looked(points, np.ones(4, dtype=bool)))])
    assert (held.trials, held.before, held.after) == (3, 2, 3)
    question = Question(rate=0.9, confidence=0.95, ranges={"a": (-1.0, 1.0)})
    with pytest.raises(InputError, match="all 4 explored starts are inside something"):
        propose(question, Looked(points, np.zeros(4, dtype=bool), np.ones(4, dtype=bool)))
