"""The force on the tool from chamber pressures: exact where the model is, honest about stiction."""

import dataclasses
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_hydraulics.force.compiled import CompiledEstimator
from skillframe_hydraulics.force.momentum import (
    ForceSettings,
    force_from_residual,
    standing_out,
    unaccounted,
)
from skillframe_hydraulics.law.hydraulic import Measured
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.errors import SkillframeError
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.crane_terms import mass_rate_term, one, terms
from tests.references import chain_step

SEEDS = st.integers(0, 2**32 - 1)
DT = 1e-3
FORCE = np.array([1500.0, 7000.0])


@cache
def crane():
    return ClosedChain(load_model(load_robot("hiab_xs031")))


@cache
def oiled():
    """The crane's cylinders without friction."""
    known = cylinders(crane().robot.spec.actuation)
    return dataclasses.replace(known, coulomb_friction=np.zeros(3), viscous_friction=np.zeros(3))


def measured(z, zd, push):
    """Pressures of these piston forces (3,)."""
    low = np.full(3, 20e5)
    pressure = (push + oiled().area_b * low) / oiled().area_a
    return Measured(z[None], zd[None], pressure[None], low[None], *np.zeros((2, 1, 2)))


def copied(estimate):
    """An estimate that the next step leaves alone."""
    return type(estimate)(*(part.copy() for part in estimate))


def estimates(force, seconds=0.5, load=0.0):
    """What an estimator without wrench filter says while the frictionless crane moves under a force on the tool."""
    z, zd = np.array([0.8, -1.6, 0.5]), np.zeros(3)
    hold = crane().at(z, zd).actuator_force(crane().at(z, zd).gravity - one(crane(), z, zd).jacobian.T @ force)
    estimator = CompiledEstimator(crane(), oiled(), 1, DT, ForceSettings(force_corner=None), use_compiler=False)
    estimator.start()
    estimator.identification.theta[:, -1] = load
    found = []
    for k in range(round(seconds / DT)):
        push = hold + np.array([2000.0, 1500.0, 300.0]) * np.sin(np.array([9.0, 13.0, 20.0]) * k * DT)
        state = measured(z, zd, push)
        found.append(estimator.step(state, terms(crane(), state.z, state.rate)).force[0].copy())
        external = one(crane(), z, zd).jacobian.T @ force - load * crane().at(z, zd).load_gravity
        z, zd = chain_step(crane(), z, zd, push, DT, external)
    return np.array(found)


def test_a_known_force_on_a_moving_crane_is_found_to_half_a_percent_once_the_filter_has_settled():
    """What is left: pushes held over a step are compared with the terms at its end, and J's product is not L's."""
    found = estimates(FORCE, 0.3)
    assert np.abs(found[-60:] - FORCE).max() < 0.005 * 7000.0
    assert np.abs(found[0] - FORCE).max() < 1e-9 * 7000.0  # L starts from what holds the crane


@pytest.mark.slow
def test_a_payload_that_is_known_wrongly_by_theta_is_taken_out():
    np.testing.assert_allclose(estimates(0.0 * FORCE, 0.3, load=13.0)[-60:], 0.0, atol=0.005 * 7000.0)


@given(SEEDS)
@settings(max_examples=10)
def test_the_transposed_coriolis_matrix_is_what_the_mass_matrix_s_rate_leaves(seed):
    """C' v = M' v - C v, with M' by a central difference: 1e-6 of the terms."""
    rng = np.random.default_rng(seed)
    z, zd, h = np.array([0.8, -1.6, 0.5]) + rng.normal(size=3) * 0.1, rng.normal(size=3) * 0.5, 1e-5
    mass_rate = (crane().at(z + h * zd, zd).mass - crane().at(z - h * zd, zd).mass) / (2 * h)
    state = crane().at(z, zd)
    coriolis = state.bias - state.gravity - state.embedding.T @ (crane().model.damping * state.v)
    np.testing.assert_allclose(
        mass_rate_term(state), mass_rate @ zd - coriolis, atol=1e-5 * np.abs(mass_rate @ zd).max()
    )


@given(SEEDS)
@pytest.mark.slow
def test_what_known_forces_leave_of_the_momentum_s_rate_is_the_unknown_force(seed):
    """To rounding of p over dt."""
    rng = np.random.default_rng(seed)
    known, unknown = rng.normal(size=(2, 40, 1, 3))
    momentum = np.concatenate([np.zeros((1, 1, 3)), np.cumsum((known + unknown)[1:], axis=0) * DT])
    for before, p, u, d in zip(momentum[:-1], momentum[1:], known[1:], unknown[1:], strict=True):
        np.testing.assert_allclose(unaccounted(p, before, u, DT), d, atol=1e-11)


