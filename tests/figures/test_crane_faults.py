"""Every fault of the crane, in every cylinder, at ten times, twenty runs each; and cranes without a fault."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from skillframe_papers.rows import crane_runs

from tests.figures.crane_faults import DEPTH, KINDS, LIMIT, SECONDS, Struck, conditions, fine, struck, verdict
from tests.figures.teaching import row
from tests.fmu_cache import own_cache  # noqa: F401

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins, pytest.mark.timeout(3600)]
TIMES = (-6.0, -4.1, -2.003, 0.3, 1.2, 2.507, 3.9, 5.2, 6.35, 7.4)
"""In the swing, on the way down, at the touch, pressing, and sliding; some between two looks of the watch."""
RUNS = 20
SOUND = 60


def show(trials: list[Struck]) -> None:
    kind, codes = trials[0].kind, Counter(one.ended for one in trials)
    after = np.array([one.after for one in trials if one.ended in ("sensor", "watchdog")])
    last = f"to stop {np.median(after):.3f} s, {after.max():.3f} at most" if len(after) else "never stopped"
    rule, force = dict(Counter(map(verdict, trials))), max(one.force for one in trials)
    row(kind, rule, dict(codes), last, f"largest true force {force:.0f} N")


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_ends_its_trial_within_a_fifth_of_a_second_by_its_own_reason_or_stays_within_limits(kind):
    trials = [one for c in range(3) for one in struck([kind], [c], TIMES, RUNS, seed=100 + c)]
    show(trials)
    for one in trials:
        assert fine(one), one
        assert not (one.success and one.force > LIMIT), one


def test_the_watch_leaves_cranes_without_a_fault_alone():
    """Loads from none to the rating, delays to 10 ms, frictions by 30 %, supplies from 150 to 210 bar."""
    where = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=True)
    path = crane_runs.press_and_slide(DEPTH)
    drawn = conditions(SOUND, 7)
    result = crane_runs.run(path, crane_runs.PRESSING, where, drawn, seconds=SECONDS, seed=7)
    row("cranes without a fault", dict(Counter(result.ended_by)))
    assert not {"sensor", "watchdog"} & set(result.ended_by)
