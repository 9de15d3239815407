"""Comparing policies from a table: the evidence against independent computation, errors over many null campaigns."""

import json
import re
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_certify.compare import (
    RHO,
    Evidence,
    compare,
    evidence_of,
    holm_of_minima,
    letters,
    p_value,
    signed_ranks,
)
from skillframe_certify.trials import Trial, Trials, read_trials

from skillframe.campaign.statistics import holm, mcnemar_sequential, more_trials
from skillframe.cli.main import run
from skillframe.errors import InputError


def table_of(outcomes, policies="abcdefgh"):
    """A table in which all policies run trial 0, then all run trial 1 ... from booleans (trials, policies)."""
    rows = [Trial(str(t), policies[k], bool(won)) for t, line in enumerate(outcomes) for k, won in enumerate(line)]
    return Trials(rows=tuple(rows), policies=tuple(policies[: outcomes.shape[1]]))


def correlated(rng, trials, rates):
    """Outcomes of policies that meet the same draws: a common part of the luck and one's own."""
    luck = 0.6 * rng.standard_normal((trials, 1)) + 0.8 * rng.standard_normal((trials, len(rates)))
    from scipy.stats import norm

    return luck < norm.ppf(rates)


def test_p_values_are_holms_of_the_smallest_sequential_mcnemar_so_far():
    """Against the scalar functions of the campaign, look by look."""
    outcomes = correlated(np.random.default_rng(3), 60, [0.9, 0.7, 0.55])
    table = table_of(outcomes)
    names = list(combinations("abc", 2))
    rows, corrected = holm_of_minima([evidence_of(table, a, b) for a, b in names], len(table.rows))
    smallest = dict.fromkeys(names, 1.0)
    expected = {}
    for trial in range(len(outcomes)):
        seen = outcomes[: trial + 1]
        for a, b in names:
            i, j = "abc".index(a), "abc".index(b)
            only = int(np.sum(seen[:, i] & ~seen[:, j])), int(np.sum(~seen[:, i] & seen[:, j]))
            smallest[a, b] = min(smallest[a, b], mcnemar_sequential(*only))
        expected[3 * trial + 3] = holm([smallest[name] for name in names])  # the trial's last row
    for row, values in zip(rows, corrected, strict=True):
        if int(row) in expected:
            assert values == pytest.approx(expected[int(row)], rel=1e-12)


def test_a_decision_once_taken_stands_however_the_trials_go_on():
    won = np.array([[True, False]] * 20 + [[False, True]] * 40)
    early = compare(table_of(won[:20])).pairs[0]
    late = compare(table_of(won)).pairs[0]
    assert early.better == late.better == "a"
    assert mcnemar_sequential(7, 0) <= 0.05 < mcnemar_sequential(6, 0)
    assert early.known_after == late.known_after == 14  # the seventh pair


@pytest.mark.slow
def test_of_1000_campaigns_of_five_equal_policies_at_most_one_in_twenty_decides_anything():
    """Looked at after every row. 50 expected at most; 65 is two standard deviations (6.9) above."""
    rng, false = np.random.default_rng(2026_11_22), 0
    for _ in range(1000):
        won = correlated(rng, 300, [0.7] * 5).astype(np.int64)
        rows = 5 * np.arange(1, 301)
        pairs = [Evidence(rows, won[:, i] - won[:, j], 300) for i, j in combinations(range(5), 2)]
        false += bool(np.any(holm_of_minima(pairs, 1500)[1] <= 0.05))
    assert false <= 65


def test_what_differs_is_found_and_named_best_first():
    found = compare(table_of(correlated(np.random.default_rng(5), 400, [0.6, 0.9, 0.75])))
    assert [each.policy for each in found.standings] == ["b", "c", "a"]
    assert {pair.better for pair in found.pairs} == {"b", "c"}
    assert [each.letters for each in found.standings] == ["a", "b", "c"]


