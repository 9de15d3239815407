"""Stopping early, so that the answer does not depend on which worker was fast.

The rule looks at the trials in their order: it stops at the first trial t such that, over trials 0 ... t, every skill's
confidence sequence (`statistics.confidence_sequence`, valid at every look) is as narrow as asked. Trials beyond t that
happened to run are left out of the results, so any number of workers and any resume end in the same table. Draws must
not depend on their order for that: grid and values axes are refused by `spec`.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.campaign.rows import Row
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import confidence_sequence


class StopRule:
    """Follows the rows of a campaign.

    Attributes:
        after: the last trial of the results, once the rule has decided; None until then.
    """

    def __init__(self, spec: CampaignSpec) -> None:
        self._width, self._labels = spec.stop.interval_width, spec.labels
        self._waiting: dict[int, dict[str, bool]] = {}
        self._successes = dict.fromkeys(self._labels, 0)
        self._next = 0
        self.after: int | None = None

    def add(self, rows: Iterable[Row]) -> None:
        """Take rows in any order."""
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

    def _widest(self) -> float:
        return max(confidence_sequence(successes, self._next).width for successes in self._successes.values())
