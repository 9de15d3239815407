"""The crane hiab_xs031 against its published figures, and the laws of closed chains by loop embedding."""

import math
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_hydraulics.checks.feasibility import capacity, problems, require_feasible
from skillframe_hydraulics.cylinder.bank import instance_parameters
from skillframe_hydraulics.law.vdc_actuator import Cylinders, cylinders

from skillframe.errors import InputError, UnknownName
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain, OutOfReach
from skillframe.robot.model import load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import load_robot
from tests.references import chain_step

START = np.array([math.pi / 4, -math.pi / 2, 0.5])  # published
AREA_A = math.pi / 4 * 0.080**2
AREA_B = AREA_A - math.pi / 4 * 0.045**2
LIFT, TILT = (1.0071227324212, 0.37610632101293), (1.132185817991, 0.30901132665325)  # sides of the triangles [m]
LIFT_OFFSET = math.pi / 2 + math.atan2(374.261, 935) + math.atan2(45.757, 373.313)
TILT_OFFSET = math.atan2(139.5, 1132.19) + math.atan2(88.061, 296.198)
INSIDE = st.tuples(st.floats(-0.15, 1.6), st.floats(-2.5, -0.15), st.floats(0.0, 1.1)).map(np.array)
RATES = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)


@cache
def crane():
    return ClosedChain(load_model(load_robot("hiab_xs031")))


def triangle(sides, q):
    """Position and moment arm of a piston whose triangle's sides enclose the angle pi - q, closed length 0.83 m."""
    long, short = sides
    length = math.sqrt(long**2 + short**2 + 2 * long * short * math.cos(q))
    return length - 0.83, -long * short * math.sin(q) / length


def test_the_crane_loads_is_usable_and_stands_at_the_published_start():
    spec = load_robot("hiab_xs031")
    assert audit(spec).usable
    chain = crane()
    assert chain.independent == ("lift", "tilt", "extension")
    np.testing.assert_allclose(chain.robot.home, chain.configuration(START), atol=1e-12)  # printed digits of robot.toml


@given(INSIDE)
@pytest.mark.slow
def test_the_loops_are_closed_to_rounding(z):
    assert np.abs(crane().gaps(crane().configuration(z))).max() < 1e-12


@given(INSIDE)
@pytest.mark.slow
def test_pistons_and_moment_arms_follow_the_published_triangles(z):
    state = crane().at(z, np.zeros(3))
    lift, tilt = triangle(LIFT, z[0] - LIFT_OFFSET), triangle(TILT, z[1] - TILT_OFFSET)
    np.testing.assert_allclose(state.driven_motion[0], [lift[0], tilt[0], z[2]], atol=1e-12)
    np.testing.assert_allclose(state.arms, np.diag([lift[1], tilt[1], 1.0]), atol=1e-12)


@given(INSIDE)
@pytest.mark.slow
def test_the_tool_stands_where_the_published_closed_form_says(z):
    """The closed form is printed with six digits: 1e-5 m is its rounding over 5 m of reach."""
    (t1, t2, x), (c1, s1) = z, (math.cos(z[0]), math.sin(z[0]))
    c2, s2, a = math.cos(t2), math.sin(t2), -0.00152855 - 0.000928646 * x
    forward = -0.189261 + (1.99949 + x) * math.cos(t1 + t2) + (-0.100002 + a * c2) * s1
    forward += c1 * (1.59687 + a * s2) - 0.152638 * math.sin(t1 + t2)
    up = 0.85 + s1 * (1.59687 + (1.99949 + x) * c2 + (-0.154167 - 0.000928646 * x) * s2)
    up += c1 * (0.100002 + (0.154167 + 0.000928646 * x) * c2 + (1.99949 + x) * s2)
    state = crane().at(z, np.zeros(3))
    tool = state.data.oMf[crane().robot.tool_frames[0]].translation
    np.testing.assert_allclose(tool, [forward, 0.0092303, up], atol=1e-5)


def test_static_piston_forces_agree_with_the_published_pressures():
    """Within 2 %: the pressures are rounded start values of a simulation, not an equilibrium."""
    force = crane().at(START, np.zeros(3)).holding_force()
    np.testing.assert_allclose(force[0], AREA_A * 130e5 - AREA_B * 30.9148e5, rtol=0.02)
    np.testing.assert_allclose(force[1], AREA_A * 90e5 - AREA_B * 35.7169e5, rtol=0.02)