def test_left_over_trials_are_paired_in_order_of_arrival():
    rows = [Trial("0", "a", True), Trial("1", "a", False), Trial("7", "b", True), Trial("0", "b", False)]
    found = evidence_of(Trials(rows=tuple(rows), policies=("a", "b")), "a", "b")
    assert found.by_number == 1
    assert list(found.rows) == [3, 4]  # 1 of a with 7 of b, complete at row 3; trial 0 at row 4
    assert list(found.wins) == [-1, 1]


@given(differ=st.sets(st.sampled_from(list(combinations("abcdef", 2)))))
def test_two_policies_share_a_letter_exactly_if_they_are_not_told_apart(differ):
    names = "abcdef"
    marks = letters(names, sorted(differ))
    for pair in combinations(names, 2):
        assert bool(set(marks[pair[0]]) & set(marks[pair[1]])) == (pair not in differ)


def test_the_number_of_trials_that_would_decide_does_and_one_fewer_does_not():
    more = more_trials(8, 3, 40, 0.05)
    for count, decided in ((more, True), (more - 1, False)):
        share = 1 + count / 40
        assert (mcnemar_sequential(8 * share, 3 * share) <= 0.05) == decided
    assert more_trials(5, 5, 40, 0.05) is None


HEAD = "trial,policy,success\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trial,who,success\n0,a,1\n", "has no column policy"),
        ("trial,policy\n0,a\n", "has no column success"),
        (HEAD + "0,a,1\n0,b,maybe\n", "row 3: success is 'maybe'"),
        (HEAD + "0,a,1\n0,b,1\n0,a,0\n", "row 4: is trial 0 of a again, after row 2"),
        (HEAD + "0,a,1\n1,a,1\n", "holds 1 policy"),
        (HEAD + "0,a\n", "row 2: has 2 cells, the header 3"),
        (HEAD, "holds 0 policy"),
        ("trial,policy,success,success\n0,a,1,1\n", "has two columns success"),
        ("trial,policy,success,stream\n0,a,1,fresh\n0,b,1,border\n", "row 3: is of the stream 'border'"),
        ("", "is empty"),
    ],
)
def test_a_table_that_cannot_be_judged_is_refused_in_a_sentence(tmp_path, capsys, text, said):
    path = tmp_path / "t.csv"
    path.write_text(text)
    assert run(["compare", str(path)]) == 2
    assert said in capsys.readouterr().err


