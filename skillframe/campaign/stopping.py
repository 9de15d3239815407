"""Stopping early, so that the answer does not depend on which worker was fast.

The rule looks at the trials in their order: it stops at the first trial t such that, over trials 0 ... t, every skill's
confidence sequence (`statistics.confidence_sequence`, valid at every look) is as narrow as asked. Trials beyond t that
happened to run are left out of the results, so any number of workers and any resume end in the same table. Draws must
not depend on their order for that: grid and values axes are refused by `spec`. A race (`race`) ends by its own rule.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.campaign.race import Race
from skillframe.campaign.rows import Row
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import confidence_sequence


class StopRule:
    """Follows the rows of a campaign.

    Attributes:
        after: the last trial of the results, once the rule has decided; None until then.
        race: the race, where the campaign is one.
    """

    def __init__(self, spec: CampaignSpec) -> None:
        self.race = Race(spec.labels, spec.trials, spec.race) if spec.race else None
        self._planned = spec.trials * len(spec.skills)
        self._width, self._labels = spec.stop.interval_width, spec.labels
        self._waiting: dict[int, dict[str, bool]] = {}
        self._successes = dict.fromkeys(self._labels, 0)
        self._next = 0
        self.after: int | None = None

    def add(self, rows: Iterable[Row]) -> None:
        """Take rows in any order."""
        if self.race is not None:
            self.race.add(rows)
            self.after = self.race.after
        if self._width is None:
            return
        for row in rows:
            self._waiting.setdefault(row["trial"], {})[row["skill"]] = row["success"]
        while self.after is None and len(self._waiting.get(self._next, ())) == len(self._labels):
            for label, success in self._waiting.pop(self._next).items():
                self._successes[label] += success
            self._next += 1
            if self._widest() <= self._width:
                self.after = self._next - 1

    @property
    def left(self) -> dict[str, int]:
        """How many trials the skills ran that were left out."""
        return {} if self.race is None else {label: found.after for label, found in self.race.left.items()}

    @property
    def planned(self) -> int:
        """How many rows the table will have, as far as is known."""
        return self._planned if self.race is None else sum(self.race.reach.values())

    def total(self, done: int) -> int:
        """How many rows there will be, from how many there are: those planned, and those that a race has dropped."""
        return self._planned if self.race is None else self.planned + done - self.race.kept

    def wants(self, label: str, trial: int) -> bool:
        """Whether a trial of a skill is still of use."""
        return self.race is None or trial < self.race.reach[label]

    def _widest(self) -> float:
        return max(confidence_sequence(successes, self._next).width for successes in self._successes.values())
