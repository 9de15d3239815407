"""The guess of where a skill works: a Gaussian process classifier, against its definition and against sampling."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr
from scipy.stats import multivariate_normal, norm, qmc
from skillframe_certify import surrogate
from skillframe_certify.surrogate import (
    AMPLITUDES,
    JITTER,
    LENGTHS,
    Surrogate,
    covariance,
    evidence,
    factor_of,
    mode,
    posterior,
)

SOBOL = 2.0 * qmc.Sobol(2, scramble=True, rng=np.random.default_rng(3)).random(256) - 1.0
ONES = np.ones(2)


def matern(first, second, lengths):
    r = np.linalg.norm((first[:, None] - second) / lengths, axis=2)
    return (1.0 + np.sqrt(5.0) * r + 5.0 * r**2 / 3.0) * np.exp(-np.sqrt(5.0) * r)


def few(count=14, seed=1):
    """Trials (n, 2) that work on one side, more or less, and their labels."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (count, 2))
    return points, np.where(points[:, 0] + 0.5 * rng.standard_normal(count) > 0.0, 1.0, -1.0)


def drawn(gram, labels, count=400_000):
    """Draws of f (count, n) before any label, and the labels' probability by each."""
    hidden = multivariate_normal(np.zeros(len(gram)), gram, allow_singular=True, seed=3).rvs(count)
    return hidden, ndtr(labels * hidden).prod(axis=1)


def test_covariance_is_materns_of_order_5_2():
    points, lengths = few()[0], np.array([0.7, 1.3])
    assert covariance(points, points, lengths) == pytest.approx(matern(points, points, lengths))


@pytest.mark.parametrize("amplitude", [1.0, 8.0])
def test_mean_and_deviation_are_those_of_f_given_the_labels(amplitude):
    """Against 400,000 draws weighed by the labels' probability, with an error of 0.01 of a deviation or so."""
    points, labels = few(6)
    gram = amplitude**2 * matern(points, points, ONES)
    hidden, likely = drawn(gram, labels)
    weights = likely / likely.sum()
    mean = weights @ hidden
    spread = np.sqrt(weights @ (hidden - mean) ** 2)
    known = posterior(gram, labels)
    half = np.linalg.solve(known.factor, known.root[:, None] * gram)
    assert gram @ known.weights == pytest.approx(mean, abs=0.05 * amplitude)
    assert np.sqrt(np.diag(gram) - np.sum(half**2, axis=0)) == pytest.approx(spread, rel=0.06)


def test_evidence_is_near_the_probability_of_the_labels():
    points, labels = few(6)
    gram = matern(points, points, ONES)
    assert evidence(gram, labels) == pytest.approx(np.log(drawn(gram, labels)[1].mean()), abs=0.05)


@pytest.mark.parametrize("smooth", [False, True])
def test_newtons_mode_is_that_of_an_optimiser_which_knows_nothing_of_its_form(smooth):
    """Labels that a smooth f explains, and labels at random with the stiffest covariance on the ladders."""
    points, labels = few() if smooth else (SOBOL[:96], np.where(np.random.default_rng(6).random(96) < 0.5, 1.0, -1.0))
    amplitude, lengths = (2.0, ONES) if smooth else (AMPLITUDES[-1], LENGTHS[-1] * ONES)
    gram = amplitude**2 * (matern(points, points, lengths) + JITTER * np.eye(len(points)))
    whole = np.linalg.cholesky(gram)  # f = whole u, u ~ N(0, 1)

    def loss(u):
        return 0.5 * u @ u - log_ndtr(labels * (whole @ u)).sum()

    best = minimize(loss, np.zeros(len(points)), options={"gtol": 1e-7})
    hidden, value, _ = mode(gram, labels)
    assert value == pytest.approx(-best.fun, abs=1e-5)
    assert hidden == pytest.approx(whole @ best.x, abs=1e-3 * np.abs(hidden).max())


def test_success_and_sureness_are_means_over_what_f_may_be():
    found, at = Surrogate(*trials(few())), np.random.default_rng(5).standard_normal(20_001)
    asked = SOBOL[:64]
    hidden = found.mean(asked)[:, None] + found.deviation(asked)[:, None] * at
    assert found.success(asked) == pytest.approx(ndtr(hidden).mean(axis=1), abs=0.02)
    assert found.above(asked) == pytest.approx((hidden > 0.0).mean(axis=1), abs=0.02)


