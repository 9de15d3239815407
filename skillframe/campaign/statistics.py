r"""Intervals and paired tests of success rates, for a fixed number of trials or valid at every look.

Fixed number of trials: the exact two-sided interval of Clopper and Pearson (1934). Early stopping looks repeatedly and
uses the beta-mixture confidence sequence (Robbins 1970): with the prior Beta(a, b), a = b = 1/2, of the alternative,

  M_n(p) = B(s + a, f + b) / ( B(a, b) p^s (1 - p)^f )

is a martingale of mean 1 at the true p, so by Ville's inequality {p : M_n(p) < 1/alpha} holds the truth at all n at
once with probability 1 - alpha. Two skills on the same samples are compared by the trials in which one alone succeeds
(McNemar 1947): binomial with 1/2 if they are equal; for repeated looks, the same martingale at p = 1/2. Several pairs
are corrected by Holm's step-down method (1979), which holds for any dependence of the p-values.

Whether a campaign met its required success probability p (`[expect] rate`).

With the rate's 95 % interval [low, high]:

  pass        low >= p
  fail        high < p
  undecided   otherwise, and for an unfinished or changed campaign or a design without interval (`validity`)

The exit code of `campaign run` follows the rate itself, or the verdict with `[expect] by = "interval"`.

Which interval and test a campaign's design allows.

| design | all trials ran | unfinished, or may stop early |
|---|---|---|
| independent samples (uniform, normal, choice, nothing) | exact, fixed number | valid at every look |
| sobol | as above, but its points are not independent | as above, but its points are not independent |
| grid of several cells, values | exact, fixed number | none |
| grid, trials not a multiple of its cells | none | none |

Grid and values axes run in order, so the first trials are no sample of the design. All together are independent trials
of different success probabilities, for whose mean Clopper and Pearson's interval and McNemar's test are conservative
(Hoeffding 1956, "On the distribution of the number of successes in independent trials", theorem 4).

An unfinished campaign counts each skill's trials up to the first missing one, since failures often take longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from statistics import median
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skillframe.campaign.sampling import Axis, cells_of
from skillframe.frames import Float

CLOPPER_PEARSON = "Clopper-Pearson (exact, two-sided, fixed number of trials)"
SEQUENCE = "beta(1/2,1/2)-mixture confidence sequence (two-sided, valid at every look)"
MCNEMAR = "McNemar (exact, two-sided, fixed number of trials)"
MCNEMAR_SEQUENTIAL = "sequential McNemar (beta(1/2,1/2) mixture, valid at every look)"
PRIOR = 0.5
"""a = b of the mixture: Jeffreys' prior, which gives narrow intervals where nearly all trials succeed."""
MOST_MORE = 1_000_000  # pairs of trials, beyond which the number is of no use


