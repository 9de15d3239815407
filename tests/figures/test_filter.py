"""Direction learned from teleoperated demonstrations with and without the Kalman filter, on the same recordings.

The learner averages the wrench over intervals of 2 mm, so a filter can neither help nor harm much; what it does to one
pair of demonstrations is chance. Whether it costs anything is therefore asked of the differences pair by pair. Their
median has an interval that supposes no distribution: the number of n differences below it is binomial(n, 1/2), so that
the k-th smallest and the k-th largest hold it with 1 - 2 P(B < k).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom
from skillframe_recordings.conditioning.offline import filter_wrench, smooth

from skillframe.frames import Float
from skillframe.world.quantities import SensorSettings
from tests.figures.teaching import DOWN, angle_deg, phases, row, taught

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]

PAIRS = 60
LOSS_DEG = 0.15  # a tenth of the median error: a loss that nobody would see in a run


def median_interval(values: Float) -> tuple[float, float]:
    """An interval that holds the median with at least 95 %."""
    k = int(binom.ppf(0.025, len(values), 0.5))
    ordered = np.sort(values)
    return float(ordered[k - 1]), float(ordered[len(values) - k])


@pytest.mark.parametrize("force_noise", [0.3, 1.0, 2.0])
def test_the_filter_keeps_directions_within_ten_degrees_and_costs_nothing(force_noise):
    """0.3 N is a wrist sensor on a moving robot, 1 to 2 N what a robot's own estimate shows (0.4 to 2.3 N on a UR)."""
    sensors = SensorSettings(force_noise=force_noise, torque_noise=force_noise / 15.0)
    groups, rejected = taught(
        "peg_in_hole", {}, 8.0, pairs=PAIRS, sensors=sensors, kind="teleoperation", delay_s=0.05, scale=2.0
    )  # fmt: skip
    table = {}
    for name, condition in (("raw", lambda d: d), ("filter", filter_wrench), ("smoother", smooth)):
        found = phases([[condition(d) for d in group] for group in groups])
        directions = [p["translation"]["desired_direction"] for p in found]
        errors = np.array([180.0 if d is None else angle_deg(d, DOWN) for d in directions])
        table[name] = errors
        low, high = median_interval(errors - table["raw"])
        row(
            f"teleoperated peg, {force_noise:g} N, {name}", f"rejected {rejected}",
            f"within 10 deg {(errors <= 10).sum()}/{len(errors)}",
            f"median {np.median(errors):.2f}, first 20 {np.median(errors[:20]):.2f}, at most {errors.max():.1f} deg",
            f"less raw, pair by pair: {np.median(errors - table['raw']):+.3f} ({low:+.3f} to {high:+.3f}) deg",
        )  # fmt: skip
    for name in ("filter", "smoother"):
        low, high = median_interval(table[name] - table["raw"])
        assert (table[name] <= 10.0).sum() >= 0.95 * PAIRS
        assert low <= 0.0  # no worse, as far as 60 pairs can tell
        assert high <= LOSS_DEG  # and they can tell a loss of this much