def trials(pair):
    return pair[0], pair[1] > 0.0


def test_picks_are_those_whose_labels_are_expected_to_tell_most():
    """Greedy picks from the inverse of the trials' covariance, with each pick's share of the covariance taken out."""
    points, offered = np.split(np.random.default_rng(4).uniform(-1.0, 1.0, (52, 2)), [12])
    works = points[:, 0] + 0.3 * points[:, 1] > 0.0
    found = Surrogate(points, works)

    def gram(first, second):
        return found.amplitude**2 * matern(first, second, found.lengths)

    known, cross = posterior(gram(points, points), np.where(works, 1.0, -1.0)), gram(points, offered)
    inverse = known.root[:, None] * np.linalg.inv(known.factor @ known.factor.T) * known.root
    spread, mean, expected = gram(offered, offered) - cross.T @ inverse @ cross, found.mean(offered), []
    for _ in range(6):
        variance = np.diag(spread).copy()
        at = mean / np.sqrt(1.0 + variance)
        share = norm.pdf(at) ** 2 / ((1.0 + variance) * norm.cdf(at) * norm.cdf(-at))
        doubt = (norm.pdf(mean / np.sqrt(variance)) ** 2 / variance)[:, None] * spread**2
        gain = share * doubt.sum(axis=0)
        gain[expected] = -np.inf
        expected.append(best := int(np.argmax(gain)))
        spread = spread - share[best] * np.outer(spread[:, best], spread[:, best])
    assert found.telling(offered, 6).tolist() == expected


def test_what_a_label_does_to_a_mean_has_the_variance_that_picks_count_on():
    """With f ~ N(m, s^2) a label y of probability Phi(z) moves the mean by y s^2 phi(z) / (Phi(y z) sqrt(1 + s^2))."""
    m, s = 0.7, 2.0
    f = m + s * np.random.default_rng(8).standard_normal(400_000)
    y = np.where(np.random.default_rng(9).random(len(f)) < ndtr(f), 1.0, -1.0)
    means = np.where(y > 0.0, f[y > 0.0].mean(), f[y < 0.0].mean())
    z = m / np.sqrt(1.0 + s**2)
    share = norm.pdf(z) ** 2 / ((1.0 + s**2) * ndtr(z) * ndtr(-z))
    assert means.var() == pytest.approx(share * s**4, rel=0.01)


@pytest.mark.slow
def test_stray_failures_make_the_guess_modest_and_do_not_move_its_border():
    """More than half of the range works, but for one trial in twenty."""
    clean = SOBOL[:, 0] < 0.2
    stray = clean & (np.random.default_rng(7).random(256) > 0.05)
    inside, even = SOBOL[SOBOL[:, 0] < 0.0], np.random.default_rng(8).uniform(-1.0, 1.0, (4000, 2))
    sure, modest = Surrogate(SOBOL, clean), Surrogate(SOBOL, stray)
    assert np.median(sure.success(inside)) > 0.99
    assert 0.9 < np.median(modest.success(inside)) < 0.99  # 0.95 in truth
    assert np.mean((modest.mean(even) > 0.0) != (even[:, 0] < 0.2)) < 0.04


@pytest.mark.slow
def test_a_sharp_border_is_steep_and_a_soft_one_is_not():
    """Success falls from Phi(0.4) to Phi(-0.4) within the two places that are asked, or at once."""
    sharp = Surrogate(SOBOL, SOBOL[:, 0] < 0.1)
    soft = Surrogate(SOBOL, np.random.default_rng(9).random(256) < ndtr(-4.0 * (SOBOL[:, 0] - 0.1)))
    ends = np.array([[0.0, 0.0], [0.2, 0.0]])
    assert np.ptp(sharp.success(ends)) > 0.8
    assert np.ptp(soft.success(ends)) == pytest.approx(ndtr(0.4) - ndtr(-0.4), abs=0.15)


