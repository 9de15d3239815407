r"""Every pair of policies, judged so that one may look after every trial and stop when the answer is there.

For each pair the trials on which the two differ are counted: w that only the first succeeds in, l only the second. If
both are equally good, 1/M_n(1/2) of the beta mixture (`campaign.statistics.mcnemar_sequential`) is a p-value at all n
at once, so the smallest one so far is a p-value, too (Ville's inequality). Holm's step-down method over these minima
holds the chance of any false decision at alpha, however the pairs depend on each other; since minima only fall, a
decision once taken stands. Trials that both ran are pairs by their number. What is left over is paired in order of
arrival, which is valid since nothing of the outcomes decides it.

With a score, the signed ranks of its differences take the place of successes (`signed_ranks`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.claims.letters import letters
from skillframe.campaign.claims.signed_ranks import p_value, signed_ranks
from skillframe.campaign.claims.trials import Trial, Trials
from skillframe.campaign.statistics import confidence_sequence, mcnemar_sequentials
from skillframe.frames import Float

ALPHA = 0.05
MOST_MORE = 1_000_000  # trials; that more would decide is no help


class Ranked(NamedTuple):
    """How often one policy succeeded.

    Attributes:
        policy: its name.
        trials: how many it ran.
        successes: how many of them succeeded.
        low: of the 95 % interval, valid at every look.
        high: the same.
        letters: policies that share one are not told apart.
        quartiles: of the score, its median between the other two; empty where none was asked for.
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
    """Two policies.

    Attributes:
        first: a policy.
        second: another.
        pairs: trials on which both are compared.
        by_number: how many of them have the same trial number.
        only_first: only the first succeeded, or its score was better.
        only_second: only the second succeeded, or its score was better.
        p_value: that may be looked at after every trial, corrected for the number of pairs.
        better: the policy that is better, or "" where that is not known.
        known_after: rows of the table after which it was known, or None.
        more: about how many pairs more would decide if the rates stay as they are; None where nobody can say.
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
    """All policies.

    Attributes:
        standings: the best first.
        pairs: every two, in the order of `standings`.
        alpha: chance of any false decision.
        doubts: sentences about what the table lacks.
    """

    standings: tuple[Ranked, ...]
    pairs: tuple[Pair, ...]
    alpha: float
    doubts: tuple[str, ...]


class Evidence(NamedTuple):
    """What the pairs of trials of two policies show, in the order in which they were complete.

    Attributes:
        rows: (n,) row of the table, from 1, that completed each.
        wins: (n,) 1 where only the first policy succeeded, -1 where only the second, else 0. Signs of gains, if there
            are some.
        by_number: how many of them have the same trial number.
        gains: (n,) by how much the first policy's score was better, or None where successes are compared.
    """

    rows: NDArray[np.int64]
    wins: NDArray[np.int64]
    by_number: int
    gains: Float | None = None

    def p_values(self) -> Float:
        """(n,) p-values of "both are equally good" after each pair of trials."""
        if self.gains is None:
            return mcnemar_sequentials(np.cumsum(self.wins == 1), np.cumsum(self.wins == -1))
        ranks = signed_ranks(self.gains)
        return p_value(np.cumsum(ranks), np.cumsum(ranks**2))

    def leans(self) -> Float:
        """(n,) above 0 where the first is ahead after each pair of trials, below 0 where the second is."""
        result: Float = np.cumsum(self.wins if self.gains is None else signed_ranks(self.gains), dtype=float)
        return result


def compare(trials: Trials, alpha: float = ALPHA, better: int = 0) -> Judgement:
    """Judge every pair.

    Args:
        trials: the table.
        alpha: chance of any false decision, over all pairs and all looks.
        better: 0 compares successes, 1 scores of which higher ones are better, -1 those of which lower ones are.
    """
    ran = {policy: [row for row in trials.rows if row.policy == policy] for policy in trials.policies}
    order = sorted(trials.policies, key=lambda policy: _rank(ran[policy], better))
    names = list(combinations(order, 2))
    evidence = [evidence_of(trials, first, second, better) for first, second in names]
    rows, corrected = holm_of_minima(evidence, len(trials.rows))
    open_pairs = int(np.sum(corrected[-1] > alpha))
    pairs = tuple(
        _pair(first, second, found, rows, corrected[:, k], alpha, open_pairs)
        for k, ((first, second), found) in enumerate(zip(names, evidence, strict=True))
    )
    marks = letters(order, [(pair.first, pair.second) for pair in pairs if pair.better])
    standings = tuple(_standing(policy, ran[policy], marks[policy], bool(better)) for policy in order)
    return Judgement(standings=standings, pairs=pairs, alpha=alpha, doubts=trials.doubts)


def _rank(ran: Sequence[Trial], better: int) -> float:
    """The lower the better."""
    if better:
        return -better * float(np.median([row.score for row in ran]))
    return -sum(row.success for row in ran) / len(ran)


def evidence_of(trials: Trials, first: str, second: str, better: int = 0) -> Evidence:
    """The pairs of trials of two policies: by trial number, then what is left over in order of arrival."""

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
    """Corrected p-values after each row at which some pair has new evidence.

    Args:
        evidence: of k pairs.
        rows: of the table.

    Returns:
        (m,) rows, the last one of the table among them, and (m, k) p-values, which never rise.
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


