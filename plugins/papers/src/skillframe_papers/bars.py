"""Is a share reached? A full run goes by the count, a quick one by whether the counts exclude it.

A quick run has few trials, so there the upper end of the exact two-sided 95 % interval (Clopper and Pearson 1934) must
reach the threshold. This is our choice: at a true rate of 0.9, ten trials miss a threshold of 0.9 one time in four.
Where a full run has few groups, too, a share that misses its threshold while its interval contains it is undecided.
"""

from __future__ import annotations

from skillframe.campaign.statistics import clopper_pearson
from skillframe.extend.records import Verdict

ROUNDING = 1e-9


def reached(hits: int, count: int, bar: float, *, quick: bool) -> bool:
    """Whether `hits` of `count` reach a share."""
    share = clopper_pearson(hits, count).high if quick else hits / count
    return share >= bar - ROUNDING


def judged(hits: int, count: int, bar: float, *, quick: bool) -> Verdict:
    """Verdict on a share: "pass" if it is reached, "fail" if the counts exclude it, else "reported" as undecided."""
    if reached(hits, count, bar, quick=quick):
        return "pass"
    return "reported" if undecided(hits, count, bar, quick=quick) else "fail"


def undecided(hits: int, count: int, bar: float, *, quick: bool) -> str:
    """A sentence if a share is missed by count and not excluded by its exact 95 % interval. "" otherwise."""
    low, high = clopper_pearson(hits, count)
    if reached(hits, count, bar, quick=quick) or high < bar - ROUNDING:
        return ""
    return (
        f"Undecided: {hits} of {count} is {100.0 * low:.0f} to {100.0 * high:.0f} % with 95 % confidence, which "
        f"neither shows nor excludes {100.0 * bar:g} %."
    )
