"""Whether a campaign met what was required of it: pass, fail or undecided.

Required is a success probability of at least p, `[expect] rate`. With the rate's 95 % interval [low, high] the rule is
(ours)

    pass        low >= p
    fail        high < p
    undecided   otherwise, and wherever there is no interval to go by

There is none to go by where nothing was required, where the campaign has not ended, where its design allows no interval
(`validity`), or where the table was changed after the campaign had written it. The exit code of `campaign run` goes by
the rate itself, as it always did: it is 0 for some campaigns that are undecided, and for all that pass. A campaign file
with `[expect] by = "interval"` makes it 0 for those that pass, and for no other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from skillframe.campaign.statistics import Interval

Word = Literal["pass", "fail", "undecided"]
TAIL = 0.025
"""Of the two-sided 95 % interval."""


class Verdict(NamedTuple):
    """What may be said, and why.

    Attributes:
        word: "pass", "fail" or "undecided".
        why: the rest of a sentence that begins with the word.
    """

    word: Word
    why: str


def verdict_of(required: float | None, interval: Interval | None, *, complete: bool, obstacle: str = "") -> Verdict:
    """The verdict by the rule above.

    Args:
        required: lowest acceptable success probability; None if nothing was required.
        interval: 95 % interval of the rate, or None where there is none.
        complete: all trials ran, or the campaign stopped early as asked.
        obstacle: why nothing can be concluded from the table, whatever it says; "" where it can.
    """
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
    """What it would take, where not one trial has failed."""
    if required >= 1.0:
        return "; no number of trials shows that nothing ever fails"
    if interval.high < 1.0 or required <= 0.0:
        return ""
    return f"; {trials_without_failure(required)} trials without a failure would show it"


def trials_without_failure(required: float) -> int:
    """Smallest n whose n successes put the exact interval's lower bound, TAIL^(1/n), at or above a rate in (0, 1)."""
    return math.ceil(math.log(TAIL) / math.log(required))


def judged(required: float | None, figures: Mapping[str, Any], *, complete: bool) -> Verdict:
    """The verdict on a skill by its figures in summary.json."""
    bounds = figures["interval_95"]
    return verdict_of(required, None if bounds is None else Interval(*bounds), complete=complete)
