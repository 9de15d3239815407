"""Is a share reached? By counting; in a quick run, whose trials are few, only what the counts exclude is not.

Quick: the exact two-sided 95 % interval of the share (Clopper and Pearson 1934) must reach the bar. Our choice, because
a bar that is met by 54 of 60 is missed by 9 of 10 one time in three.
"""

from __future__ import annotations

from skillframe.campaign.statistics import clopper_pearson

ROUNDING = 1e-9


def reached(hits: int, count: int, bar: float, *, quick: bool) -> bool:
    """Whether `hits` of `count` reach a share."""
    share = clopper_pearson(hits, count).high if quick else hits / count
    return share >= bar - ROUNDING
