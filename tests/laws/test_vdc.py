"""Virtual Decomposition Control: the laws its proof of stability stands on, and what a term that is left out does."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_hydraulics.law.symbolic_chain import BodyMotion, Twist
from skillframe_hydraulics.law.vdc_adaptation import adapt
from skillframe_hydraulics.law.vdc_body import regressor as generated
from skillframe_hydraulics.law.vdc_reference import ToolTask

from skillframe.errors import InputError
from skillframe.robot.model import load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import load_robot
from tests.laws.vdc_loop import PISTON, START, Loop, crane, growth, task
from tests.oracle import vdc
from tests.oracle.vdc import projected_rate
from tests.oracle.vdc_body import mass_matrix, regressor
from tests.oracle.vdc_flows import power_flows
from tests.oracle.vdc_reference import Path, required_motion

SEEDS = st.integers(0, 2**32 - 1)
REGRESSOR = regressor
FIVE, NONE = 5.0 * np.eye(6), np.zeros((6, 6))


def random_body(seed):
    rng = np.random.default_rng(seed)
    inertia = pin.Inertia.Random()
    inertia.mass, inertia.lever = rng.uniform(1, 600), rng.normal(size=3)
    a = rng.normal(size=(3, 3))
    inertia.inertia = a @ a.T
    return rng, inertia, np.array(inertia.toDynamicParameters())


def random_motion(seed):
    """A state inside the workspace, and rates and accelerations that are required."""
    rng = np.random.default_rng(seed)
    z = np.array([rng.uniform(0.1, 1.2), rng.uniform(-2.3, -0.5), rng.uniform(0.1, 1.0)])
    state = crane().at(z, rng.normal(size=3) * 0.4)
    return state, rng.normal(size=3) * 0.4, rng.normal(size=3)


@given(SEEDS)
def test_a_body_that_moves_as_required_needs_newton_and_eulers_force(seed):
    rng, inertia, theta = random_body(seed)
    v, a = rng.normal(size=6), rng.normal(size=6)
    expected = inertia.vxiv(pin.Motion(v)).vector + (inertia * pin.Motion(a)).vector
    force = regressor(a, v, v, np.zeros(3)) @ theta
    np.testing.assert_allclose(force, expected, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(force, pin.bodyRegressor(pin.Motion(v), pin.Motion(a)) @ theta, rtol=1e-11, atol=1e-9)


@given(SEEDS)
def test_the_coriolis_matrix_does_no_work_on_a_velocity_error(seed):
    rng, _, theta = random_body(seed)
    error, velocity = rng.normal(size=6), rng.normal(size=6)
    force = regressor(np.zeros(6), error, velocity, np.zeros(3)) @ theta
    assert abs(error @ force) < 1e-12 * (1.0 + np.abs(error * force).sum())


@settings(max_examples=20)
@given(SEEDS)
def test_nor_does_that_of_the_law_that_is_generated_whichever_way_a_body_turns(seed):
    """A crane that moves in a plane turns about one axis, where the order of two rates makes no difference."""
    rng, _, theta = random_body(seed)
    error, velocity = rng.normal(size=6), rng.normal(size=6)
    turning, required, still = (Twist(ca.SX(ca.DM(v[:3])), ca.SX(ca.DM(v[3:]))) for v in (velocity, error, 0.0 * error))
    y = np.array(ca.evalf(generated(BodyMotion(turning, required, still, ca.SX.zeros(3)))))
    assert abs(error @ y @ theta) < 1e-12 * (1.0 + np.abs(error * (y @ theta)).sum())
    np.testing.assert_allclose(y, regressor(np.zeros(6), error, velocity, np.zeros(3)), atol=1e-12)


@given(SEEDS)
def test_the_regressors_acceleration_part_is_the_mass_matrix(seed):
    rng, inertia, theta = random_body(seed)
    a, o = rng.normal(size=6), np.zeros(6)
    np.testing.assert_allclose(mass_matrix(theta), inertia.matrix(), atol=1e-9)
    np.testing.assert_allclose(regressor(a, o, o, np.zeros(3)) @ theta, inertia.matrix() @ a, atol=1e-8)


@given(SEEDS)
@pytest.mark.slow
def test_without_velocity_error_the_law_is_the_inverse_dynamics_of_the_closed_chain(seed):
    state, _, acceleration = random_motion(seed)
    motion = vdc.bodies(state, state.zd, acceleration)
    force = vdc.piston_forces(state, motion, vdc.net_forces(motion, vdc.parameters(crane().model), FIVE))
    expected = state.actuator_force(state.mass @ acceleration + state.bias)
    np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-6)


def flows(seed):
    """Flows of a machine whose actual accelerations are not the required ones."""
    state, rate, acceleration = random_motion(seed)
    theta = vdc.parameters(crane().model)
    motion, actual = vdc.bodies(state, rate, acceleration), vdc.bodies(state, state.zd, 0.5 * acceleration)
    difference = vdc.net_forces(motion, theta, FIVE) - vdc.net_forces(actual, theta, NONE)
    return power_flows(state, motion, difference)


def assert_flows_cancel(flow):
    """Rounding: 1e-10 of the largest flow."""
    scale = 1e-10 * (1.0 + np.abs(flow.outer).max())
    left = flow.outer - flow.inner + flow.damping
    names = list(crane().model.names)[1:]
    driven = [names.index(name) for name in crane().actuated]
    np.testing.assert_allclose(flow.balance, 0.0, atol=scale)  # Newton's third law, body by body
    np.testing.assert_allclose(left[driven], flow.pistons, atol=scale)  # a piston leaves what the cylinder takes up
    np.testing.assert_allclose(np.delete(left, driven), 0.0, atol=scale)  # a pin leaves nothing
    np.testing.assert_allclose(flow.eyes.sum(axis=1), 0.0, atol=scale)  # nor does an eye
    assert flow.bodies.sum() == pytest.approx(flow.pistons.sum() - flow.damping.sum(), abs=scale)


@settings(max_examples=30)
@given(SEEDS)
def test_virtual_power_flows_cancel_at_every_cut(seed):
    assert_flows_cancel(flows(seed))


def test_without_the_eyes_forces_the_flows_do_not_cancel(monkeypatch):
    monkeypatch.setattr("tests.oracle.vdc_flows.eye_forces", lambda *_: np.zeros((2, 3)))
    with pytest.raises(AssertionError):
        assert_flows_cancel(flows(0))


def test_without_a_body_of_a_cylinder_the_flows_do_not_cancel(monkeypatch):
    """The rod's net force is left out of what is resolved, and of nothing else."""
    state, rate, acceleration = random_motion(0)
    theta = vdc.parameters(crane().model)
    motion, actual = vdc.bodies(state, rate, acceleration), vdc.bodies(state, state.zd, 0.5 * acceleration)
    difference = vdc.net_forces(motion, theta, FIVE) - vdc.net_forces(actual, theta, NONE)
    without = difference.copy()
    without[list(crane().model.names).index("lift_piston") - 1] = 0.0
    complete = float(np.sum(motion.error * difference))
    flow = power_flows(state, motion, without)
    assert abs(complete - (flow.pistons.sum() - flow.damping.sum())) > 1e-6 * abs(complete)