@given(SEEDS)
def test_the_force_is_the_weighted_least_squares_solution_and_sigma_its_standard_deviation(seed):
    rng = np.random.default_rng(seed)
    for m, n in ((2, 3), (3, 4), (3, 3), (2, 2)):
        j, r, v = rng.normal(size=(m, n)), rng.normal(size=n), rng.uniform(0.1, 9.0, n)
        f, square = (np.array(ca.DM(x)).ravel() for x in force_from_residual(ca.SX(j), ca.SX(r), ca.SX(v)))
        s = np.sqrt(square)
        scaled = j.T / np.sqrt(v)[:, None]
        np.testing.assert_allclose(f, np.linalg.lstsq(scaled, r / np.sqrt(v), rcond=None)[0], rtol=1e-6)
        np.testing.assert_allclose(s, np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))), rtol=1e-6)


@settings(deadline=None)
@given(st.floats(1e-3, 1e3), st.floats(0.0, 6.28), st.floats(10.0, 1e3))
def test_of_a_force_what_stands_out_of_its_sigma_is_answered_and_along_it(ratio, turn, sigma):
    """Half of it at twice sigma; beyond, all but (2 sigma / f)^4; below, no more than (f / 2 sigma)^4 of it."""
    force = 2.0 * sigma * ratio * np.array([[np.cos(turn), np.sin(turn)]])
    found = standing_out(force, np.full((1, 2), sigma), 2.0)
    share = np.hypot(*found[0]) / np.hypot(*force[0])
    assert share == pytest.approx(1.0 / (1.0 + ratio**-4.0), rel=1e-9)
    np.testing.assert_allclose(found, share * force, rtol=1e-9, atol=1e-9 * sigma)


def test_at_standstill_the_estimate_is_not_valid_and_its_sigma_is_above_400_newtons():
    z = np.array([0.8, -1.6, 0.5])
    known = cylinders(crane().robot.spec.actuation)
    estimator = CompiledEstimator(crane(), known, 1, DT, use_compiler=False)
    still = measured(z, 0 * z, crane().at(z, 0 * z).holding_force())
    estimator.start()
    estimate = estimator.step(still, terms(crane(), still.z, still.rate))
    assert not estimate.valid[0]
    assert estimate.sigma.min() > 400.0


def test_while_two_pistons_slide_the_estimate_is_valid_and_its_sigma_is_small():
    z, zd = np.array([0.8, -1.6, 0.5]), np.array([0.2, -0.2, 0.0])
    estimator = CompiledEstimator(crane(), cylinders(crane().robot.spec.actuation), 1, DT, use_compiler=False)
    moving = measured(z, zd, crane().at(z, zd).holding_force())
    at = terms(crane(), moving.z, moving.rate)
    estimator.start()
    found = [copied(estimator.step(moving, at)) for _ in range(850)]
    assert not found[700].valid[0]  # 0.4 and 0.35 s, and the rate's filter
    assert found[-1].valid[0]
    assert found[-1].sigma.max() < 0.2 * found[0].sigma.max()


def test_friction_is_what_was_known_before_and_what_was_found():
    """At full speed tanh is 1 to 1e-6: (F_C + dF_C) + (F_v + dF_v) v."""
    z, zd = np.array([0.8, -1.6, 0.5]), np.array([0.2, -0.2, 0.1])
    known = cylinders(crane().robot.spec.actuation)
    estimator = CompiledEstimator(crane(), known, 1, DT, use_compiler=False)
    moving = measured(z, zd, crane().at(z, zd).holding_force())
    at = terms(crane(), moving.z, moving.rate)
    estimator.start()
    for _ in range(300):
        estimator.step(moving, at)
    estimator.identification.theta[0, :6] = 800.0, -800.0, 500.0, 3000.0, -2000.0, 0.0
    coulomb = known.coulomb_friction + np.array([800.0, -800.0, 500.0])
    viscous = known.viscous_friction + np.array([3000.0, -2000.0, 0.0])
    expected = coulomb * np.sign(at.piston_rate[0]) + viscous * at.piston_rate[0]
    np.testing.assert_allclose(estimator.friction(at)[0], expected, rtol=1e-6)


def test_rows_of_a_batch_do_not_know_of_each_other():
    z, zd = np.array([[0.8, -1.6, 0.5], [0.6, -1.2, 0.3]]), np.array([[0.2, -0.2, 0.1], [-0.1, 0.2, 0.0]])
    push = np.full(3, 3e4)
    both = Measured(
        *(np.concatenate(x) for x in zip(*(measured(a, b, push) for a, b in zip(z, zd, strict=True)), strict=True))
    )
    single = measured(z[1], zd[1], push)
    found = []
    for m in (both, single):
        estimator = CompiledEstimator(crane(), oiled(), len(m.z), DT, use_compiler=False)
        estimator.start()
        at = terms(crane(), m.z, m.rate)
        found.append([estimator.step(m, at).force[-1].copy() for _ in range(20)])
    np.testing.assert_array_equal(*found)


def test_a_corner_that_is_no_frequency_is_refused():
    with pytest.raises(SkillframeError, match="corner must be positive, got -1"):
        ForceSettings(corner=-1.0)
