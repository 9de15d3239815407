r"""Every pair of policies, judged so that one may look after every trial and stop when the answer is there.

For each pair the trials on which the two differ are counted: w that only the first succeeds in, l only the second. If
both are equally good, 1/M_n(1/2) of the beta mixture (`campaign.statistics.mcnemar_sequential`) is a p-value at all n
at once, so the smallest one so far is a p-value, too (Ville's inequality). Holm's step-down method over these minima
holds the chance of any false decision at alpha, however the pairs depend on each other; since minima only fall, a
decision once taken stands. Trials that both ran are pairs by their number. What is left over is paired in order of
arrival, which is valid since nothing of the outcomes decides it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.claims.letters import letters
from skillframe.campaign.claims.trials import Trials
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
    """

    policy: str
    trials: int
    successes: int
    low: float
    high: float
    letters: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two policies.

    Attributes:
        first: a policy.
        second: another.
        pairs: trials on which both are compared.
        by_number: how many of them have the same trial number.
        only_first: only the first succeeded.
        only_second: only the second succeeded.
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
        wins: (n,) 1 where only the first policy succeeded, -1 where only the second, else 0.
        by_number: how many of them have the same trial number.
    """

    rows: NDArray[np.int64]
    wins: NDArray[np.int64]
    by_number: int


def compare(trials: Trials, alpha: float = ALPHA) -> Judgement:
    """Judge every pair.

    Args:
        trials: the table.
        alpha: chance of any false decision, over all pairs and all looks.
    """
    ended = {policy: [row.success for row in trials.rows if row.policy == policy] for policy in trials.policies}
    order = sorted(trials.policies, key=lambda policy: -sum(ended[policy]) / len(ended[policy]))
    names = list(combinations(order, 2))
    evidence = [evidence_of(trials, first, second) for first, second in names]
    rows, corrected = holm_of_minima(evidence, len(trials.rows))
    open_pairs = int(np.sum(corrected[-1] > alpha))
    pairs = tuple(
        _pair(first, second, found, rows, corrected[:, k], alpha, open_pairs)
        for k, ((first, second), found) in enumerate(zip(names, evidence, strict=True))
    )
    marks = letters(order, [(pair.first, pair.second) for pair in pairs if pair.better])
    standings = tuple(_standing(policy, ended[policy], marks[policy]) for policy in order)
    return Judgement(standings=standings, pairs=pairs, alpha=alpha, doubts=trials.doubts)


def evidence_of(trials: Trials, first: str, second: str) -> Evidence:
    """The pairs of trials of two policies: by trial number, then what is left over in order of arrival."""
    ran = [
        {row.trial: (number, row.success) for number, row in enumerate(trials.rows, start=1) if row.policy == policy}
        for policy in (first, second)
    ]
    both = [(ran[0][trial], ran[1][trial]) for trial in ran[0] if trial in ran[1]]
    alone = [[ran[i][trial] for trial in ran[i] if trial not in ran[1 - i]] for i in (0, 1)]
    pairs = sorted((max(a[0], b[0]), int(a[1]) - int(b[1])) for a, b in [*both, *zip(*alone, strict=False)])
    rows, wins = (np.array([pair[i] for pair in pairs], dtype=np.int64) for i in (0, 1))
    return Evidence(rows, wins, len(both))


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
        path = np.concatenate([[1.0], np.minimum.accumulate(_p_values(e.wins))])
        minima[:, k] = path[np.searchsorted(e.rows, looks, side="right")]
    order = np.argsort(minima, axis=1, kind="stable")
    steps = np.arange(len(evidence), 0, -1)
    stepped = np.maximum.accumulate(np.minimum(1.0, np.take_along_axis(minima, order, axis=1) * steps), axis=1)
    corrected = np.empty_like(minima)
    np.put_along_axis(corrected, order, stepped, axis=1)
    return looks, corrected


def _p_values(wins: NDArray[np.int64]) -> Float:
    """(n,) p-values of "both are equally good" after each pair of trials."""
    return mcnemar_sequentials(np.cumsum(wins == 1), np.cumsum(wins == -1))


def _standing(policy: str, ended: Sequence[bool], marks: str) -> Ranked:
    interval = confidence_sequence(sum(ended), len(ended))
    return Ranked(policy, len(ended), sum(ended), interval.low, interval.high, marks)


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
        more=None if at is not None else more_trials(won, lost, len(found.rows), alpha / open_pairs),
    )  # fmt: skip


def _ahead(found: Evidence, row: int) -> int:
    """By how many trials the first was ahead where the evidence up to a row was strongest."""
    wins = found.wins[found.rows <= row]
    return int(np.sum(wins[: 1 + int(np.argmin(_p_values(wins)))]))


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
    low, high = 0, MOST_MORE
    while low < high:
        middle = (low + high) // 2
        share = 1.0 + middle / pairs
        if float(mcnemar_sequentials(won * share, lost * share)) <= level:
            high = middle
        else:
            low = middle + 1
    return None if low == MOST_MORE else low
