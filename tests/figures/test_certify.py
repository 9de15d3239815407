"""How often a certificate is false, and how large the boxes are, over random truths with soft edges and stray failures.

A truth succeeds with probability s(x) (1 - q): s falls from 1 to 0 over a soft edge about an ellipsoid whose centre,
axes and softness are drawn, or about two of them; q up to 7 % is a failure that comes anywhere.
"""

import numpy as np
import pytest
from scipy.stats import qmc

from skillframe.campaign.claims.box import Box
from skillframe.campaign.claims.claim import certified, family, fresh_trials, judge
from skillframe.campaign.claims.procedure import Looked, propose
from skillframe.campaign.claims.question import LOOKS, Question
from skillframe.campaign.statistics import clopper_pearson
from tests.figures.teaching import row

pytestmark = pytest.mark.figures
ALPHA, TRUTHS, SAMPLE = 0.05, 500, 20_000


class Truth:
    """A random success probability over [-1, 1]^d."""

    def __init__(self, rng, dimension):
        lobes = rng.integers(1, 3)
        self.centres = rng.uniform(-0.4, 0.4, (lobes, dimension))
        self.axes = rng.uniform(0.4, 1.2, (lobes, dimension))
        self.softness, self.stray = rng.uniform(0.01, 0.15), rng.choice([0.0, rng.uniform(0.0, 0.07)])

    def __call__(self, points):
        away = np.linalg.norm((points[:, None] - self.centres) / self.axes, axis=2).min(axis=1) - 1.0
        return (1.0 - self.stray) / (1.0 + np.exp(np.clip(away / self.softness, -50.0, 50.0)))


def one(rng, dimension, rate):
    """(whether a claim was made, certified share of the range or 0, true mean in the certified box)."""
    truth = Truth(rng, dimension)
    question = Question(rate=rate, confidence=1.0 - ALPHA, ranges={f"q{i}": (-1.0, 1.0) for i in range(dimension)})
    seen = 2.0 * qmc.Sobol(dimension, scramble=True, rng=rng).random(LOOKS[dimension]) - 1.0
    box = propose(question, Looked(seen, rng.random(len(seen)) < truth(seen)))
    if box is None:
        return False, 0.0, 1.0
    fresh = box.low + (box.high - box.low) * rng.random((fresh_trials(rate, ALPHA), dimension))
    best = certified(judge(family(box), fresh, rng.random(len(fresh)) < truth(fresh), rate, ALPHA))
    if best is None:
        return True, 0.0, 1.0
    inside: Box = best.box
    return (
        True,
        inside.share,
        float(truth(inside.low + (inside.high - inside.low) * rng.random((SAMPLE, dimension))).mean()),
    )


@pytest.mark.parametrize(("dimension", "rate"), [(2, 0.95), (3, 0.95), (2, 0.99)])
def test_no_more_than_one_in_twenty_certificates_is_false(dimension, rate):
    rng = np.random.default_rng([2026_11_23, dimension, round(1000 * rate)])
    ends = [one(rng, dimension, rate) for _ in range(TRUTHS)]
    claimed, given = sum(e[0] for e in ends), [e for e in ends if e[1] > 0.0]
    false = sum(mean < rate for _, _, mean in given)
    low, high = clopper_pearson(false, TRUTHS)
    shares = np.median([share for _, share, _ in given])
    row(
        f"{dimension}-D, {rate}", f"{claimed} claims, {len(given)} certified, {false} false", f"{low:.3f} to {high:.3f}"
    )
    row("", f"median share of the range {shares:.2f}")
    assert false <= ALPHA * TRUTHS