class Interval(NamedTuple):
    """Bounds of a success probability."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """High minus low."""
        return self.high - self.low


def clopper_pearson(successes: int, trials: int, alpha: float = 0.05) -> Interval:
    """Exact two-sided interval of level 1 - alpha for a fixed number of trials."""
    from scipy.special import betaincinv  # as scipy.stats.beta.ppf, which takes a second to load

    s, f = successes, trials - successes
    low = float(betaincinv(s, f + 1, alpha / 2)) if s else 0.0
    high = float(betaincinv(s + 1, f, 1 - alpha / 2)) if f else 1.0
    return Interval(low, high)


def log_mixture(successes: int, failures: int, probability: float) -> float:
    """Logarithm of M_n(p)."""
    return float(log_mixtures(successes, failures, probability))


def log_mixtures(successes: ArrayLike, failures: ArrayLike, probability: float) -> Float:
    """`log_mixture` of counts (n,), which may be fractional."""
    from scipy.special import betaln, xlog1py, xlogy

    won, lost = np.asarray(successes, dtype=float), np.asarray(failures, dtype=float)
    gain = betaln(won + PRIOR, lost + PRIOR) - betaln(PRIOR, PRIOR)
    result: Float = gain - xlogy(won, probability) - xlog1py(lost, -probability)
    return result


def confidence_sequence(successes: int, trials: int, alpha: float = 0.05) -> Interval:
    """Two-sided interval of level 1 - alpha that holds at all numbers of trials at once.

    log M is convex in p with its minimum at s/n, so each bound is the one root on its side.
    """
    from scipy.optimize import brentq

    if trials == 0:
        return Interval(0.0, 1.0)
    s, f = successes, trials - successes
    rate = s / trials

    def excess(p: float) -> float:
        return log_mixture(s, f, p) + math.log(alpha)

    tiny = 1e-300  # log M is finite here
    low = brentq(excess, tiny, rate, xtol=1e-12) if s and excess(tiny) > 0.0 else 0.0
    near_one = 1.0 - 1e-16
    high = brentq(excess, rate, near_one, xtol=1e-12) if f and excess(near_one) > 0.0 else 1.0
    return Interval(float(low), float(high))


def mcnemar(only_first: int, only_second: int) -> float:
    """Exact two-sided p-value of equally good skills, for a fixed number of trials."""
    from scipy.stats import binomtest

    n = only_first + only_second
    return float(binomtest(only_first, n, 0.5).pvalue) if n else 1.0


def mcnemar_sequential(only_first: int, only_second: int) -> float:
    """p-value of equally good skills that is valid at every look: min(1, 1/M_n(1/2))."""
    return float(mcnemar_sequentials(only_first, only_second))


def mcnemar_sequentials(only_first: ArrayLike, only_second: ArrayLike) -> Float:
    """`mcnemar_sequential` of counts (n,), which may be fractional."""
    result: Float = np.minimum(1.0, np.exp(-log_mixtures(only_first, only_second, 0.5)))
    return result


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values (k,) corrected by Holm's method: family-wise error at most alpha.

    The i-th smallest (i = 0 ...) is multiplied by k - i, and no corrected value is below an earlier one.
    """
    corrected, largest = [0.0] * len(p_values), 0.0
    for i, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        largest = max(largest, min(1.0, (len(p_values) - i) * p_values[place]))
        corrected[place] = largest
    return corrected


def correction(pairs: int) -> str:
    """The correction for several pairs, in words."""
    return f"Holm over {pairs} pairs" if pairs > 1 else "none, there is one pair"


def more_trials(won: int, lost: int, pairs: int, level: float) -> int | None:
    """About how many more pairs of trials bring the p-value to `level` at the present rates.

    Args:
        won: pairs in which only the first succeeded.
        lost: pairs in which only the second succeeded.
        pairs: all so far.
        level: of Holm's method for the next pair to be decided.

    Returns:
        None where both won equally often, or above a million.
    """
    if won == lost:
        return None
    return more_pairs(lambda more: float(mcnemar_sequentials(won * more, lost * more)) <= level, pairs)


def more_pairs(decides: Callable[[float], bool], pairs: int) -> int | None:
    """The smallest number of further pairs that decides at the present rates. None above a million."""
    low, high = 0, MOST_MORE
    while low < high:
        middle = (low + high) // 2
        if decides(1.0 + middle / pairs):
            high = middle
        else:
            low = middle + 1
    return None if low == MOST_MORE else low


def nearest_to_median(values: Mapping[int, float]) -> int | None:
    """The trial whose value is nearest to the median of the finite values (the earlier of two), or None."""
    known = {trial: value for trial, value in values.items() if math.isfinite(value)}
    if not known:
        return None
    middle = median(known.values())
    return min(known, key=lambda trial: (abs(known[trial] - middle), trial))


Word = Literal["pass", "fail", "undecided"]


class Verdict(NamedTuple):
    """A verdict and its reason.

    Attributes:
        word: "pass", "fail" or "undecided".
        why: the rest of a sentence that begins with the word.
    """

    word: Word
    why: str


def verdict_of(required: float | None, interval: Interval | None, *, complete: bool, obstacle: str = "") -> Verdict:
    """The verdict by the rule above. `obstacle` is why the table allows no conclusion, or ""."""
    if required is None:
        return Verdict("undecided", "the campaign requires nothing; write [expect] rate in its file")
    if obstacle:
        return Verdict("undecided", obstacle)
    if not complete:
        return Verdict("undecided", "the campaign has not ended")
    if interval is None:
        return Verdict("undecided", "this campaign's design allows no interval")
    share = f"{100.0 * required:g} %"
    if interval.low >= required:
        return Verdict("pass", f"the whole interval is at or above the {share} that are required")
    if interval.high < required:
        return Verdict("fail", f"the whole interval is below the {share} that are required")
    return Verdict("undecided", f"the {share} that are required lie inside the interval{_more(required, interval)}")