@given(INSIDE, RATES)
@pytest.mark.slow
def test_velocities_and_their_drift_are_derivatives_of_the_configuration(z, zd):
    h, state = 1e-6, crane().at(z, zd)
    ahead, behind = crane().at(z + h * zd, zd), crane().at(z - h * zd, zd)
    # central differences: rounding of q (1e-16) over h, and curvature near the dead centre times h^2
    np.testing.assert_allclose((ahead.q - behind.q) / (2 * h), state.v, atol=1e-7)
    np.testing.assert_allclose((ahead.v - behind.v) / (2 * h), state.drift, atol=1e-6)


@given(INSIDE, RATES)
@pytest.mark.slow
def test_the_tools_jacobian_and_its_drift_are_derivatives(z, zd):
    h, frame = 1e-6, crane().robot.tool_frames[0]
    states = [crane().at(z + k * h * zd, zd) for k in (-1, 0, 1)]
    places = [s.data.oMf[frame].translation.copy() for s in states]
    rates = [s.jacobian(frame)[:3] @ zd for s in states]
    np.testing.assert_allclose((places[2] - places[0]) / (2 * h), rates[1], atol=1e-8)
    np.testing.assert_allclose((rates[2] - rates[0]) / (2 * h), states[1].jacobian_drift(frame, zd)[:3], atol=1e-6)


@given(INSIDE, RATES, RATES)
@pytest.mark.slow
def test_reduced_forces_have_the_power_of_the_trees_forces(z, zd, force):
    """F' xd = tau_z' zd for pistons, and for any forces of the tree projected by G."""
    state = crane().at(z, zd)
    assert force @ state.driven_motion[1] == pytest.approx((state.arms.T @ force) @ zd, abs=1e-14)
    tree = np.concatenate([force, force, force[:1]])
    assert tree @ state.v == pytest.approx((state.embedding.T @ tree) @ zd, abs=1e-13)


@given(INSIDE, RATES, RATES)
@pytest.mark.slow
def test_the_reduced_equations_agree_with_a_constrained_solver(z, zd, force):
    """Independent: multipliers in the tree's coordinates. Out-of-plane rows of the loops are zero, hence lstsq."""
    state = crane().at(z, zd)
    model, data = crane().model, crane().model.createData()
    drive = np.zeros(model.nv)
    drive[crane().driven] = 1e4 * force
    drive -= pin.rnea(model, data, state.q, state.v, np.zeros(model.nv)) + model.damping * state.v
    a = state.constraint
    system = np.block([[state.tree_mass, -a.T], [a, np.zeros((len(a), len(a)))]])
    right = np.concatenate([drive, -state.constraint_rate @ state.v])
    tree = np.linalg.lstsq(system, right, rcond=1e-13)[0][: model.nv]
    np.testing.assert_allclose(state.acceleration(1e4 * force), crane().minimal(tree), rtol=1e-7, atol=1e-6)


def test_gravity_is_the_slope_of_potential_energy():
    h, slope = 1e-5, []
    for axis in np.eye(3):
        high, low = (crane().at(START + k * h * axis, np.zeros(3)).energy()[1] for k in (1, -1))
        slope.append((high - low) / (2 * h))
    np.testing.assert_allclose(
        crane().at(START, np.zeros(3)).gravity, slope, rtol=1e-7
    )  # h^2 and rounding of 1e4 J / h


@pytest.mark.slow
def test_energy_is_conserved_but_for_joint_damping_while_the_crane_swings():
    """0.5 s under held forces off balance: energy gained is the pistons' work less the pins' damping, both integrated.

    1e-7 relative is what Simpson's rule over 1 ms steps leaves."""
    chain, dt = crane(), 1e-3
    z, zd = START, np.zeros(3)
    force = chain.at(z, zd).holding_force() + np.array([2000.0, -1500.0, 1000.0])
    start, powers = sum(chain.at(z, zd).energy()), []
    for _ in range(500):
        powers.append(power(chain, z, zd, force))
        z, zd = chain_step(chain, z, zd, force, dt)
    powers.append(power(chain, z, zd, force))
    p = np.array(powers)
    supplied = dt / 3 * (p[0] + p[-1] + 4 * p[1:-1:2].sum() + 2 * p[2:-1:2].sum())
    gained = sum(chain.at(z, zd).energy()) - start
    assert abs(z - START).max() > 0.05  # it moved
    assert gained == pytest.approx(supplied, rel=1e-7)


