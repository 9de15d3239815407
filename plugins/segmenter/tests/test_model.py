"""What the phase model sees and how it is fitted: laws of windows, features, emission, transitions and cuts."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from skillframe_segmenter import changepoints, em, emission, runs, transitions
from skillframe_segmenter.features import soft_pair
from skillframe_segmenter.segmentation import prepare
from skillframe_segmenter.settings import Settings
from skillframe_segmenter.windows import windows

from skillframe.frames import norm
from tests.figures import quasistatic as made

RNG = np.random.default_rng(20)


def test_a_steady_motion_has_its_velocity_in_every_window():
    one = made.lower_and_slide(1).demonstration
    count = len(one.time)
    steady = replace(
        one, position=np.outer(one.time, [0.01, 0.0, -0.02]), quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        wrench=np.tile([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], (count, 1)),
    )  # fmt: skip
    cut = windows(steady, np.zeros(3), "base")
    # positions are rounded to 0.1 nm, the window is 50 ms; the first and last edges are means over half a bin
    np.testing.assert_allclose(cut.motion[1:-1, :3], np.tile([0.01, 0.0, -0.02], (cut.size - 2, 1)), atol=1e-8)
    np.testing.assert_allclose(cut.motion[:, 3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(cut.wrench, np.tile([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], (cut.size, 1)), atol=1e-12)


def test_windows_do_not_mind_the_sign_of_a_quaternion():
    one = made.hose(1).demonstration
    flipped = replace(one, quaternion=one.quaternion * np.where(np.arange(len(one.time)) % 7 < 3, -1.0, 1.0)[:, None])
    for a, b in zip(windows(one, np.zeros(3), "base"), windows(flipped, np.zeros(3), "base"), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


@given(arrays(float, (5, 6), elements=st.floats(-1e6, 1e6)))
def test_soft_directions_are_shorter_than_one(x):
    u = soft_pair(x, 1.0, 1.0)
    assert (norm(u[:, :3]) <= 1.0).all()
    assert (norm(u[:, 3:]) <= 1.0).all()


def test_friction_is_no_part_of_the_contact_normal():
    """A slide's force has a part along the motion. What is left of it is normal to the motion."""
    motion = np.array([[0.9, 0.0, 0.0, 0.0, 0.0, 0.0]])
    seen = emission.observe(motion, np.array([[-0.2, 0.0, 0.8, 0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(seen.free[0, 0], np.diag([1.0, 1.0, 1.0 - 0.8**2]), atol=1e-12)


def test_a_phase_s_direction_is_found_from_slides_on_planes_that_face_different_ways():
    """Each window shows only what its plane lets through. Together they show the desired direction."""
    wanted = np.array([0.1, -0.2, -0.8])
    normal = RNG.normal(size=(400, 3))
    normal /= norm(normal)[:, None]
    motion = wanted - (normal @ wanted)[:, None] * normal
    seen = emission.observe(np.hstack([motion, np.zeros((400, 3))]), np.hstack([normal, np.zeros((400, 3))]))
    found = emission.fit(seen, np.ones((400, 1))).direction[0, :3]
    # the ridge of 0.01 shortens it by about a hundredth over the mean of M, which is 2/3
    np.testing.assert_allclose(found, wanted, rtol=0.03)


def seen_at_random(count):
    u, a = (RNG.uniform(-0.5, 0.5, size=(count, 6)) for _ in range(2))
    return emission.observe(u, a), u


def test_densities_are_those_of_the_equation_written_out():
    seen, u = seen_at_random(50)
    root = RNG.normal(size=(2, 6, 6))
    phases = emission.Phases(RNG.normal(size=(2, 6)), root @ np.swapaxes(root, 1, 2) + np.eye(6))
    found = emission.log_likelihood(seen, phases)
    for w in range(50):
        for k in range(2):
            whole = np.zeros((6, 6))
            whole[:3, :3], whole[3:, 3:] = seen.free[w]
            e, covariance = u[w] - whole @ phases.direction[k], phases.covariance[k]
            expected = -0.5 * e @ np.linalg.solve(covariance, e) - 0.5 * np.linalg.slogdet(2.0 * np.pi * covariance)[1]
            assert found[w, k] == pytest.approx(expected, rel=1e-10)  # a 6 x 6 system, solved twice


def test_phases_are_those_of_the_equations_written_out():
    seen, u = seen_at_random(80)
    weight = RNG.dirichlet(np.ones(3), size=80)
    found = emission.fit(seen, weight)
    size, own = weight.sum(axis=0), []
    for k in range(3):
        direction = []
        for part in range(2):
            m, v = seen.free[:, part], u[:, 3 * part : 3 * part + 3]
            moment = sum(weight[w, k] * m[w] for w in range(80)) + 0.01 * size[k] * np.eye(3)
            direction.append(np.linalg.solve(moment, sum(weight[w, k] * m[w] @ v[w] for w in range(80))))
        np.testing.assert_allclose(found.direction[k], np.concatenate(direction), rtol=1e-9)
        moved = np.concatenate([seen.free[:, part] @ direction[part] for part in range(2)], axis=1)
        scatter = ((u - moved) * weight[:, [k]]).T @ (u - moved)
        own.append((scatter + 12.0 * 4.0 * 0.02**2 * np.eye(6)) / (size[k] + 12.0) + 0.02**2 * np.eye(6))
    pooled = sum(n * s for n, s in zip(size, own, strict=True)) / size.sum()
    for k in range(3):
        share = size.sum() / 3.0
        expected = (size[k] * own[k] + share * pooled) / (size[k] + share)
        np.testing.assert_allclose(found.covariance[k], expected, rtol=1e-9)  # sums of 80 doubles, once solved


@pytest.mark.parametrize("phases", [2, 4])
def test_a_newton_step_is_the_one_of_finite_differences(phases):
    """Gradient and curvature of the penalised expected log-likelihood by central differences, one row."""
    phi = np.column_stack([RNG.uniform(-1.0, 1.0, size=(60, 2)), np.ones(60)])
    target, row = RNG.dirichlet(np.ones(phases), size=60), 0.3 * RNG.normal(size=(phases, 3))
    row[0] = 0.0
    ridge = np.array([transitions.RIDGE, transitions.RIDGE, transitions.BIAS_RIDGE])

    def value(x):
        full = np.vstack([np.zeros(3), x.reshape(-1, 3)])
        return (target * np.log(transitions.softmax(phi @ full.T))).sum() - 0.5 * (ridge * full**2).sum()

    x, h = row[1:].ravel(), 1e-4
    eye = h * np.eye(len(x))
    gradient = np.array([(value(x + e) - value(x - e)) / (2.0 * h) for e in eye])
    curvature = np.array(
        [[value(x + a + b) - value(x + a - b) - value(x - a + b) + value(x - a - b) for b in eye] for a in eye]
    )
    step = np.linalg.solve(-curvature / (4.0 * h * h), gradient)
    weights, joint = np.zeros((phases, phases, 3)), np.zeros((60, phases, phases))
    weights[0], joint[:, 0] = row, target
    found = transitions.improve(weights, np.zeros_like(weights), phi, joint, steps=1)[0] - row
    assert np.abs(step).max() < transitions.LARGEST_STEP
    np.testing.assert_allclose(found[1:].ravel(), step, rtol=1e-3, atol=1e-5)  # differences of second order, h^2


@pytest.mark.parametrize("kind", ["wrench_hmm", "pose_hmm"])
def test_em_never_loses_likelihood_while_the_motion_is_fitted(kind):
    """Up to the priors on covariances: the tempered likelihood itself may dip by less than a thousandth."""
    demonstrations = [m.demonstration for m in made.demonstrations("ls", 3)]
    settings = Settings()
    prepared = prepare(demonstrations, settings, kind)
    data = em.gather(prepared.seen, prepared.drive, settings)
    posterior = em.leaky(em.by_time(data.lengths, 2), 2)
    weights = transitions.prior_weights(2, data.regressors.shape[1], settings.stay_s)
    steps = em._steps(data, transitions.probabilities(weights, data.regressors))
    trail = []
    for _ in range(12):
        model, residual = em._maximise(data, posterior, weights)
        smoothed, _ = em._expect(data, model, steps, residual)
        posterior = smoothed.posterior[data.inside]
        trail.append(float(smoothed.log_likelihood.sum()))
    assert (np.diff(trail) > -1e-3 * np.abs(trail[0])).all()
    assert trail[-1] > trail[0]


def test_newton_steps_find_the_weights_that_made_the_transitions():
    phi = np.column_stack([RNG.uniform(-1.0, 1.0, 4000), np.ones(4000)])
    true = np.zeros((2, 2, 2))
    true[0, 1] = [4.0, -1.0]
    probability = transitions.probabilities(true, phi)
    joint = np.zeros((4000, 2, 2))
    joint[:, 0] = probability[:, 0]
    found = transitions.improve(np.zeros((2, 2, 2)), np.zeros((2, 2, 2)), phi, joint, steps=20)
    # ridges of 1 and 0.3 against some hundred effective samples
    np.testing.assert_allclose(found[0, 1], true[0, 1], rtol=0.03)
    np.testing.assert_array_equal(found[0, 0], 0.0)


def test_least_cost_cuts_are_the_cheapest_of_all():
    """By trying every set of cuts with segments of four windows or more."""
    x = np.concatenate([np.full((6, 1), 0.0), np.full((7, 1), 1.0), np.full((5, 1), -1.0)]) + 0.1 * RNG.normal(
        size=(18, 1)
    )
    penalty = 6.0 * max(changepoints.local_variance(x), 0.02) * np.log(len(x))

    def cost(bounds):
        parts = [x[a:b] for a, b in pairwise(bounds)]
        return sum(((p - p.mean()) ** 2).sum() for p in parts) + penalty * (len(parts) - 1)

    def every(first):
        if len(x) - first >= 4:
            yield [first, len(x)]
        for nxt in range(first + 4, len(x) - 3):
            for rest in every(nxt):
                yield [first, *rest]

    assert changepoints.cuts(x) == min(every(0), key=cost)[1:-1]


@given(st.lists(st.integers(0, 2), min_size=1, max_size=40), st.integers(1, 6))
def test_no_run_is_shorter_than_asked_for_unless_it_is_the_only_one(labels, shortest):
    tidy = runs.without_short(np.array(labels), shortest)
    starts = runs.starts_of_runs(tidy)
    lengths = np.diff(np.append(starts, len(tidy)))
    assert len(starts) == 1 or lengths.min() >= shortest
    assert set(tidy.tolist()) <= set(labels)
