"""Is a share reached? By counting; in a quick run, whose trials are few, only what the counts exclude is not.

Where few groups are counted, a share that is missed by count, though its interval holds the threshold, is undecided.

Quick: the exact two-sided 95 % interval of the share (Clopper and Pearson 1934) must reach the bar. Our choice, because
a bar that is met by 54 of 60 is missed by 9 of 10 one time in three.
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
    """A sentence if a share is missed by count and not excluded by its exact 95 % interval; "" otherwise."""
    low, high = clopper_pearson(hits, count)
    if reached(hits, count, bar, quick=quick) or high < bar - ROUNDING:
        return ""
    return (
        f"Undecided: {hits} of {count} is {100.0 * low:.0f} to {100.0 * high:.0f} % with 95 % confidence, which "
        f"neither shows nor excludes {100.0 * bar:g} %."
    )
