"""A race of skills: one that is decidedly worse runs no more, and the race ends when one is left.

Every `every` trials each two skills that still run are compared on the trials so far by the sequential McNemar test
(`statistics.mcnemar_sequential`, valid at every look). Over the smallest p-value of each pair so far, Holm's method at
`alpha`, over all pairs of skills, whether they still run or not. Of a pair that is decided, the skill with fewer
successes, then and now, is left out. It keeps the trials up to that look, and its interval is the one that is valid at
every look.

The looks follow the rows in the order of their trials, and a trial's draws are fixed by the seed beforehand, so who is
left out when is a function of the rows alone: any workers and any resume end in the same table. Rows of a skill beyond
the look at which it was left out, which happened to run, are dropped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from skillframe.campaign.claims.compare import more_trials
from skillframe.campaign.rows import Row
from skillframe.campaign.spec import RaceKeys
from skillframe.campaign.statistics import correction, holm, mcnemar_sequential


class LeftOut(NamedTuple):
    """Why a skill runs no more.

    Attributes:
        after: how many trials it ran.
        better: the skill that was better.
        only_better: trials that only that one succeeded in.
        only_it: trials that only the one that is left out succeeded in.
        p_value: of "both are equally good", corrected for the number of pairs.
    """

    after: int
    better: str
    only_better: int
    only_it: int
    p_value: float


class Race:
    """Follows the rows of a campaign.

    Attributes:
        left: the skills that were left out, in that order.
        after: the last trial of the results, once one skill is left; None until then.
        minima: the smallest p-value of each pair so far, not corrected.

    Args:
        labels: of the skills.
        trials: the most that each runs.
        keys: how to look.
    """

    def __init__(self, labels: Sequence[str], trials: int, keys: RaceKeys) -> None:
        self._keys, self._labels, self._trials = keys, tuple(labels), trials
        self._rows: dict[str, dict[int, bool]] = {label: {} for label in labels}
        self._counts = dict.fromkeys(combinations(labels, 2), (0, 0))
        self._looked = 0
        self._ahead = dict.fromkeys(self._counts, "")
        self.minima = dict.fromkeys(self._counts, 1.0)
        self.left: dict[str, LeftOut] = {}
        self.after: int | None = None

    def add(self, rows: Iterable[Row]) -> None:
        """Take rows in any order."""
        for row in rows:
            self._rows[row["skill"]][row["trial"]] = row["success"]
        while self.after is None and self._looked < self._trials and self._there(self._next()):
            self._look(self._next())

    @property
    def reach(self) -> dict[str, int]:
        """How many trials each skill runs at most, as far as is known."""
        most = self._trials if self.after is None else self.after + 1
        return {label: self.left[label].after if label in self.left else most for label in self._labels}

    @property
    def kept(self) -> int:
        """How many of the rows so far stay in the table."""
        reach, over = self.reach, self.after is not None
        return sum(reach[name] if over or name in self.left else len(rows) for name, rows in self._rows.items())

    def outcome(self) -> dict[str, Any]:
        """The race as it stands, for summary.json."""
        running = self._running()
        return {
            "alpha": self._keys.alpha,
            "every": self._keys.every,
            "looked_after": self._looked,
            "correction": correction(len(self._counts)),
            "left_out": {label: found._asdict() for label, found in self.left.items()},
            "best": running[0] if len(running) == 1 else None,
            "not_told_apart": running if len(running) > 1 else [],
            "more": self._more(),
        }

    def _running(self) -> list[str]:
        return [label for label in self._labels if label not in self.left]

    def _next(self) -> int:
        return min(self._looked + self._keys.every, self._trials)

    def _there(self, end: int) -> bool:
        """Whether every skill that runs has all trials before `end`."""
        return all(t in self._rows[label] for label in self._running() for t in range(self._looked, end))

    def _look(self, end: int) -> None:
        fresh = range(self._looked, end)
        self._looked = end
        open_pairs = list(combinations(self._running(), 2))
        for first, second in open_pairs:
            a, b = self._rows[first], self._rows[second]
            won, lost = self._counts[first, second]
            counts = won + sum(a[t] and not b[t] for t in fresh), lost + sum(b[t] and not a[t] for t in fresh)
            self._counts[first, second] = counts
            if (p_value := mcnemar_sequential(*counts)) < self.minima[first, second]:
                self.minima[first, second] = p_value
                self._ahead[first, second] = first if counts[0] > counts[1] else second
        self._decide(dict(zip(self.minima, holm(list(self.minima.values())), strict=True)), open_pairs)
        if len(self._running()) == 1:
            self.after = end - 1

    def _decide(self, corrected: Mapping[tuple[str, str], float], pairs: Iterable[tuple[str, str]]) -> None:
        """Leave out who is worse. Successes on the same trials put skills in an order, so one of them always stays."""
        for pair in sorted(pairs, key=corrected.__getitem__):
            (first, second), (won, lost) = pair, self._counts[pair]
            better, worse = (first, second) if won > lost else (second, first)
            if corrected[pair] <= self._keys.alpha and won != lost and better == self._ahead[pair]:
                counts = max(won, lost), min(won, lost)
                self.left.setdefault(worse, LeftOut(self._looked, better, *counts, corrected[pair]))

    def _more(self) -> int | None:
        """About how many trials more would decide between those that run, if the rates stay as they are, or None."""
        running = self._running()
        if len(running) == 1 or not self._looked:
            return None
        leader = max(running, key=lambda label: sum(self._rows[label][t] for t in range(self._looked)))
        pairs = [pair for pair in self._counts if leader in pair and set(pair) <= set(running)]
        undecided = sum(p > self._keys.alpha for p in holm(list(self.minima.values())))
        level = self._keys.alpha / max(1, undecided)
        needed = [more_trials(*self._counts[pair], self._looked, level) for pair in pairs]
        known = [n for n in needed if n is not None]
        return max(known) if len(known) == len(needed) else None


def told(label: str, found: Mapping[str, Any], trials: int, corrected: str) -> str:
    """Why a skill was left out, as a sentence, from summary.json."""
    counts = f"only it succeeded in {found['only_better']} of them, only {label} in {found['only_it']}"
    how = f", {corrected}" if corrected.startswith("Holm") else ""
    return (
        f"{label} was left out after {found['after']} of {trials} trials, because {found['better']} is better: "
        f"{counts} (p = {found['p_value']:.2g}{how})"
    )