def decay(seed, share=1.0):
    """Rate of nu under the law from the motion it causes, and what the theory says it is."""
    state, rate, acceleration = random_motion(seed)
    gains = vdc.VdcGains(piston=PISTON)
    controller = vdc.VdcController(crane(), gains)
    controller.theta = share * controller.theta
    required = vdc.Required(rate, acceleration)
    force, motion = controller.forces(state, required)
    actual = vdc.bodies(state, state.zd, state.acceleration(force))
    m = mass_matrix(vdc.parameters(crane().model))
    nu_rate = np.einsum("bi,bij,bj->", motion.error, m, motion.rate - actual.rate)
    piston = state.arms @ (rate - state.zd)
    pins = motion.tree_required - state.v
    loss = 5.0 * np.sum(motion.error**2) + PISTON @ piston**2 + crane().model.damping @ pins**2
    return float(nu_rate), float(-loss)


@settings(max_examples=30)
@given(SEEDS)
def test_the_accompanying_function_falls_at_the_rate_of_the_feedback_terms(seed):
    measured, theory = decay(seed)
    assert measured == pytest.approx(theory, rel=1e-7)


def without_coriolis(rate, required, velocity, gravity):
    return REGRESSOR(rate, required, 0.0 * velocity, gravity)


def without_gravity(rate, required, velocity, gravity):
    return REGRESSOR(rate, required, velocity, 0.0 * gravity)


def without_acceleration(rate, required, velocity, gravity):
    return REGRESSOR(0.0 * rate, required, velocity, gravity)


TERMS = [without_coriolis, without_gravity, without_acceleration]


@pytest.mark.parametrize("broken", TERMS)
def test_with_a_term_left_out_the_rate_is_not_the_theorys(monkeypatch, broken):
    monkeypatch.setattr(vdc, "regressor", broken)
    measured, theory = decay(0)
    assert measured != pytest.approx(theory, rel=1e-3)


GAINS = vdc.VdcGains(piston=PISTON, adaptation=300.0)


@pytest.mark.slow
def test_the_accompanying_function_never_grows_while_the_crane_moves_and_learns():
    """Inertias believed 10 % too small. 1e-9 of the start: what Runge-Kutta steps of 5 ms leave."""
    nu = Loop(GAINS, share=0.9).run()
    assert growth(nu) < 1e-9
    assert nu[-1] < 0.8 * nu[0]


@pytest.mark.slow  # at one instant it is asked above
@pytest.mark.parametrize("broken", TERMS)
def test_with_a_term_left_out_the_accompanying_function_grows(monkeypatch, broken):
    monkeypatch.setattr(vdc, "regressor", broken)
    assert growth(Loop(GAINS).run()) > 1e-6


@pytest.mark.slow
def test_without_learning_wrong_inertias_make_the_accompanying_function_grow():
    assert growth(Loop(GAINS, share=0.9, learn=False).run()) > 1e-3