def test_draws_that_differ_within_a_trial_are_refused(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("trial;policy;success;tilt\n0;a;1;0.1\n0;b;0;0.2\n")
    assert read_trials(path).policies == ("a", "b")
    with pytest.raises(InputError, match=re.escape("tilt is 0.2 in trial 0, and 0.1 in row 2")):
        read_trials(path, ["tilt"])


def test_missing_trials_are_counted_aloud(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(HEAD + "0,a,1\n0,b,0\n2,a,1\n")
    assert read_trials(path).doubts == (
        "b did not run trial 2", "nobody ran trial 1",
        "if a trial was left out because of how it ended, no figure here holds",
    )  # fmt: skip


def test_the_command_reads_a_campaigns_table_and_gives_json(tmp_path, capsys):
    path = tmp_path / "results.csv"
    lines = [f"{t},{p},{int(won)},7" for t in range(20) for p, won in (("lmc", True), ("replay", t % 2 == 0))]
    path.write_text("\n".join(["trial,skill,success,seed", *lines]) + "\n")
    assert run(["compare", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [p["policy"] for p in said["policies"]] == ["lmc", "replay"]
    (pair,) = said["comparisons"]
    assert (pair["only_first"], pair["only_second"], pair["by_number"]) == (10, 0, 20)
    assert pair["p_value"] == pytest.approx(mcnemar_sequential(10, 0))
    assert run(["compare", str(path)]) == 0
    assert "lmc is better; known after row 28" in capsys.readouterr().out  # the seventh trial that replay loses is 13


def scored(gains, lower=False):
    """Two policies whose scores differ by (n,) gains, each trial with luck of its own; `a` gains."""
    luck = np.random.default_rng(8).standard_normal(len(gains))
    scores = np.stack([luck + (-gains if lower else gains), luck], axis=1)
    rows = [Trial(str(t), "ab"[k], True, s) for t, line in enumerate(scores) for k, s in enumerate(line.tolist())]
    return Trials(rows=tuple(rows), policies=("a", "b"))


def test_the_p_value_of_scores_is_the_mixture_of_exponential_supermartingales():
    """Against its integral over the normal mixing density of variance 1 / RHO."""
    from scipy.integrate import quad
    from scipy.stats import norm

    for total, squares in ((7.0, 4.0), (-3.0, 9.0), (0.5, 30.0)):
        mixed, _ = quad(lambda x, s=total, v=squares: np.exp(x * s - x**2 * v / 2) * norm.pdf(x, 0, RHO**-0.5), -9, 9)
        assert float(p_value(total, squares)) == pytest.approx(min(1.0, 1.0 / mixed), rel=1e-6)


def test_signed_ranks_are_those_of_the_differences_so_far():
    assert signed_ranks(np.array([3.0, -1.0, 2.0, 0.0, -3.0])) == pytest.approx(
        [1.0, -1 / 2, 2 / 3, 0.0, -4.5 / 5]  # the last ties with the first for places 4 and 5
    )


def test_of_400_pairs_of_equal_policies_with_heavy_tails_at_most_one_in_twenty_is_ever_told_apart():
    """200 looks each: 20 expected at most, standard deviation 4.4; three of them. A cauchy difference has no mean."""
    gains = np.random.default_rng(5).standard_cauchy((400, 200))
    ranks = np.array([signed_ranks(line) for line in gains])
    ever = np.min(p_value(np.cumsum(ranks, axis=1), np.cumsum(ranks**2, axis=1)), axis=1) <= 0.05
    assert ever.sum() <= 33


@pytest.mark.parametrize("lower", [False, True])
def test_a_better_score_is_found_and_one_outlier_does_not_hide_it(lower):
    gains = np.random.default_rng(6).normal(1.0, 1.0, 60)
    gains[20] = -1e6
    found = compare(scored(gains, lower), better=-1 if lower else 1)
    (pair,) = found.pairs
    assert (pair.better, found.standings[0].policy) == ("a", "a")
    won = int(np.sum(gains > 0.0))
    assert {pair.first: pair.only_first, pair.second: pair.only_second} == {"a": won, "b": 60 - won}
    early = compare(scored(gains[: pair.known_after // 2], lower), better=-1 if lower else 1).pairs[0]
    assert early.better == "a"
    just_before = compare(scored(gains[: pair.known_after // 2 - 1], lower), better=-1 if lower else 1).pairs[0]
    assert (just_before.better, just_before.more) == ("", pytest.approx(1, abs=4))


def test_scores_are_read_compared_and_shown(tmp_path, capsys):
    path = tmp_path / "t.csv"
    lines = [f"{t},{p},1,{force + t % 7}" for t in range(28) for p, force in (("soft", 5.0), ("stiff", 9.0))]
    path.write_text("\n".join(["trial,policy,success,force_n", *lines]) + "\n")
    assert run(["compare", str(path), "--score", "force_n", "--lower"]) == 0
    said = capsys.readouterr().out
    assert "soft is better" in said and "the first is better in 28, the second in 0" in said
    assert re.search(r"soft +28 +28 +8 +6 \.\. 10", said)  # 5 to 11, four times each
    path.write_text(path.read_text().replace("3,stiff,1,12.0", "3,stiff,1,"))
    assert run(["compare", str(path), "--score", "force_n"]) == 2
    assert "row 9: force_n is ''; give each trial a number" in capsys.readouterr().err
    assert run(["compare", str(path), "--lower"]) == 2
    assert "give --score COLUMN, too" in capsys.readouterr().err
