"""How a phase feels: the density of its wrenches, and what the gate makes of them."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from skillframe_segmenter import gate
from skillframe_segmenter.features import regressors


def wrenches(rng, count, lean, friction):
    """Soft wrenches of a tool that leans to a side by `lean` and feels friction along y."""
    force = [0.3 * lean * np.ones(count), friction * np.ones(count), 0.9 * np.ones(count)]
    torque = np.zeros((count, 3))
    return np.column_stack([*force, torque]) + 0.03 * rng.normal(size=(count, 6))


def learned(rng, leans, count=40):
    """A gate from demonstrations that slide down a side, then along, leaning as they came."""
    drive, posterior = [], []
    for lean in leans:
        drive.append(regressors(np.vstack([wrenches(rng, count, lean, 0.0), wrenches(rng, count, lean, -0.25)])))
        posterior.append(np.repeat(np.eye(2), count, axis=0))
    paths = [each.argmax(axis=1) for each in posterior]
    return gate.fit(drive, np.concatenate(posterior), paths)


def test_evidence_is_the_log_of_a_normal_density_but_for_what_all_phases_share():
    rng = np.random.default_rng(1)
    made = learned(rng, (1.0, -1.0, 1.0))
    felt = rng.normal(size=(20, 6))
    wanted = np.column_stack(
        [multivariate_normal(m, c).logpdf(felt) for m, c in zip(made.mean, made.covariance, strict=True)]
    )
    off = made.log_evidence(felt) - wanted
    np.testing.assert_allclose(off, 3.0 * np.log(2.0 * np.pi), atol=1e-9)  # the rounding of sums of some hundreds


def test_evidence_looks_at_the_wrench_and_at_no_other_regressor():
    rng = np.random.default_rng(2)
    made = learned(rng, (1.0, -1.0))
    felt = rng.normal(size=(5, 6))
    assert np.array_equal(made.log_evidence(felt), made.log_evidence(regressors(felt)))


@pytest.mark.parametrize("lean", [-1.0, -0.5, 0.5, 1.0])
def test_friction_tells_phases_apart_whichever_side_the_tool_leans_on(lean):
    """Three demonstrations say that the side differs anyway. The sign of friction does not."""
    rng = np.random.default_rng(3)
    made = learned(rng, (1.0, -1.0, 1.0))
    down, along = (made.log_evidence(wrenches(rng, 50, lean, friction)) for friction in (0.0, -0.25))
    assert (down[:, 0] > down[:, 1]).all() and (along[:, 1] > along[:, 0]).all()


def test_a_phase_that_holds_hardly_a_window_has_a_density_all_the_same():
    rng = np.random.default_rng(4)
    posterior = np.zeros((60, 3))
    posterior[:, 0], posterior[-1] = 1.0, (0.0, 1.0, 0.0)
    made = gate.fit([regressors(wrenches(rng, 60, 1.0, 0.0))], posterior, [posterior.argmax(axis=1)])
    assert (np.linalg.eigvalsh(made.covariance) > 0.0).all()
    assert np.isfinite(made.log_evidence(rng.normal(size=(10, 6)))).all()


def test_no_wrench_is_so_strange_that_the_belief_is_lost():
    rng = np.random.default_rng(5)
    made = learned(rng, (1.0, -1.0, 1.0))
    belief = np.array([[1.0, 0.0], [0.5, 0.5]])
    for _ in range(1000):
        belief = gate.advance(made, belief, np.full((2, 6), 1e3))
    assert np.isfinite(belief).all()
    np.testing.assert_allclose(belief.sum(axis=1), 1.0, atol=1e-12)
