"""Counts that tables and pages show have their intervals behind them."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom
from skillframe_papers import bars, document, page
from skillframe_papers.bars import SAID, with_intervals

from skillframe.files.documents import read_json

COMMITTED = Path(document.__file__).parent / "reproduced" / "reproduce.json"
DOCS = Path(__file__).resolve().parents[3] / "docs"


@settings(max_examples=30)
@given(st.integers(1, 400), st.data())
def test_each_bound_leaves_one_in_forty_beyond_it(count, data):
    """The tail of the binomial at each bound is 2.5 %, to the whole per cents that are shown."""
    hits = data.draw(st.integers(0, count))
    shown = re.fullmatch(rf"{hits} of {count} \((\d+) to (\d+) %\)", with_intervals(f"{hits} of {count}"))
    low, high = (int(bound) / 100.0 for bound in shown.groups())
    assert low <= hits / count + 0.005 and high >= hits / count - 0.005
    if hits:
        assert binom.sf(hits - 1, count, max(low - 0.005, 0.0)) <= 0.025 <= binom.sf(hits - 1, count, low + 0.005)
    if hits < count:
        assert binom.cdf(hits, count, min(high + 0.005, 1.0)) <= 0.025 <= binom.cdf(hits, count, high - 0.005)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("found in 20 of 20 pairs", "found in 20 of 20 (83 to 100 %) pairs"),
        ("12 of 12 groups of 3", "12 of 12 (74 to 100 %) groups of 3"),
        ("10 of 12 (52 to 98 %) of them", "10 of 12 (52 to 98 %) of them"),
        ("10 of 12 is 52 to 98 % with 95 % confidence", "10 of 12 is 52 to 98 % with 95 % confidence"),
        ("13 of 12, 0 of 0, 1.5 of 3", "13 of 12, 0 of 0, 1.5 of 3"),
    ],
)  # fmt: skip
def test_only_counts_get_an_interval_and_get_it_once(text, shown):
    assert with_intervals(text) == shown
    assert with_intervals(shown) == shown


def test_every_count_of_the_committed_table_has_its_interval_on_page_and_in_docs():
    entries = [{**each, "pictures": []} for each in read_json(COMMITTED, "")]
    for text in (page.render(entries), document.render(entries)):
        ours = re.sub(r"<[^>]+>", " ", text)
        assert "20 of 20 (83 to 100 %)" in ours and SAID in ours
        bare = re.findall(r"\b\d+ of \d+\b(?! (?:\(\d+ to \d+ %\)|is \d+ to))", ours)
        assert set(bare) <= set(re.findall(r"\d+ of \d+", " ".join(f"{e.get('weak')} {e['bar']}" for e in entries)))


def test_the_page_of_the_docs_is_made_of_the_committed_table(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "_extensions"))
    from generated import MARK, filled

    text = (DOCS / "explanation" / "reproduced.md").read_text(encoding="utf-8")
    before, after = text.split(MARK)
    assert filled("explanation/reproduced", text) == before + document.body(read_json(COMMITTED, "")) + after
    assert filled("index", MARK) == MARK


def test_the_docs_list_every_row_with_its_committed_verdict():
    text = (DOCS / "explanation" / "reproduce.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"^\| (\d+) \|.*\| (\w+) \|$", text, re.MULTILINE))
    assert shown == {each["row"]: each["verdict"] for each in read_json(COMMITTED, "")}


def test_a_count_has_its_interval_and_is_ahead_only_if_intervals_do_not_touch():
    assert bars.counted(9, 12) == "9 of 12 (43 to 95 %)"  # Clopper and Pearson: 0.4281 to 0.9451
    assert bars.ahead(20, 12, 20, quick=False) and not bars.ahead(20, 13, 20, quick=False)  # 0.832; 0.809, 0.846
    assert bars.ahead(3, 2, 3, quick=True) and not bars.ahead(3, 3, 3, quick=True)
    assert bars.ahead(30, 1, 30, quick=False, others=5)  # 0.884; 0.716
    assert not bars.ahead(30, 3, 30, quick=False, others=5)  # 3 of 5 reaches up to 0.947
    assert bars.ahead(30, 4, 30, quick=True, others=5) and not bars.ahead(30, 5, 30, quick=True, others=5)


def test_nulls_that_a_count_is_not_ahead_of_are_named():
    nulls = {"stiff": (2, 20), "by hand": (5, 5)}
    assert bars.level(20, 20, nulls, quick=False) == ["by hand"] and bars.level(0, 20, nulls, quick=False) == [*nulls]
    assert bars.no_better(["by hand"]) == "; no better than by hand" and bars.no_better([]) == ""


def test_a_verdict_on_several_shares_is_the_worst_of_them_and_fails_beside_a_null():
    assert bars.together(["pass", "pass"], True) == "pass" and bars.together(["pass"], False) == "fail"
    assert bars.together(["pass", "reported"], True) == "reported"
    assert bars.together(["reported", "fail"], True) == "fail"
