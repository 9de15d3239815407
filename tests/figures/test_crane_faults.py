"""Every fault of the crane, in every cylinder, at ten times, twenty runs each; cranes without a fault; an excavator."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from skillframe_papers.rows import crane_runs

from tests.figures.crane_faults import (
    DEPTH,
    KINDS,
    LIMIT,
    Struck,
    at_random,
    conditions,
    excavator,
    fine,
    struck,
    verdict,
)
from tests.figures.teaching import row
from tests.fmu_cache import own_cache  # noqa: F401

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins, pytest.mark.timeout(3600)]
TIMES = (-6.0, -4.1, -2.003, 0.3, 1.2, 2.507, 3.9, 5.2, 6.35, 7.4)
"""In the swing, on the way down, at the touch, pressing, and sliding; some between two looks of the watch."""
RUNS = 20
SOUND, PRESSED_S = 60, 14.0
DRAWN = 1000
"""Of the excavator, 16 s of simulation each unless a fault ends them before."""


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


def test_faults_of_an_excavator_at_any_time_end_by_their_own_reason_or_stay_within_limits():
    """With a slew, twin cylinders and a bucket linkage. Trials that ring in the swing end before anything breaks."""
    trials = list(at_random(excavator(), DRAWN, seed=4200))
    for kind in KINDS:
        show([one for one in trials if one.kind == kind])
    for one in trials:
        assert fine(one), one


def left_alone(seed: int, depth: float, oil: tuple[float, float]) -> None:
    where = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=True)
    rng, drawn = np.random.default_rng(seed + 1000), conditions(SOUND, seed)
    drawn["robot.mass_scale"] = rng.uniform(0.9, 1.1, SOUND)
    drawn["actuator.bulk_scale"] = rng.uniform(*oil, SOUND)
    path = crane_runs.press_and_slide(depth)
    result = crane_runs.run(path, crane_runs.PRESSING, where, drawn, seconds=PRESSED_S, seed=seed)
    ended = [str(reason) for reason, by in zip(result.reason, result.ended_by, strict=True) if by == "watchdog"]
    name = f"cranes without a fault, {depth:g} m, oil of {oil[0]:g} to {oil[1]:g}, seed {seed}"
    row(name, dict(Counter(map(str, result.ended_by))), *ended[:3])
    assert not {"sensor", "watchdog"} & set(result.ended_by)


@pytest.mark.parametrize("depth", [DEPTH, 0.12, 0.16])
@pytest.mark.parametrize("seed", [8, 9])
def test_the_watch_leaves_cranes_without_a_fault_alone(seed, depth):
    """Loads from none to the rating, delays to 10 ms, frictions by 30 %, supplies from 150 to 210 bar, masses by 10 %.

    Pressed 12 cm and more into the plate, a tilt that is weak or light pulls as hard as it can, and stands.
    """
    left_alone(seed, depth, (1.0, 1.0))


@pytest.mark.parametrize("depth", [0.12, 0.16])
@pytest.mark.parametrize("seed", [18, 19, 28, 29])
def test_the_watch_leaves_cranes_with_other_oil_alone(seed, depth):
    """At 7 cm some of these hop over the plate, which the watch is to end."""
    left_alone(seed, depth, (0.7, 1.3))