@given(SEEDS)
@pytest.mark.slow
def test_projection_stops_at_a_bound_and_never_weakens_the_proof(seed):
    """(theta - theta^)(s - rate/rho) <= 0 for every true theta within the bounds."""
    rng = np.random.default_rng(seed)
    lower, upper = -rng.random(20), rng.random(20)
    estimate = np.where(rng.random(20) < 0.3, upper, np.where(rng.random(20) < 0.3, lower, 0.0))
    drive, true = rng.normal(size=20), rng.uniform(lower, upper)
    rate = projected_rate(estimate, drive, 7.0, lower, upper)
    assert np.all((true - estimate) * (drive - rate / 7.0) <= 1e-15)
    assert not np.any((estimate >= upper) & (rate > 0)) and not np.any((estimate <= lower) & (rate < 0))


@given(SEEDS)
def test_a_parameter_learns_along_its_drive_up_to_its_bound_and_not_past_any_truth_within_them(seed):
    """One step of dt: (theta - theta^)^2 changes by at most -2 dt (theta - theta^) rho s + (dt rho s)^2."""
    rng, dt = np.random.default_rng(seed), 1e-3
    lower, upper = -rng.random(20), rng.random(20)
    estimate, true = rng.uniform(lower, upper), rng.uniform(lower, upper)
    rate = 300.0 * rng.normal(size=20)
    after = adapt(estimate, rate, (lower, upper), dt)
    free = (after > lower) & (after < upper)
    np.testing.assert_allclose((after - estimate)[free], dt * rate[free], rtol=1e-9, atol=1e-15)
    assert np.all((after >= lower) & (after <= upper))
    left, most = (true - after) ** 2 - (true - estimate) ** 2, (dt * rate) ** 2 - 2.0 * dt * (true - estimate) * rate
    assert np.all(left <= most + 1e-12)


@given(SEEDS)
@pytest.mark.slow
def test_what_moves_as_required_has_the_target_impedance(seed):
    """D (X' - X_d') + K (X - X_d) = f, first order, with the velocity at its required value."""
    rng = np.random.default_rng(seed)
    state, _, _ = random_motion(seed)
    stiffness, damping = np.diag([1e5, 0.0, 3e4]), np.diag([2.5e4, 5e4, 1e4])
    force, path = rng.normal(size=3) * 1e3, Path(*(rng.normal(size=3) * 0.1 for _ in range(3)))
    inverse = np.linalg.inv(damping)
    required = required_motion(task(), state, path, inverse @ stiffness, inverse @ force)
    velocity = task().jacobian(state) @ required.rate
    residual = damping @ (velocity - path.velocity) + stiffness @ (task().position(state) - path.position) - force
    np.testing.assert_allclose(residual, 0.0, atol=1e-7)


@given(SEEDS)
@settings(max_examples=20)
def test_required_accelerations_are_the_rates_of_required_velocities(seed):
    """Central differences along the motion, f constant: 1e-5 is their truncation."""
    state, _, _ = random_motion(seed)
    h, path = 1e-5, Path(np.array([3.0, 1.0, 0.5]), np.array([0.1, 0.2, 0.0]), np.array([0.3, -0.1, 0.2]))

    def at(t):
        moved = Path(path.position + t * path.velocity, path.velocity + t * path.acceleration, path.acceleration)
        return required_motion(task(), crane().at(state.z + t * state.zd, state.zd), moved, 6.0 * np.eye(3))

    slope = (at(h).rate - at(-h).rate) / (2 * h)
    np.testing.assert_allclose(slope, at(0.0).acceleration, rtol=1e-5, atol=1e-5)


def test_a_task_that_does_not_command_every_freedom_is_refused():
    with pytest.raises(InputError, match="choose joints among"):
        ToolTask(crane(), np.eye(3)[[0, 2]], ())
    with pytest.raises(InputError, match="lift_piston do not command 3 freedoms"):
        ToolTask(crane(), np.eye(3)[[0, 2]], ("lift_piston",))


def test_a_force_on_the_tool_is_carried_by_the_pistons():
    """At rest: gravity's and the tool force's piston forces add up."""
    state = crane().at(START, np.zeros(3))
    motion = vdc.bodies(state, np.zeros(3), np.zeros(3))
    push = np.array([500.0, 0.0, 3000.0])
    needed = vdc.net_forces(motion, vdc.parameters(crane().model), FIVE)
    loaded = vdc.piston_forces(state, motion, needed, task().generalised(state, push))
    unloaded = state.holding_force()
    expected = unloaded - state.actuator_force(state.jacobian(crane().robot.tool_frames[0])[:3].T @ push)
    np.testing.assert_allclose(loaded, expected, rtol=1e-10)


def test_the_payload_changes_only_the_end_objects_parameters():
    light = vdc.parameters(load_model(with_payload(load_robot("hiab_xs031"), 100.0)).model)
    changed = np.any(light != vdc.parameters(crane().model), axis=1)
    assert list(np.flatnonzero(changed)) == [list(crane().model.names).index("extension") - 1]
