"""Differences of clocks found, and false alarms, on recordings shifted by a random time (`-s` prints the table)."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_recordings.lateness import lateness

from plugins.recordings.tests.test_lateness import late, recorded
from skillframe.demonstration.record import Demonstration
from tests.figures.recorded import recordings

pytestmark = pytest.mark.figures
SEEDS = 20
CLOSE = 0.03
"""Seconds by which an estimate may be off to count as a hit: one and a half samples of those that are compared."""


def real() -> dict[str, Demonstration]:
    return {name: d for name, d in recordings().items() if not name.startswith("peel")}


def test_clocks_that_differ_are_found_and_others_raise_no_alarm() -> None:
    rows = {}
    for name, fixed in {"simulated": None, **real()}.items():
        hits, wrong, silent, alarms = 0, 0, 0, 0
        for seed in range(SEEDS):
            d = recorded(seed) if fixed is None else fixed
            rng = np.random.default_rng(seed)
            seconds = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.5)
            found, clean = lateness(late(d, seconds)), lateness(d)
            told = found is not None and found.counts
            hits += told and abs(found.seconds - seconds) <= CLOSE
            wrong += told and abs(found.seconds - seconds) > CLOSE
            silent += not told
            alarms += clean is not None and clean.counts
        rows[name] = (hits, wrong, silent, alarms)
        print(f"{name:<10} found {hits:2d}, wrong {wrong}, silent {silent:2d} of {SEEDS}; false alarms {alarms}")
    assert rows["simulated"][0] == SEEDS
    assert all(wrong == 0 and alarms == 0 for _, wrong, _, alarms in rows.values())
    assert all(row[0] >= SEEDS - 2 for name, row in rows.items() if name.startswith("snap"))