def power(chain, z, zd, force):
    state = chain.at(z, zd)
    return force @ state.driven_motion[1] - state.v @ (chain.model.damping * state.v)


def test_a_rod_that_cannot_reach_is_named(save, urdf):
    chain = ClosedChain(load_model(load_robot(save(swing(urdf, 2.0), LOOP))))
    assert np.abs(chain.gaps(chain.configuration(np.array([0.7])))).max() < 1e-12
    short = ClosedChain(load_model(load_robot(save(swing(urdf, 0.3, offset=1.0), LOOP, name="short"))))
    with pytest.raises(OutOfReach, match="the loop eye - rod_eye cannot close in this configuration"):
        short.configuration(np.array([3.0]))


LOOP = '[[arm]]\nname = "arm"\ntool_frame = "eye"\n[[loop]]\nframe_a = "eye"\nframe_b = "rod_eye"'


def swing(urdf, height, offset=0.0):
    """A link on a hinge, moved by a cylinder whose rod runs `offset` beside the barrel's pivot."""
    wide = '<limit lower="-3.1" upper="3.1" effort="50" velocity="2"/>'
    body = urdf.inertial(5.0, 0.5)
    return urdf.robot(
        urdf.link("base"), urdf.link("arm", body), urdf.link("eye"), urdf.link("barrel", body),
        urdf.link("rod", body), urdf.link("rod_eye"),
        urdf.joint("hinge", "base", "arm", xyz=f"0 0 {height}", inside=wide),
        urdf.joint("eye_mount", "arm", "eye", "fixed", xyz="0 0 0.4", inside=""),
        urdf.joint("pivot", "base", "barrel", xyz="0 0.8 0", inside=wide),
        urdf.joint("piston", "barrel", "rod", "prismatic", "0 0 1", f"0 {offset} 0.2"),
        urdf.joint("rod_eye_mount", "rod", "rod_eye", "fixed", xyz="0 0 0.1", inside=""),
    )  # fmt: skip


def test_a_loop_that_a_joint_does_not_move_and_a_frame_that_does_not_exist_are_refused(save, urdf):
    with pytest.raises(InputError, match="the joint pivot does not move the loop eye - barrel"):
        ClosedChain(load_model(load_robot(save(swing(urdf, 2.0), LOOP.replace("rod_eye", "barrel")))))
    with pytest.raises(InputError, match="the loop eye - arm joins two frames of one body"):
        ClosedChain(load_model(load_robot(save(swing(urdf, 2.0), LOOP.replace('"rod_eye"', '"arm"')))))
    with pytest.raises(UnknownName, match="did you mean 'rod_eye'"):
        ClosedChain(load_model(load_robot(save(swing(urdf, 2.0), LOOP.replace("rod_eye", "rodd_eye")))))


def test_a_payload_scales_the_end_object_and_475_kg_is_the_published_crane():
    spec = load_robot("hiab_xs031")
    full, empty = (load_model(with_payload(spec, m)).model for m in (475.0, 0.0))
    tool = crane().model.getJointId("extension")
    np.testing.assert_allclose(
        full.inertias[tool].toDynamicParameters(), crane().model.inertias[tool].toDynamicParameters(), rtol=1e-14
    )
    masses = [sum(i.mass for i in m.inertias) for m in (full, empty)]
    assert masses[0] - masses[1] == pytest.approx(475.0, rel=1e-12)
    force = ClosedChain(load_model(with_payload(spec, 380.0))).at(START, np.zeros(3)).holding_force()
    # published: with 475 kg instead of 570 kg at the tip 47.05 / 28.10 kN, taken as a smaller end object
    np.testing.assert_allclose(force[:2], [47.05e3, 28.10e3], rtol=2e-3)


@pytest.mark.parametrize("mass", [475.1, -1.0, math.nan])
def test_a_payload_above_the_rating_is_refused(mass):
    with pytest.raises(InputError, match="not within 0 and the rating of 475 kg"):
        with_payload(load_robot("hiab_xs031"), mass)