def test_how_much_is_said_to_be_wrong_is_about_what_is_wrong():
    """An ellipse by 128 trials: the mean of min(p, 1 - p), against the truth at even points."""
    even = np.random.default_rng(10).uniform(-1.0, 1.0, (4000, 2))

    def truth(points):
        return np.sum((points / [0.8, 0.5]) ** 2, axis=1) < 1.0

    sure = Surrogate(SOBOL[:128], truth(SOBOL[:128])).above(even)
    wrong = np.mean((sure > 0.5) != truth(even))
    assert 0.5 * wrong < np.mean(np.minimum(sure, 1.0 - sure)) < 2.5 * wrong


def test_a_quantity_without_effect_gets_a_long_length():
    lengths = Surrogate(SOBOL[:128], np.abs(SOBOL[:128, 0]) < 0.4).lengths
    assert lengths[1] > 4.0 * lengths[0]


@pytest.mark.slow
def test_of_very_many_trials_the_last_ones_are_known(monkeypatch):
    """The first half says the opposite."""
    monkeypatch.setattr(surrogate, "MOST_KNOWN", 128)
    works = np.where(np.arange(256) < 128, SOBOL[:, 0] > 0.0, SOBOL[:, 0] < 0.0)
    assert np.array_equal(Surrogate(SOBOL, works).mean(SOBOL), Surrogate(SOBOL[128:], works[128:]).mean(SOBOL))


def test_lengths_are_those_that_explain_all_trials_and_not_the_first_ones_alone(monkeypatch):
    """The first 64 all fail, which says nothing of lengths; all of them say that x alone matters."""
    monkeypatch.setattr(surrogate, "MOST_ROWS", 64)
    works = np.abs(SOBOL[:, 0]) < 0.4
    order = np.argsort(works, kind="stable")
    lengths = Surrogate(SOBOL[order], works[order]).lengths
    assert lengths[1] > 2.0 * lengths[0]


def test_sweeps_come_to_an_end_on_sharp_labels_at_the_largest_amplitude(monkeypatch):
    """Some thirty take all labels to where they stay; whole steps swing up to the last of 200."""
    sweeps = []
    monkeypatch.setattr(surrogate, "factor_of", lambda *given: sweeps.append(1) or factor_of(*given))
    sharp = np.where(np.abs(SOBOL[:, 1] - 0.3 * SOBOL[:, 0]) < 0.08 * (SOBOL[:, 0] + 1.1), 1.0, -1.0)
    gram = AMPLITUDES[-1] ** 2 * matern(SOBOL, SOBOL, np.array([1.4, 0.5]))
    assert posterior(gram, sharp).settled and len(sweeps) < 60
    monkeypatch.setattr(surrogate, "MOST_SWEEPS", len(sweeps) // 2)
    assert not posterior(gram, sharp).settled


@pytest.mark.parametrize("count", [64, 192, 256])
def test_labels_that_are_all_alike_are_found_to_their_end(count):
    """f is nearly one number c then: its mean is that of N(c; 0, a^2) Phi(c)^n, by quadrature; ours is 12 % above."""
    found = Surrogate(SOBOL[:count], np.full(count, True))
    level = np.linspace(-5.0, 12.0, 4001) * found.amplitude
    weight = norm.pdf(level, scale=found.amplitude) * np.exp(count * log_ndtr(level))
    assert found.settled and found.lengths.tolist() == [LENGTHS[-1]] * 2
    assert found.mean(SOBOL[:1])[0] == pytest.approx(weight @ level / weight.sum(), rel=0.2)


def test_trials_at_one_place_that_end_both_ways_give_their_rate():
    there = np.zeros((40, 2))
    assert Surrogate(there, np.arange(40) % 4 > 0).success(there[:1])[0] == pytest.approx(0.75, abs=0.1)


def test_no_covariance_is_judged_twice(monkeypatch):
    """The ascents from both starts come back to their neighbours, and meet each other's."""
    judged = []

    def seen(points, labels, lengths, amplitude):
        judged.append((*lengths, amplitude))
        return real(points, labels, lengths, amplitude)

    real = surrogate._evidence
    monkeypatch.setattr(surrogate, "_evidence", seen)
    Surrogate(SOBOL[:64], np.sum(SOBOL[:64] ** 2, axis=1) < 0.6)
    assert len(judged) == len(set(judged)) > 10
