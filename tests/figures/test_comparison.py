"""How often `skillframe compare` is wrong, and how many trials it needs, over simulated campaigns."""

from itertools import combinations

import numpy as np
import pytest
from skillframe_certify.compare import Evidence, holm_of_minima

from skillframe.campaign.race import Race
from skillframe.campaign.spec import RaceKeys
from skillframe.campaign.statistics import clopper_pearson
from tests.figures.teaching import row

pytestmark = pytest.mark.figures
ALPHA = 0.05


def outcomes(rng, trials, rates):
    """Policies that meet the same draws: a common part of the luck and one's own, correlation 0.36 before the cut."""
    from scipy.stats import norm

    return (0.6 * rng.standard_normal((trials, 1)) + 0.8 * rng.standard_normal((trials, len(rates)))) < norm.ppf(rates)


def evidence(won):
    count, policies = won.shape
    signed, rows = won.astype(np.int64), policies * np.arange(1, count + 1)
    return [Evidence(rows, signed[:, i] - signed[:, j], count) for i, j in combinations(range(policies), 2)]


def draws_to_decide(p_values):
    """Looks, one a draw, until the last pair is decided."""
    decided = np.all(p_values <= ALPHA, axis=1)
    return 1 + int(np.argmax(decided)) if decided.any() else len(decided)


@pytest.mark.parametrize("policies", [2, 3, 5])
def test_no_more_than_one_in_twenty_of_1000_campaigns_of_equal_policies_decides_anything(policies):
    rng = np.random.default_rng(2026_11_23)
    false = 0
    for _ in range(1000):
        pairs = evidence(outcomes(rng, 800, [0.7] * policies))
        false += bool(np.any(holm_of_minima(pairs, 800 * policies)[1] <= ALPHA))
    row(f"{policies} equal policies, 800 looks", f"{false} of 1000")
    assert false <= 50


@pytest.mark.parametrize("rates", [(0.6, 0.75, 0.9), (0.6, 0.7, 0.8, 0.9), (0.5, 0.6, 0.7, 0.8, 0.9)])
def test_holms_method_needs_fewer_draws_than_bonferronis(rates):
    rng = np.random.default_rng(7)
    needed = []
    for _ in range(200):
        pairs = evidence(outcomes(rng, 1500, rates))
        rows = 1500 * len(rates)
        alone = np.stack([holm_of_minima([pair], rows)[1][:, 0] for pair in pairs], axis=1)
        needed.append((draws_to_decide(holm_of_minima(pairs, rows)[1]), draws_to_decide(len(pairs) * alone)))
    by_holm, by_bonferroni = np.median(needed, axis=0)
    row(", ".join(map(str, rates)), f"Holm {by_holm:g}, Bonferroni {by_bonferroni:g}")
    if len(rates) == 4:
        assert by_holm <= 0.85 * by_bonferroni


def race_of(won):
    labels = [str(i) for i in range(won.shape[1])]
    race = Race(labels, len(won), RaceKeys())
    race.add(
        {"trial": t, "skill": s, "success": bool(won[t, i])} for t in range(len(won)) for i, s in enumerate(labels)
    )
    return race


def truth(rng, policies, kind):
    """Success rates: all equal, the two best equal, or all drawn by themselves."""
    rates = rng.uniform(0.5, 0.98, policies)
    if kind == "all equal":
        return np.full(policies, rates[0])
    return np.where(np.arange(policies) == np.argmin(rates), rates.max(), rates) if kind == "two best" else rates


@pytest.mark.parametrize("kind", ["all equal", "two best", "all differ"])
@pytest.mark.parametrize("policies", [2, 3, 5])
def test_no_more_than_one_in_twenty_of_1000_races_leaves_out_one_of_the_best(policies, kind):
    rng = np.random.default_rng(2026_11_23 + policies)
    lost = ended = ran = 0
    for _ in range(1000):
        rates = truth(rng, policies, kind)
        race = race_of(outcomes(rng, 400, rates))
        lost += any(rates[int(label)] == rates.max() for label in race.left)
        ended += race.after is not None
        ran += sum(race.reach.values())
    low, high = clopper_pearson(lost, 1000)
    share = f"{100 * ran / (400_000 * policies):.0f} % of the runs"
    row(f"{policies}, {kind}", f"{lost} of 1000 ({100 * low:.1f} to {100 * high:.1f} %), {ended} ended early, {share}")
    assert lost <= 50
