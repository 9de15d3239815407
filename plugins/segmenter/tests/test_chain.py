"""The blocked forward-backward pass and the most likely path, against the plain loops that they replace."""

import itertools

import numpy as np
import pytest
from skillframe_segmenter import chain


def random_chain(rng, windows, phases, demonstrations=1):
    emission = 3.0 * rng.normal(size=(demonstrations, windows, phases))
    transition = rng.dirichlet(np.ones(phases), size=(demonstrations, windows - 1, phases))
    return rng.dirichlet(np.ones(phases)), emission, transition


def loop(initial, emission, transition):
    """Forward and backward one window after the other."""
    density = np.exp(emission)
    forward, backward = [initial * density[0]], [np.ones(len(initial))]
    log_scale = 0.0
    for t in range(1, len(emission)):
        log_scale += np.log(forward[-1].sum())
        forward.append(forward[-1] / forward[-1].sum() @ transition[t - 1] * density[t])
        backward.append(transition[-t] @ (density[-t] * backward[-1] / backward[-1].sum()))
    forward, backward = np.array(forward), np.array(backward[::-1])
    posterior = forward * backward
    return posterior / posterior.sum(axis=1, keepdims=True), log_scale + np.log(forward[-1].sum()), forward, backward


def path_by_loop(initial, emission, transition):
    """Viterbi's path one window after the other."""
    score, back = np.log(initial) + emission[0], []
    for t in range(1, len(emission)):
        arriving = score[:, None] + np.log(transition[t - 1])
        back.append(arriving.argmax(axis=0))
        score = arriving.max(axis=0) + emission[t]
    path = [int(score.argmax())]
    for before in reversed(back):
        path.append(int(before[path[-1]]))
    return path[::-1]


@pytest.mark.parametrize(("windows", "phases"), [(2, 2), (9, 3), (10, 1), (37, 5), (900, 3)])
def test_blocks_give_what_the_loop_over_windows_gives(windows, phases):
    initial, emission, transition = random_chain(np.random.default_rng([windows, phases]), windows, phases)
    posterior, log_likelihood, _, _ = loop(initial, emission[0], transition[0])
    smoothed = chain.smooth(initial, emission, transition)
    # both round some hundred products of doubles
    np.testing.assert_allclose(smoothed.posterior[0], posterior, atol=1e-12)
    assert smoothed.log_likelihood[0] == pytest.approx(log_likelihood, abs=1e-10)


def test_a_demonstration_s_result_does_not_depend_on_how_long_the_others_are():
    """Filling up a shorter one with identity steps changes nothing."""
    rng = np.random.default_rng(4)
    initial, emission, transition = random_chain(rng, 30, 3)
    longer = np.zeros((1, 50, 3)), np.broadcast_to(np.eye(3), (1, 49, 3, 3)).copy()
    longer[0][:, :30], longer[1][:, :29] = emission, transition
    alone, filled = chain.smooth(initial, emission, transition), chain.smooth(initial, *longer)
    np.testing.assert_allclose(filled.posterior[0, :30], alone.posterior[0], atol=1e-12)
    assert filled.log_likelihood[0] == pytest.approx(alone.log_likelihood[0], abs=1e-10)


def test_nothing_underflows_in_a_long_recording_of_impossible_windows():
    initial, _, transition = random_chain(np.random.default_rng(1), 20_000, 2)
    smoothed = chain.smooth(initial, np.full((1, 20_000, 2), -500.0), transition)
    assert np.isfinite(smoothed.posterior).all()
    assert smoothed.log_likelihood[0] == pytest.approx(-500.0 * 20_000, rel=1e-9)


def test_expected_transitions_agree_with_the_posteriors_on_both_sides():
    initial, emission, transition = random_chain(np.random.default_rng(7), 25, 3, demonstrations=2)
    smoothed = chain.smooth(initial, emission, transition)
    joint = chain.pairs(smoothed, emission, transition)
    np.testing.assert_allclose(joint.sum(axis=-1), smoothed.posterior[:, :-1], atol=1e-12)
    np.testing.assert_allclose(joint.sum(axis=-2), smoothed.posterior[:, 1:], atol=1e-12)


def test_the_most_likely_path_beats_every_other():
    initial, emission, transition = random_chain(np.random.default_rng(3), 6, 3)

    def log_probability(path):
        steps = sum(np.log(transition[0, t, a, b]) for t, (a, b) in enumerate(itertools.pairwise(path)))
        return np.log(initial[path[0]]) + sum(emission[0, t, k] for t, k in enumerate(path)) + steps

    best = max(itertools.product(range(3), repeat=6), key=log_probability)
    assert tuple(chain.most_likely_path(initial, emission[0], transition[0])) == best


@pytest.mark.parametrize(("windows", "phases"), [(2, 2), (9, 3), (10, 1), (37, 5), (900, 3)])
def test_blocks_give_the_path_that_the_loop_over_windows_gives(windows, phases):
    initial, emission, transition = random_chain(np.random.default_rng([5, windows, phases]), windows, phases)
    found = chain.most_likely_path(initial, emission[0], transition[0])
    assert found.tolist() == path_by_loop(initial, emission[0], transition[0])
