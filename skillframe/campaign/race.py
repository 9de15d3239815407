"""A race of skills: skills that are significantly worse stop, and the race ends when one is left.

After every `every` trials, each pair of running skills is compared by the sequential McNemar test
(`statistics.mcnemar_sequential`, valid at every look), and Holm's method at `alpha` corrects the smallest p-value of
each pair so far, over all pairs. Of a decided pair, the skill with fewer successes, both then and now, is left out; it
keeps its trials up to that look.

Looks follow the order of the trials, whose samples the seed fixes, so the result depends on the rows alone. Rows of a
skill beyond the look that left it out are dropped.

Early stopping whose result does not depend on the order in which workers finish.

The rule stops at the first trial t such that, over trials 0 ... t, every skill's confidence sequence
(`statistics.confidence_sequence`) is narrow enough; refused starts do not count, and later trials are dropped. A race
(`race`) ends by its own rule.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from skillframe.campaign.rows import Row, is_trial
from skillframe.campaign.spec import CampaignSpec, RaceKeys
from skillframe.campaign.statistics import confidence_sequence, correction, holm, mcnemar_sequential, more_trials


class LeftOut(NamedTuple):
    """Why a skill was left out.

    Attributes:
        after: trials that it ran.
        better: the skill that was better.
        only_better, only_it: trials in which only that one or only this one succeeded.
        p_value: of equally good skills, corrected for the number of pairs.
    """

    after: int
    better: str
    only_better: int
    only_it: int
    p_value: float


class Race:
    """Follows the rows of a campaign.

    Attributes:
        left: the skills that were left out, in order.
        after: the last trial of the results once one skill is left, otherwise None.
        minima: the smallest uncorrected p-value of each pair so far.
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
        """Add rows in any order."""
        for row in rows:
            self._rows[row["skill"]][row["trial"]] = row["success"]
        while self.after is None and self._looked < self._trials:
            end = min(self._looked + self._keys.every, self._trials)
            fresh = range(self._looked, end)
            if not all(t in self._rows[label] for label in self._running() for t in fresh):
                break
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
            corrected = dict(zip(self.minima, holm(list(self.minima.values())), strict=True))
            for pair in sorted(open_pairs, key=corrected.__getitem__):  # success counts order them, so one remains
                (first, second), (won, lost) = pair, self._counts[pair]
                better, worse = (first, second) if won > lost else (second, first)
                if corrected[pair] <= self._keys.alpha and won != lost and better == self._ahead[pair]:
                    counts = max(won, lost), min(won, lost)
                    self.left.setdefault(worse, LeftOut(self._looked, better, *counts, corrected[pair]))
            if len(self._running()) == 1:
                self.after = end - 1

    @property
    def reach(self) -> dict[str, int]:
        """Trials that each skill runs at most, as far as known."""
        most = self._trials if self.after is None else self.after + 1
        return {label: self.left[label].after if label in self.left else most for label in self._labels}

    @property
    def kept(self) -> int:
        """Number of present rows that stay in the table."""
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

    def _more(self) -> int | None:
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
    """Sentence on why a skill was left out, from summary.json."""
    counts = f"only it succeeded in {found['only_better']} of them, only {label} in {found['only_it']}"
    how = f", {corrected}" if corrected.startswith("Holm") else ""
    return (
        f"{label} was left out after {found['after']} of {trials} trials, because {found['better']} is better: "
        f"{counts} (p = {found['p_value']:.2g}{how})"
    )


class StopRule:
    """Follows the rows of a campaign.

    Attributes:
        after: the last trial of the results, once decided.
        race: the race, if the campaign is one.
    """

    def __init__(self, spec: CampaignSpec) -> None:
        self.race = Race(spec.labels, spec.trials, spec.race) if spec.race else None
        self._planned = spec.trials * len(spec.skills)
        self._width, self._labels = spec.stop.interval_width, spec.labels
        self._waiting: dict[int, dict[str, bool | None]] = {}
        self._counts = {label: Counter[bool | None]() for label in self._labels}
        self._next = 0
        self.after: int | None = None

    def add(self, rows: Iterable[Row]) -> None:
        """Add rows in any order."""
        if self.race is not None:
            self.race.add(rows)
            self.after = self.race.after
        if self._width is None:
            return
        for row in rows:
            self._waiting.setdefault(row["trial"], {})[row["skill"]] = row["success"] if is_trial(row) else None
        while self.after is None and len(self._waiting.get(self._next, ())) == len(self._labels):
            for label, success in self._waiting.pop(self._next).items():
                self._counts[label][success] += 1
            self._next += 1
            ended = ((count[True], count[True] + count[False]) for count in self._counts.values())
            if max(confidence_sequence(successes, trials).width for successes, trials in ended) <= self._width:
                self.after = self._next - 1

    @property
    def left(self) -> dict[str, int]:
        """Trials that each left-out skill ran."""
        return {} if self.race is None else {label: found.after for label, found in self.race.left.items()}

    @property
    def planned(self) -> int:
        """Number of rows of the final table, as far as known."""
        return self._planned if self.race is None else sum(self.race.reach.values())

    def total(self, done: int) -> int:
        """Number of rows at the end: those planned, and those that a race has dropped."""
        return self._planned if self.race is None else self.planned + done - self.race.kept

    def wants(self, label: str, trial: int) -> bool:
        """Whether a trial of a skill is still needed."""
        return self.race is None or trial < self.race.reach[label]