def _standing(policy: str, ran: Sequence[Trial], marks: str, scored: bool) -> Ranked:
    won = sum(row.success for row in ran)
    interval = confidence_sequence(won, len(ran))
    quartiles = np.quantile([row.score for row in ran], (0.25, 0.5, 0.75)).tolist() if scored else []
    return Ranked(policy, len(ran), won, interval.low, interval.high, marks, tuple(quartiles))


def _pair(
    first: str, second: str, found: Evidence, rows: NDArray[np.int64], p_values: Float, alpha: float, open_pairs: int
) -> Pair:
    won, lost = int(np.sum(found.wins == 1)), int(np.sum(found.wins == -1))
    known = np.flatnonzero(p_values <= alpha)
    at = int(rows[known[0]]) if len(known) else None
    better = "" if at is None else (first, second)[_ahead(found, at) < 0]
    return Pair(
        first=first, second=second, pairs=len(found.rows), by_number=found.by_number, only_first=won, only_second=lost,
        p_value=float(p_values[-1]), better=better, known_after=at,
        more=None if at is not None else _more(found, alpha / open_pairs),
    )  # fmt: skip


def _ahead(found: Evidence, row: int) -> float:
    """Above 0 if the first was ahead where the evidence up to a row was strongest."""
    count = int(np.searchsorted(found.rows, row, side="right"))
    return float(found.leans()[int(np.argmin(found.p_values()[:count]))])


def _more(found: Evidence, level: float) -> int | None:
    """About how many pairs of trials more bring the p-value down to a level, if the trials go on as they are."""
    if found.gains is None:
        return more_trials(int(np.sum(found.wins == 1)), int(np.sum(found.wins == -1)), len(found.rows), level)
    ranks = signed_ranks(found.gains)
    total, squares = float(np.sum(ranks)), float(np.sum(ranks**2))
    return (
        _first(lambda more: float(p_value(total * more, squares * more)) <= level, len(found.rows)) if total else None
    )


def more_trials(won: int, lost: int, pairs: int, level: float) -> int | None:
    """About how many pairs of trials more bring the p-value down to a level, if the rates stay as they are.

    Args:
        won: pairs that only the first succeeded in.
        lost: only the second.
        pairs: all so far.
        level: that Holm's method asks of the first pair to be decided.

    Returns:
        None where both won equally often, or where more than a million were needed.
    """
    if won == lost:
        return None
    return _first(lambda more: float(mcnemar_sequentials(won * more, lost * more)) <= level, pairs)


def _first(decides: Callable[[float], bool], pairs: int) -> int | None:
    """The smallest number of pairs more by which the trials so far, scaled up to them, decide."""
    low, high = 0, MOST_MORE
    while low < high:
        middle = (low + high) // 2
        if decides(1.0 + middle / pairs):
            high = middle
        else:
            low = middle + 1
    return None if low == MOST_MORE else low
