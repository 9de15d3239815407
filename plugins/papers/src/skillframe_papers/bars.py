"""Comparison of a share with its threshold: by the count in a full run, by its interval in a quick one.

A quick run has few trials, so the upper end of the exact two-sided 95 % interval (Clopper and Pearson 1934) must reach
the threshold. A full run of few groups is undecided where its interval contains a missed threshold. Counts in text have
their intervals behind them: "34 of 36 (81 to 99 %)".
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from skillframe.campaign import clopper_pearson
from skillframe.extend import Verdict

ROUNDING = 1e-9
SAID = (
    "Brackets after a count hold its exact 95 % interval (Clopper-Pearson) for independent trials. Trials of one "
    "policy or of one set of demonstrations are not independent, so that their interval is too narrow."
)
_COUNT = re.compile(r"(?<![.\d])\b(\d+) of (\d+)\b(?! \(\d+ to \d+ %\)| is \d+ to \d+ %)")


def reached(hits: int, count: int, bar: float, *, quick: bool) -> bool:
    """Whether `hits` of `count` reach a share."""
    share = clopper_pearson(hits, count).high if quick else hits / count
    return share >= bar - ROUNDING


def judged(hits: int, count: int, bar: float, *, quick: bool) -> Verdict:
    """Verdict on a share: "pass" if it is reached, "fail" if the counts exclude it, else "reported"."""
    if reached(hits, count, bar, quick=quick):
        return "pass"
    return "reported" if undecided(hits, count, bar, quick=quick) else "fail"


def counted(hits: int, count: int) -> str:
    """A count with its exact 95 % interval: "9 of 12 (43 to 95 %)"."""
    low, high = clopper_pearson(hits, count)
    return f"{hits} of {count} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"


def ahead(hits: int, other: int, count: int, *, quick: bool, others: int | None = None) -> bool:
    """Whether one count exceeds another, by disjoint 95 % intervals, or by shares if quick."""
    of = count if others is None else others
    if quick:
        return hits * of > other * count
    return clopper_pearson(hits, count).low > clopper_pearson(other, of).high


def level(hits: int, count: int, nulls: Mapping[str, tuple[int, int]], *, quick: bool) -> list[str]:
    """Names of the nulls, each with hits and trials, that a count is not ahead of."""
    return [name for name, (other, of) in nulls.items() if not ahead(hits, other, count, quick=quick, others=of)]


def no_better(names: Iterable[str]) -> str:
    """Words for nulls that a result is not ahead of, or ""."""
    told = ", ".join(names)
    return f"; no better than {told}" if told else ""


def together(shares: Iterable[Verdict], beside: bool) -> Verdict:
    """Verdict on several shares, failing if the nulls are not behind."""
    found = set(shares)
    if "fail" in found or not beside:
        return "fail"
    return "reported" if "reported" in found else "pass"


def undecided(hits: int, count: int, bar: float, *, quick: bool) -> str:
    """A sentence if a share is missed but not excluded by its 95 % interval, else ""."""
    low, high = clopper_pearson(hits, count)
    if reached(hits, count, bar, quick=quick) or high < bar - ROUNDING:
        return ""
    return (
        f"Undecided: {hits} of {count} is {100.0 * low:.0f} to {100.0 * high:.0f} % with 95 % confidence, which "
        f"neither shows nor excludes {100.0 * bar:g} %."
    )


def with_intervals(text: object) -> str:
    """A text with intervals added to counts "N of M" that have none."""

    def told(found: re.Match[str]) -> str:
        hits, count = int(found[1]), int(found[2])
        return counted(hits, count) if 0 <= hits <= count and count else found[0]

    return _COUNT.sub(told, str(text))
