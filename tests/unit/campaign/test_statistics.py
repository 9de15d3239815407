import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from skillframe.campaign.statistics import (
    clopper_pearson,
    confidence_sequence,
    correction,
    holm,
    log_mixture,
    mcnemar,
    mcnemar_sequential,
)

COUNTS = st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(counts=COUNTS, alpha=st.floats(0.001, 0.3))
def test_clopper_pearson_puts_half_of_alpha_beyond_each_bound(counts, alpha):
    s, n = counts
    low, high = clopper_pearson(s, n, alpha)
    if s:
        assert binom.sf(s - 1, n, low) == pytest.approx(alpha / 2, rel=1e-6)  # root finding inside beta.ppf
    if s < n:
        assert binom.cdf(s, n, high) == pytest.approx(alpha / 2, rel=1e-6)
    assert 0.0 <= low <= s / n <= high <= 1.0


def test_clopper_pearson_gives_the_known_numbers():
    assert clopper_pearson(0, 10).high == pytest.approx(1 - 0.025**0.1, rel=1e-12)
    assert clopper_pearson(53, 54).low > 0.9  # the numbers that a threshold of 0.9 asks for
    assert clopper_pearson(36, 36).low > 0.9
    assert clopper_pearson(35, 35).low < 0.9


def exact_coverage(interval, n, p):
    """Probability that the interval of n trials holds the truth, summed over all outcomes."""
    return sum(binom.pmf(s, n, p) for s in range(n + 1) if interval(s, n).low <= p <= interval(s, n).high)


@pytest.mark.parametrize("n", [5, 30, 100])
@pytest.mark.parametrize("p", [0.02, 0.3, 0.5, 0.9, 0.99])
def test_both_intervals_cover_at_a_fixed_number_of_trials(n, p):
    assert exact_coverage(clopper_pearson, n, p) >= 0.95
    assert exact_coverage(confidence_sequence, n, p) >= 0.95


@given(counts=COUNTS)
def test_the_sequence_ends_where_the_evidence_reaches_one_in_alpha(counts):
    s, n = counts
    low, high = confidence_sequence(s, n)
    assert 0.0 <= low <= s / n <= high <= 1.0
    for bound in (low, high):
        if 0.0 < bound < 1.0:
            # the bound is found to 1e-12; beside 0 or 1 that moves log M by at most n * 1e-12 / bound
            slack = 1e-6 + n * 2e-12 / min(bound, 1 - bound)
            assert log_mixture(s, n - s, bound) == pytest.approx(math.log(20), abs=slack)


@given(counts=COUNTS)
def test_the_sequence_mirrors_when_successes_and_failures_swap(counts):
    s, n = counts
    low, high = confidence_sequence(s, n)
    mirrored = confidence_sequence(n - s, n)
    assert mirrored.low == pytest.approx(1 - high, abs=1e-9)
    assert mirrored.high == pytest.approx(1 - low, abs=1e-9)


def test_the_sequence_says_nothing_before_the_first_trial():
    assert confidence_sequence(0, 0) == (0.0, 1.0)


@given(p=st.floats(0.01, 0.99), s=st.integers(0, 200), f=st.integers(0, 200))
def test_the_evidence_is_a_fair_game_at_the_truth(p, s, f):
    """E[M(n+1) | M(n)] = M(n): what makes it valid at every look."""
    now = log_mixture(s, f, p)
    after = p * math.exp(log_mixture(s + 1, f, p) - now) + (1 - p) * math.exp(log_mixture(s, f + 1, p) - now)
    assert after == pytest.approx(1.0, abs=1e-9)


@given(w=st.integers(0, 300), v=st.integers(0, 300))
def test_mcnemar_is_the_binomial_test_on_the_trials_that_differ(w, v):
    assert mcnemar(w, v) == pytest.approx(binomtest(w, w + v).pvalue if w + v else 1.0)
    assert mcnemar(w, v) == mcnemar(v, w)
    assert mcnemar_sequential(w, v) == pytest.approx(mcnemar_sequential(v, w))
    assert 0.0 < mcnemar_sequential(w, v) <= 1.0


def ever_outside(interval, p, paths, looks):
    """Share of simulated campaigns in which the interval, looked at again and again, once misses the truth."""
    successes = np.cumsum(np.random.default_rng(1).random((paths, max(looks))) < p, axis=1)
    bounds = {}
    missed = np.zeros(paths, dtype=bool)
    for n in looks:
        for s in np.unique(successes[:, n - 1]):
            bounds[n, s] = interval(int(s), n)
        outside = {s for (k, s), (low, high) in bounds.items() if k == n and not low <= p <= high}
        missed |= np.isin(successes[:, n - 1], list(outside))
    return missed.mean()


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.5, 0.9, 0.95])
def test_peeking_breaks_the_plain_interval_and_not_the_sequence(p):
    looks = list(range(1, 401, 3))
    # alpha = 0.05 and three standard errors of 1500 paths above it; the plain interval is far beyond
    bound = 0.05 + 3 * math.sqrt(0.05 * 0.95 / 1500)
    assert ever_outside(confidence_sequence, p, 1500, looks) <= bound
    assert ever_outside(clopper_pearson, p, 1500, looks) > bound


@pytest.mark.slow
def test_peeking_breaks_plain_mcnemar_and_not_the_sequential_one():
    wins = np.cumsum(np.random.default_rng(2).random((1500, 400)) < 0.5, axis=1)
    looks = range(10, 401, 10)
    plain = {(w, n): mcnemar(w, n - w) <= 0.05 for n in looks for w in range(n + 1)}
    valid = {(w, n): mcnemar_sequential(w, n - w) <= 0.05 for n in looks for w in range(n + 1)}
    bound = 0.05 + 3 * math.sqrt(0.05 * 0.95 / 1500)
    assert np.mean([any(valid[w[n - 1], n] for n in looks) for w in wins]) <= bound
    assert np.mean([any(plain[w[n - 1], n] for n in looks) for w in wins]) > bound


@given(p=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_rejects_what_its_step_down_rule_rejects(p):
    """Holm 1979: go up the sorted p-values and stop at the first with p > alpha / (number left)."""
    corrected = holm(p)
    for alpha in (0.01, 0.05, 0.3):
        rejected = []
        for i, place in enumerate(sorted(range(len(p)), key=p.__getitem__)):
            if p[place] * (len(p) - i) > alpha:
                break
            rejected.append(place)
        assert {i for i, value in enumerate(corrected) if value <= alpha} == set(rejected)
    assert all(c >= value for c, value in zip(corrected, p, strict=True))


def test_holm_gives_the_numbers_of_a_hand_calculation():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.02]) == [0.02]
    assert (correction(1), correction(6)) == ("none, there is one pair", "Holm over 6 pairs")
