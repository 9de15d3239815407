"""Force without a force sensor: the crane slides on a plate, friction and mass unlike the model's; parts of the filter.

Twelve seeds; each draws +-20 % friction for every cylinder, +-2 % mass of all bodies, and sensor noise. Scored where
both boom pistons truly go faster than 10 mm/s and the estimate calls itself valid, as a share of the mean true normal
force there. Excitation in air comes first; the estimate is in the control loop all the time.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from skillframe_hydraulics.force.identification import IdentificationSettings
from skillframe_hydraulics.force.momentum import ForceSettings

from tests.crane_press import AIR, DAMPING, DT, LANDED, Press, crane, cylinders, replay
from tests.crane_scores import case, root_mean_square, score, window
from tests.figures.teaching import row
from tests.oracle.augmented import AugmentedForceFilter, AugmentedSettings
from tests.oracle.force_estimator import ForceEstimator, force_filter

pytestmark = pytest.mark.figures

SEEDS, FEW = range(300, 312), range(300, 304)
SECONDS = 31.0
FULL = ForceSettings()
LATE = "with the Kalman filter for white noise, late"
STATIC = "without the momentum: gravity alone"
NOMINAL = "without either (nominal model)"
PARTS = {
    "full": FULL,
    "without the wrench's Kalman filter (L alone)": dataclasses.replace(FULL, force_corner=None),
    LATE: FULL,
    "without weights": dataclasses.replace(FULL, weighted=False),
    "without the payload identified": dataclasses.replace(FULL, identify=IdentificationSettings(load=False)),
    "without friction identified": dataclasses.replace(FULL, identify=IdentificationSettings(friction=False)),
    NOMINAL: dataclasses.replace(FULL, identify=IdentificationSettings(load=False, friction=False)),
    STATIC: FULL,
}


@cache
def pressed(seeds=SEEDS, plate=1e6, damping=DAMPING):
    """Log, and the estimate of the full filter (replayed, the same as in the loop)."""
    log = Press(case(seeds, plate)._replace(damping=damping), seeds).run(SECONDS)
    estimate = replay(log, ForceEstimator(crane(), cylinders(), len(seeds), DT))
    return log, estimate.force, estimate.sigma, estimate.valid


def augmented(log, told):
    """The augmented filter over a log, at the rate of the rows, and the same Kalman filter of the wrench after it."""
    count = log.force.shape[1]
    estimator = ForceEstimator(crane(), cylinders(), count, DT, PARTS[NOMINAL])
    filters = [AugmentedForceFilter(3, AugmentedSettings(told=told)) for _ in range(count)]
    smooth, force, found = force_filter(FULL.feedback_corner, DT, 2), np.zeros((count, 2)), []

    class Watched:
        def __getattr__(self, name):
            return getattr(estimator, name)

        def step(self, measured, at):
            nonlocal force
            estimate, k = estimator.step(measured, at), len(found)
            if k == 0:
                smooth.start(force)
            if k % 10 == 0:
                force = np.array([
                    f.step(at.jacobian[i], estimator.regressors[i], estimator.residual[i], k * DT < AIR)
                    for i, f in enumerate(filters)
                ])  # fmt: skip
            found.append(smooth.step(force))
            return estimate

    replay(log, Watched())
    return np.array(found)


def still(terms):
    """Terms of a machine without momentum."""
    return terms._replace(mass=0.0 * terms.mass, drift=0.0 * terms.drift)


def test_force_while_sliding_is_within_two_and_a_half_percent_rms_and_six_percent_at_most():
    log, force, sigma, valid, *_ = pressed()
    chosen, fast = window(log, valid)
    found = score(log, force, chosen)
    standing = ~valid & (np.arange(len(valid)) * DT > LANDED)[:, None]
    row(
        "crane, force without a sensor, 12 seeds", str(found), f"valid in {100 * chosen.sum() / fast.sum():.0f} % of it"
    )
    row("the same, stiction included", str(score(log, force, fast)))
    row(
        "not valid (reversal, stiction)", f"rms {root_mean_square((force - log.force)[standing]):.0f} N, sigma stated",
        f"{np.median(sigma[standing], axis=0).round()} N",
    )  # fmt: skip
    assert found.rms.max() < 2.5
    assert found.largest.max() < 6.0
    assert np.median(sigma[standing], axis=0).min() > 400.0


def test_the_full_filter_is_the_best_row_in_rms_of_those_with_a_part_left_out():
    log, _, _, valid, *_ = pressed()
    chosen, _ = window(log, valid)
    found = {}
    for name, settings in PARTS.items():
        seen = log._replace(terms=still(log.terms)) if name == STATIC else log
        estimate = replay(seen, ForceEstimator(crane(), cylinders(), len(SEEDS), DT, settings))
        found[name] = score(log, estimate.feedback if name == LATE else estimate.force, chosen)
        row(name, str(found[name]))
    for told in (False, True):
        name = "augmented filter, " + ("told when it is in air" if told else "left to itself")
        found[name] = score(log, augmented(log, told), chosen)
        row(name, str(found[name]))
    best = min(found, key=lambda name: found[name].rms.mean())
    assert best == "full"


def test_on_a_soft_surface_the_estimate_is_as_good_in_newtons():
    """3e4 N/m: a third of the load, so the threshold is 4 %."""
    log, force, _, valid, *_ = pressed(FEW, 3e4)
    found = score(log, force, window(log, valid)[0])
    row("crane, soft surface, 4 seeds", str(found))
    assert found.rms.max() < 4.0


def test_a_lightly_damped_contact_rings_after_reversals_faster_than_the_estimate_follows():
    """D = 2.5e4 N s/m on 1e6 N/m: some 6 Hz, which the corner of 8 Hz of the residual passes late."""
    log, force, _, valid, *_ = pressed(FEW, damping=2.5e4)
    found = score(log, force, window(log, valid)[0])
    row("crane, D = 2.5e4 N s/m, 4 seeds", str(found))
    assert found.rms.max() < 2.5
    assert found.largest.max() < 6.0