def _more(required: float, interval: Interval) -> str:
    if required >= 1.0:
        return "; no number of trials shows that nothing ever fails"
    if interval.high < 1.0 or required <= 0.0:
        return ""
    return f"; {trials_without_failure(required)} trials without a failure would show it"


def trials_without_failure(required: float) -> int:
    """Smallest n whose n successes put the exact interval's lower bound, 0.025^(1/n), at or above a rate in (0, 1)."""
    return math.ceil(math.log(0.025) / math.log(required))


def judged(required: float | None, figures: Mapping[str, Any], *, complete: bool) -> Verdict:
    """The verdict on a skill from its figures in summary.json."""
    bounds = figures["interval_95"]
    return verdict_of(required, None if bounds is None else Interval(*bounds), complete=complete)


SOBOL = "; it assumes independent trials, and sobol samples only approximate this"
PART = (
    "grid and values axes run in order, so the trials of a campaign that is unfinished, or could stop early, are one "
    "part of the design and no sample of it"
)


class Basis(Enum):
    """What intervals and p-values rest on."""

    FIXED = "fixed number of trials"
    EVERY_LOOK = "valid at every look"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The design fixed before the first trial.

    Attributes:
        trials: per skill.
        skills: their number.
        cells: of the grid; 1 without one.
        listed: some axis lists a value per trial.
        sobol: some axis is a sobol axis.
        may_stop: the campaign may stop early.
    """

    trials: int
    skills: int
    cells: int = 1
    listed: bool = False
    sobol: bool = False
    may_stop: bool = False

    @property
    def in_order(self) -> bool:
        """Whether the first trials are one part of the design and no sample of it."""
        return self.cells > 1 or self.listed


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """Intervals and tests that a campaign allows.

    Attributes:
        basis: of intervals and p-values.
        why_none: reason and advice if there are none, or "".
        note: their limitation as the end of a sentence, or "".
    """

    basis: Basis
    why_none: str = ""
    note: str = ""

    def interval(self, successes: int, trials: int) -> Interval | None:
        """The 95 % interval of a rate, or None."""
        if self.basis is Basis.NONE:
            return None
        if trials == 0:
            return Interval(0.0, 1.0)
        fixed = self.basis is Basis.FIXED
        return (clopper_pearson if fixed else confidence_sequence)(successes, trials)

    def p_value(self, only_first: int, only_second: int) -> float | None:
        """p-value of equally good skills, or None."""
        if self.basis is Basis.NONE:
            return None
        fixed = self.basis is Basis.FIXED
        return (mcnemar if fixed else mcnemar_sequential)(only_first, only_second)

    @property
    def interval_method(self) -> str:
        """Name of the interval, or why there is none."""
        names = {Basis.FIXED: CLOPPER_PEARSON, Basis.EVERY_LOOK: SEQUENCE}
        return names[self.basis] + self.note if self.basis in names else f"no interval: {self.why_none}"

    @property
    def test_method(self) -> str:
        """Name of the test, or why there is no p-value."""
        names = {Basis.FIXED: MCNEMAR, Basis.EVERY_LOOK: MCNEMAR_SEQUENTIAL}
        return names[self.basis] + self.note if self.basis in names else f"no p-value: {self.why_none}"


def plan_of(vary: Mapping[str, Axis], *, trials: int, skills: int, may_stop: bool) -> Plan:
    """The design of a campaign over some axes."""
    kinds = {axis.kind for axis in vary.values()}
    return Plan(
        trials=trials, skills=skills, cells=cells_of(vary), listed="values" in kinds, sobol="sobol" in kinds,
        may_stop=may_stop,
    )  # fmt: skip


def validity_of(plan: Plan, *, complete: bool) -> Validity:
    """Intervals and tests that a campaign allows."""
    if plan.in_order and (not complete or plan.may_stop):
        return Validity(basis=Basis.NONE, why_none=PART)
    if plan.trials % plan.cells:
        return Validity(
            basis=Basis.NONE,
            why_none=f"{plan.trials} trials do not cover the grid's {plan.cells} cells equally often; "
            f"make trials a multiple of {plan.cells}",
        )
    note = SOBOL if plan.sobol else ""
    return Validity(basis=Basis.FIXED if complete and not plan.may_stop else Basis.EVERY_LOOK, note=note)


def unbroken(trials: Iterable[int]) -> int:
    """Number of trials 0, 1, 2 ... before the first missing one."""
    there, count = set(trials), 0
    while count in there:
        count += 1
    return count
