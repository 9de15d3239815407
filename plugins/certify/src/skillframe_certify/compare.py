r"""Sequential comparison of every pair of policies, valid at every look.

For each pair, w trials succeed with the first policy only and l with the second only. If both are equally good,
1/M_n(1/2) of the beta mixture (`campaign.statistics.mcnemar_sequential`) is a p-value at all n at once, and so is its
running minimum (Ville). Holm's method over these minima bounds the probability of any false decision by alpha, and
decisions are final. Trials are paired by number, the others in order of arrival, which does not depend on outcomes.

*Scores.* With a score, signed ranks replace successes. If both policies are equally good, the sign of the difference
d_t of their scores is fair given the sizes |d_1| ... |d_t|, and so is that of its signed rank

    w_t = sign(d_t) rank(|d_t| among |d_1| ... |d_t|) / t.

Then E exp(L w) = cosh(L w) <= exp(L^2 w^2 / 2), so exp(L S - L^2 V / 2) with S = sum w and V = sum w^2 is a
supermartingale for every L (de la Pena 1999, Annals of Probability 27). So is its mixture over a normal L of variance 1
/ RHO,

    M_t = sqrt(RHO / (RHO + V)) exp(S^2 / (2 (RHO + V))),

and min(1, 1 / M_t) is a p-value at all t at once (Ville). Ranks need neither scale nor bound.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from string import ascii_lowercase
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skillframe.campaign import confidence_sequence, mcnemar_sequentials, more_pairs, more_trials
from skillframe.frames import Float
from skillframe_certify.trials import Trial, Trials

RHO = 2.5
"""Most sensitive at about 60 pairs (Robbins' choice for V = 60 / 3 and 5 %); any value is valid."""


class Ranked(NamedTuple):
    """Success of one policy.

    Attributes:
        policy: its name.
        trials: number of its trials.
        successes: how many of them succeeded.
        low: end of the 95 % interval, valid at every look.
        high: the same.
        letters: policies that share one show no difference.
        quartiles: of the score, with the median in the middle; empty without a score.
    """

    policy: str
    trials: int
    successes: int
    low: float
    high: float
    letters: str
    quartiles: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Comparison of two policies.

    Attributes:
        first: a policy.
        second: another.
        pairs: number of paired trials.
        by_number: how many of them share a trial number.
        only_first: pairs in which only the first succeeded, or had the better score.
        only_second: the same of the second.
        p_value: valid at every look, corrected for the number of policy pairs.
        better: the better policy, or "" if undecided.
        known_after: rows of the table after which it was decided, or None.
        more: estimate of further pairs until a decision at the present rates; None if unknown.
    """

    first: str
    second: str
    pairs: int
    by_number: int
    only_first: int
    only_second: int
    p_value: float
    better: str
    known_after: int | None
    more: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Comparison of all policies.

    Attributes:
        standings: the best first.
        pairs: every two, in the order of `standings`.
        alpha: probability of any false decision.
        doubts: sentences on shortcomings of the table.
    """

    standings: tuple[Ranked, ...]
    pairs: tuple[Pair, ...]
    alpha: float
    doubts: tuple[str, ...]


class Evidence(NamedTuple):
    """Paired outcomes of two policies, in the order in which pairs were completed.

    Attributes:
        rows: (n,) row of the table, from 1, that completed each pair.
        wins: (n,) 1 where only the first policy succeeded, -1 where only the second, else 0; signs of `gains` if given.
        by_number: how many pairs share a trial number.
        gains: (n,) advantage of the first policy's score, or None to compare successes.
    """

    rows: NDArray[np.int64]
    wins: NDArray[np.int64]
    by_number: int
    gains: Float | None = None

    def p_values(self) -> Float:
        """Return (n,) p-values of "both are equally good" after each pair."""
        if self.gains is None:
            return mcnemar_sequentials(np.cumsum(self.wins == 1), np.cumsum(self.wins == -1))
        ranks = signed_ranks(self.gains)
        return p_value(np.cumsum(ranks), np.cumsum(ranks**2))

    def leans(self) -> Float:
        """Return (n,) the first policy's lead after each pair, negative if the second leads."""
        result: Float = np.cumsum(self.wins if self.gains is None else signed_ranks(self.gains), dtype=float)
        return result


def compare(trials: Trials, alpha: float = 0.05, better: int = 0) -> Judgement:
    """Compare every pair of policies.

    Args:
        trials: the table.
        alpha: probability of any false decision, over all pairs and looks.
        better: 0 compares successes, 1 scores (higher is better), -1 scores (lower is better).
    """
    ran = {policy: [row for row in trials.rows if row.policy == policy] for policy in trials.policies}
    if better:
        ranks = {policy: -better * float(np.median([row.score for row in rows])) for policy, rows in ran.items()}
    else:
        ranks = {policy: -sum(row.success for row in rows) / len(rows) for policy, rows in ran.items()}
    order = sorted(trials.policies, key=lambda policy: ranks[policy])
    names = list(combinations(order, 2))
    evidence = [evidence_of(trials, first, second, better) for first, second in names]
    rows, corrected = holm_of_minima(evidence, len(trials.rows))
    open_pairs = int(np.sum(corrected[-1] > alpha))
    pairs = tuple(
        _pair(first, second, found, rows, corrected[:, k], alpha, open_pairs)
        for k, ((first, second), found) in enumerate(zip(names, evidence, strict=True))
    )
    marks = letters(order, [(pair.first, pair.second) for pair in pairs if pair.better])
    standings = []
    for policy in order:
        won, count = sum(row.success for row in ran[policy]), len(ran[policy])
        interval = confidence_sequence(won, count)
        quartiles = np.quantile([row.score for row in ran[policy]], (0.25, 0.5, 0.75)).tolist() if better else []
        standings.append(Ranked(policy, count, won, interval.low, interval.high, marks[policy], tuple(quartiles)))
    return Judgement(standings=tuple(standings), pairs=pairs, alpha=alpha, doubts=trials.doubts)


def evidence_of(trials: Trials, first: str, second: str, better: int = 0) -> Evidence:
    """Return the paired trials of two policies: by number, then the others in order of arrival."""

    def worth(row: Trial) -> float:
        return better * row.score if better else float(row.success)

    ran = [
        {row.trial: (number, worth(row)) for number, row in enumerate(trials.rows, start=1) if row.policy == policy}
        for policy in (first, second)
    ]
    both = [(ran[0][trial], ran[1][trial]) for trial in ran[0] if trial in ran[1]]
    alone = [[ran[i][trial] for trial in ran[i] if trial not in ran[1 - i]] for i in (0, 1)]
    pairs = sorted((max(a[0], b[0]), a[1] - b[1]) for a, b in [*both, *zip(*alone, strict=False)])
    rows = np.array([row for row, _ in pairs], dtype=np.int64)
    gains = np.array([gain for _, gain in pairs], dtype=float)
    return Evidence(rows, np.sign(gains).astype(np.int64), len(both), gains if better else None)


def holm_of_minima(evidence: Sequence[Evidence], rows: int) -> tuple[NDArray[np.int64], Float]:
    """Return corrected p-values after each row that adds evidence.

    Args:
        evidence: of k pairs.
        rows: number of rows in the table.

    Returns:
        (m,) rows, including the last, and (m, k) p-values, which never rise.
    """
    looks = np.unique(np.concatenate([e.rows for e in evidence] + [np.array([rows], dtype=np.int64)]))
    minima = np.ones((len(looks), len(evidence)))
    for k, e in enumerate(evidence):
        path = np.concatenate([[1.0], np.minimum.accumulate(e.p_values())])
        minima[:, k] = path[np.searchsorted(e.rows, looks, side="right")]
    order = np.argsort(minima, axis=1, kind="stable")
    steps = np.arange(len(evidence), 0, -1)
    stepped = np.maximum.accumulate(np.minimum(1.0, np.take_along_axis(minima, order, axis=1) * steps), axis=1)
    corrected = np.empty_like(minima)
    np.put_along_axis(corrected, order, stepped, axis=1)
    return looks, corrected


def _pair(
    first: str, second: str, found: Evidence, rows: NDArray[np.int64], p_values: Float, alpha: float, open_pairs: int
) -> Pair:
    won, lost = int(np.sum(found.wins == 1)), int(np.sum(found.wins == -1))
    known = np.flatnonzero(p_values <= alpha)
    at = int(rows[known[0]]) if len(known) else None
    better = ""
    if at is not None:
        count = int(np.searchsorted(found.rows, at, side="right"))
        better = (first, second)[float(found.leans()[int(np.argmin(found.p_values()[:count]))]) < 0]
    return Pair(
        first=first, second=second, pairs=len(found.rows), by_number=found.by_number, only_first=won, only_second=lost,
        p_value=float(p_values[-1]), better=better, known_after=at,
        more=None if at is not None else _more(found, alpha / open_pairs),
    )  # fmt: skip


def _more(found: Evidence, level: float) -> int | None:
    """Estimate how many further pairs bring the p-value down to a level at the present rates."""
    if found.gains is None:
        return more_trials(int(np.sum(found.wins == 1)), int(np.sum(found.wins == -1)), len(found.rows), level)
    ranks = signed_ranks(found.gains)
    total, squares = float(np.sum(ranks)), float(np.sum(ranks**2))
    if not total:
        return None
    return more_pairs(lambda more: float(p_value(total * more, squares * more)) <= level, len(found.rows))


def signed_ranks(gains: Float) -> Float:
    """Return (n,) signed ranks from (n,) differences, each among those so far over their number. Ties share."""
    known: list[float] = []
    found = np.zeros(len(gains))
    for t, gain in enumerate(np.asarray(gains, dtype=float).tolist()):
        size = abs(gain)
        insort(known, size)
        rank = 0.5 * (bisect_left(known, size) + bisect_right(known, size) + 1)
        found[t] = np.sign(gain) * rank / (t + 1)
    return found


def p_value(total: ArrayLike, squares: ArrayLike) -> Float:
    """Return p-values of "both are equally good" from S and V."""
    wide = RHO + np.asarray(squares, dtype=float)
    log = 0.5 * np.log(RHO / wide) + np.asarray(total, dtype=float) ** 2 / (2.0 * wide)
    result: Float = np.minimum(1.0, np.exp(-log))
    return result


def letters(names: Sequence[str], differ: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return letters that group policies: two that share a letter show no significant difference.

    The algorithm is "insert and absorb" (Piepho 2004, "An algorithm for a letter-based representation of all-pairwise
    comparisons", J. Comput. Graph. Stat. 13(2)). Start with one column that holds all. For each pair that differs,
    split every column with both into two, each without one of them, and drop columns that others contain.

    Args:
        names: the best first; letters follow this order.
        differ: pairs of names with a significant difference.
    """
    columns = [frozenset(names)]
    for first, second in differ:
        parted = [column for column in columns if not {first, second} <= column]
        for column in columns:
            if {first, second} <= column:
                parted += [column - {first}, column - {second}]
        columns = [
            c for i, c in enumerate(parted) if not any(c < d or (c == d and i > j) for j, d in enumerate(parted))
        ]
    order = {name: i for i, name in enumerate(names)}
    columns.sort(key=lambda column: sorted(order[name] for name in column))
    marks = [ascii_lowercase[i % 26] + (str(i // 26) if i >= 26 else "") for i in range(len(columns))]  # z, then a1
    return {name: "".join(m for m, column in zip(marks, columns, strict=True) if name in column) for name in names}