def test_a_robot_without_payload_says_so():
    with pytest.raises(InputError, match="declares no payload"):
        with_payload(load_robot("panda"), 1.0)


def test_the_lift_cylinder_pushes_and_pulls_what_the_areas_say():
    limit = capacity(crane().robot.spec.actuation[0])
    assert limit.push == pytest.approx(AREA_A * 190e5 - AREA_B * 10e5)
    assert limit.pull == pytest.approx(AREA_B * 190e5 - AREA_A * 10e5)


def told(robot, without=()):
    """A robot whose lift cylinder is another maker's: `parameters` are its own names, ours stand under `nominal`."""
    lift, *rest = robot.actuation
    values = {name: value for name, value in lift.parameters.items() if name not in without}
    return replace(robot, actuation=[replace(lift, fmu="winch.fmu", parameters={"d": 0.08}, nominal=values), *rest])


def test_what_is_nominal_of_another_makers_cylinder_is_known_to_capacity_and_law_as_our_own_parameters_are():
    own, other = load_robot("hiab_xs031").actuation, told(load_robot("hiab_xs031")).actuation
    assert capacity(other[0]) == capacity(own[0])
    for field in fields(Cylinders):
        assert np.array_equal(getattr(cylinders(own), field.name), getattr(cylinders(other), field.name)), field.name


def test_another_makers_cylinder_of_which_too_little_is_known_is_refused_with_what_is_missing():
    other = told(load_robot("hiab_xs031"), without=("bore", "leakage")).actuation
    with pytest.raises(InputError, match=r"lift_piston has no bore, leakage; add it to parameters or nominal"):
        cylinders(other)


def test_the_force_held_at_the_start_goes_to_the_parameter_that_the_robot_names():
    robot = told(load_robot("hiab_xs031"))
    hold = np.array([[5e4, 3e4, 1e4]])
    assert [sorted(row) for row in instance_parameters(robot, {}, hold)] == [[], ["initial_force"], ["initial_force"]]
    named = replace(robot, actuation=[replace(robot.actuation[0], initial_force="F0"), *robot.actuation[1:]])
    assert instance_parameters(named, {}, hold)[0] == {"F0": 5e4}


def test_varying_a_friction_that_the_fmu_does_not_have_is_refused():
    draws = {"actuator.friction_scale": np.array([1.2])}
    with pytest.raises(InputError, match="no actuator parameter is called coulomb_friction"):
        instance_parameters(told(load_robot("hiab_xs031")), draws, np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("z", "sentence"),
    [
        ((0.0, math.radians(-17.0), 1.0), "tilt_piston would have to push 9[67].. kN, more than the 92.1 kN"),
        ((1.655, -1.5, 0.5), "lift_piston would have to push 103.1 kN"),
        ((0.8, -1.5, 1.2), "extension would stand at 1.2, outside 0 to 1.1"),
        ((2.02, -1.5, 0.5), "lift_piston is near its dead centre: its moment arm is 0.0.. m"),
    ],
)
def test_an_infeasible_configuration_is_refused_with_its_number(z, sentence):
    require_feasible(crane(), START)
    with pytest.raises(InputError, match=sentence):
        require_feasible(crane(), np.array(z))


@settings(max_examples=20)
@given(st.floats(0.3, 1.2), st.floats(-2.3, -1.0), st.floats(0.0, 0.9))
def test_what_is_called_feasible_can_be_held_within_supply_and_return_pressure(lift, tilt, extension):
    z = np.array([lift, tilt, extension])
    if problems(crane(), z):
        return
    for actuation, force in zip(crane().robot.spec.actuation, crane().at(z, np.zeros(3)).holding_force(), strict=True):
        p, a = actuation.parameters, math.pi / 4 * actuation.parameters["bore"] ** 2
        b = a - math.pi / 4 * p["rod"] ** 2
        pa = np.clip((force + b * p["return_pressure"]) / a, p["return_pressure"], p["supply_pressure"])
        pb = (a * pa - force) / b
        assert p["return_pressure"] * (1 - 1e-9) <= pb <= p["supply_pressure"] * (1 + 1e-9)
