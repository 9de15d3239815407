"""Which interval and which test a campaign's design allows, and when it allows none.

| design | all trials ran | unfinished, or may stop early |
|---|---|---|
| independent draws (uniform, normal, choice, nothing) | exact, fixed number | valid at every look |
| sobol | as above; its points are not independent | as above; its points are not independent |
| grid of several cells, values | exact, fixed number | none |
| grid, trials not a multiple of its cells | none | none |

Grid and values axes run in their order, so the first trials are one end of them: no interval from these trials can hold
for the whole. All of them together are a fixed plan of independent trials with different success probabilities. For the
mean of these, the binomial's tails, and so Clopper and Pearson's interval and McNemar's test, are on the safe side
(Hoeffding 1956, "On the distribution of the number of successes in independent trials", theorem 4).

An unfinished campaign counts each skill's trials up to the first one that is missing. The rows beyond are left out:
which of them are there depends on how long trials take, and a failure often takes longer than a success.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from skillframe.campaign import statistics
from skillframe.campaign.axes import Axis, cells_of
from skillframe.campaign.statistics import Interval

SOBOL = "; sobol points are not independent draws, so this is not proved: see the docs"
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
    """What was fixed before the first trial.

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
        """The first trials are one part of the design, not a sample of all of it."""
        return self.cells > 1 or self.listed


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """What may be said about counts.

    Attributes:
        basis: of intervals and p-values.
        why_none: if there are none, the reason and what to do; else "".
        note: what limits them, as the end of a sentence; else "".
    """

    basis: Basis
    why_none: str = ""
    note: str = ""

    def interval(self, successes: int, trials: int) -> Interval | None:
        """The 95 % interval of a rate, or None if there is none."""
        if self.basis is Basis.NONE:
            return None
        if trials == 0:
            return Interval(0.0, 1.0)
        fixed = self.basis is Basis.FIXED
        return (statistics.clopper_pearson if fixed else statistics.confidence_sequence)(successes, trials)

    def p_value(self, only_first: int, only_second: int) -> float | None:
        """p-value of "both skills are equally good" from the trials where they differ, or None if there is none."""
        if self.basis is Basis.NONE:
            return None
        fixed = self.basis is Basis.FIXED
        return (statistics.mcnemar if fixed else statistics.mcnemar_sequential)(only_first, only_second)

    @property
    def interval_method(self) -> str:
        """The interval's name, or why there is none."""
        names = {Basis.FIXED: statistics.CLOPPER_PEARSON, Basis.EVERY_LOOK: statistics.SEQUENCE}
        return names[self.basis] + self.note if self.basis in names else f"no interval: {self.why_none}"

    @property
    def test_method(self) -> str:
        """The test's name, or why there is no p-value."""
        names = {Basis.FIXED: statistics.MCNEMAR, Basis.EVERY_LOOK: statistics.MCNEMAR_SEQUENTIAL}
        return names[self.basis] + self.note if self.basis in names else f"no p-value: {self.why_none}"


def plan_of(vary: Mapping[str, Axis], *, trials: int, skills: int, may_stop: bool) -> Plan:
    """The plan of a campaign over some axes."""
    kinds = {axis.kind for axis in vary.values()}
    return Plan(
        trials=trials, skills=skills, cells=cells_of(vary), listed="values" in kinds, sobol="sobol" in kinds,
        may_stop=may_stop,
    )  # fmt: skip


def validity_of(plan: Plan, *, complete: bool) -> Validity:
    """What may be said of a campaign.

    Args:
        plan: of the campaign.
        complete: all its trials ran, or it stopped early as asked.
    """
    if plan.in_order and (not complete or plan.may_stop):
        return Validity(basis=Basis.NONE, why_none=PART)
    if plan.trials % plan.cells:
        return Validity(basis=Basis.NONE, why_none=_uneven(plan))
    note = SOBOL if plan.sobol else ""
    return Validity(basis=Basis.FIXED if complete and not plan.may_stop else Basis.EVERY_LOOK, note=note)


def _uneven(plan: Plan) -> str:
    return (
        f"{plan.trials} trials do not cover the grid's {plan.cells} cells equally often; "
        f"make trials a multiple of {plan.cells}"
    )


def unbroken(trials: Iterable[int]) -> int:
    """How many of the trials 0, 1, 2 ... are there before the first one that is missing."""
    there, count = set(trials), 0
    while count in there:
        count += 1
    return count
