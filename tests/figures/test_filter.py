"""Direction learned from teleoperated demonstrations with and without the Kalman filter, 20 seeds."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe.conditioning.offline import filter_wrench, smooth

from tests.figures.teaching import DOWN, angle_deg, phases, row, taught

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]


def test_the_filter_keeps_directions_within_ten_degrees_and_costs_nothing():
    groups, rejected = taught(
        "peg_in_hole", {}, 8.0, kind="teleoperation", delay_s=0.05, scale=2.0,
    )  # fmt: skip
    table = {}
    for name, condition in (("raw", lambda d: d), ("filter", filter_wrench), ("smoother", smooth)):
        found = phases([[condition(d) for d in group] for group in groups])
        directions = [p["translation"]["desired_direction"] for p in found]
        errors = np.array([180.0 if d is None else angle_deg(d, DOWN) for d in directions])
        table[name] = errors
        row(
            f"teleoperated peg, {name}", f"rejected {rejected}", f"within 10 deg {(errors <= 10).sum()}/{len(errors)}",
            f"median {np.median(errors):.2f}, at most {errors.max():.1f} deg",
        )  # fmt: skip
    for name in ("filter", "smoother"):
        assert (table[name] <= 10.0).sum() >= 19
        # "no worse": the two medians differ by less than the direction grid's own 0.3 degrees
        assert np.median(table[name]) <= np.median(table["raw"]) + 0.3
