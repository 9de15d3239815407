"""Is a share reached? A full run goes by the count, a quick one by whether the counts exclude it.

A quick run has few trials, so there the upper end of the exact two-sided 95 % interval (Clopper and Pearson 1934) must
reach the threshold. This is our choice: at a true rate of 0.9, ten trials miss a threshold of 0.9 one time in four.
Where a full run has few groups, too, a share that misses its threshold while its interval contains it is undecided.
"""

from __future__ import annotations

from collections.abc import Iterable

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


def counted(hits: int, count: int) -> str:
    """A count with its exact 95 % interval: "9 of 12 (43 to 95 %)"."""
    low, high = clopper_pearson(hits, count)
    return f"{hits} of {count} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"


def ahead(hits: int, other: int, count: int, *, quick: bool) -> bool:
    """Whether one count of as many trials is above another: by 95 % intervals that do not touch, quick by the count."""
    if quick:
        return hits > other
    return clopper_pearson(hits, count).low > clopper_pearson(other, count).high


def together(shares: Iterable[Verdict], beside: bool) -> Verdict:
    """Verdict on several shares, and on whether the nulls are behind: fail if one fails or they are not."""
    found = set(shares)
    if "fail" in found or not beside:
        return "fail"
    return "reported" if "reported" in found else "pass"


def undecided(hits: int, count: int, bar: float, *, quick: bool) -> str:
    """A sentence if a share is missed by count and not excluded by its exact 95 % interval. "" otherwise."""
    low, high = clopper_pearson(hits, count)
    if reached(hits, count, bar, quick=quick) or high < bar - ROUNDING:
        return ""
    return (
        f"Undecided: {hits} of {count} is {100.0 * low:.0f} to {100.0 * high:.0f} % with 95 % confidence, which "
        f"neither shows nor excludes {100.0 * bar:g} %."
    )
