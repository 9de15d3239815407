"""Reproduction into the corner on pallets and styrofoam, from three starts: how often, how far off, how hard."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import binomtest

from tests.crane_corner import PEAK, SKILL, STARTS, Corner, into_the_corner
from tests.figures.teaching import row

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
TRIALS = {"wood": 54, "styrofoam": 36}


def report(surface: str, corner: Corner) -> None:
    result, wins = corner.result, int(corner.good.sum())
    low, high = binomtest(wins, len(corner.good)).proportion_ci(method="exact")
    row(surface, f"{wins}/{len(corner.good)}", f"95 % {low:.3f} .. {high:.3f}")
    for start, offset in enumerate(STARTS):
        here = corner.start == start
        error, peak = 1e3 * result.final_error_m[here], result.peak_force_n[here]
        row(
            "", f"start {offset}: {corner.good[here].sum()}/{here.sum()}",
            f"error median {np.median(error):.1f}, largest {error.max():.1f} mm",
            f"peak median {np.median(peak):.0f}, largest {peak.max():.0f} N",
            f"{np.median(result.duration_s[here]):.1f} s",
        )  # fmt: skip
    for i in np.flatnonzero(~corner.good):
        row("", f"trial {i}: {result.failure[i] or f'peak {result.peak_force_n[i]:.0f} N'}")


@pytest.mark.parametrize("surface", TRIALS)
def test_the_crane_ends_in_the_corner_from_three_starts_whatever_its_friction_and_mass(surface: str) -> None:
    corner = into_the_corner(surface, TRIALS[surface], seed=41)
    report(surface, corner)
    assert np.all(corner.result.peak_force_n[corner.good] < PEAK)
    # 53 of 54, or 36 of 36: the exact two-sided 95 % interval then lies above 0.9
    assert corner.good.sum() >= {54: 53, 36: 36}[len(corner.good)]


@pytest.mark.parametrize("surface", TRIALS)
def test_a_crane_that_goes_on_pressing_into_the_corner_comes_to_rest(surface: str) -> None:
    """Six machines, 22 s, the last 8 of them. 200 N is what stiction may be told from in the best case."""
    document = json.loads(SKILL.read_text(encoding="utf-8"))
    document["phases"][0]["stop"]["stall_s"] = 100.0
    traces = into_the_corner(surface, 6, 41, document, trace_hz=50.0, seconds=22.0).result.traces
    assert traces is not None
    ripple = [np.hypot(*trace.wrench_true[trace.time > 14.0][:, [0, 2]].std(axis=0)) for trace in traces]
    row(f"{surface}, pressing on", f"ripple {min(ripple):.0f} .. {max(ripple):.0f} N, median {np.median(ripple):.0f} N")
    assert max(ripple) < {"wood": 200.0, "styrofoam": 400.0}[surface]
