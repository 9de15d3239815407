"""Gains that follow from a machine's figures: what they go with, what stands, and that the loop then rests."""

import dataclasses

import numpy as np
import pytest
from skillframe_hydraulics.law.gains import derived_gains, law_gains, least_spring, missing_gains, with_derived_gains
from skillframe_hydraulics.law.hydraulic import HydraulicGains
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.extend.drives import with_derived
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import load_robot
from tests.digger import write_digger
from tests.laws.machine_loop import least_damping, poles

LAG, OMEGA_H = 0.022, 40.0


@pytest.fixture(scope="module")
def digger(tmp_path_factory):
    return load_model(load_robot(str(write_digger(tmp_path_factory.mktemp("digger")))))


def of(robot):
    return derived_gains(ClosedChain(robot))


def changed(robot, **tables):
    spec = robot.spec
    merged = {name: {**spec.tables.get(name, {}), **values} for name, values in tables.items()}
    return load_model(dataclasses.replace(spec, tables={**spec.tables, **merged}))


def oiled(robot, **figures):
    """Of cylinders whose figures are so many times as large."""
    drives = tuple(
        dataclasses.replace(a, parameters={**a.parameters, **{n: f * a.parameters[n] for n, f in figures.items()}})
        for a in robot.spec.actuation
    )
    return load_model(dataclasses.replace(robot.spec, actuation=drives))


def test_the_least_spring_is_the_softest_oil_within_the_stroke(digger):
    c = cylinders(digger.spec.actuation)
    x = np.linspace(0.0, 1.0, 20001)[:, None] * c.stroke
    every = c.area_a / (c.arm_a + x) + c.area_b / (c.arm_b + c.stroke - x)
    np.testing.assert_allclose(least_spring(c), every.min(axis=0), rtol=1e-6)  # the grid's own coarseness


def test_what_robot_toml_gives_stands_and_the_rest_is_derived(tmp_path):
    path = write_digger(tmp_path, "[gains]\nbody = 77.0", extra={"stick": "velocity_gain = 1e-3"})
    robot = load_model(load_robot(str(path)))
    derived, found = of(robot), law_gains(ClosedChain(robot))
    assert found.body == 77.0 and found.velocity[1] == 1e-3
    assert found.velocity[::2] == tuple(derived.velocity[::2]) and found.force == tuple(derived.force)
    assert "velocity_gain of stick_piston" not in missing_gains(robot.spec)
    assert not missing_gains(with_derived_gains(robot).spec)


def test_robots_that_are_no_hydraulic_machines_have_no_gains_to_derive():
    for name in ("panda", "panda_servo", "hiab_xs031"):
        robot = load_model(load_robot(name))
        assert with_derived(robot) == (robot, [])


def test_slower_filters_bear_less_damping_of_bodies(digger):
    usual = of(digger)
    slow = of(changed(digger, sensors={"corner_hz": 12.0}, gains={"force_corner_hz": 8.0}))
    # T' is 1/(12 pi) + 1/(8 pi) + 9 ms where it was 1/(24 pi) + 1/(16 pi) + 9 ms
    ratio = (1 / (24 * np.pi) + 1 / (16 * np.pi) + 9.002e-3) / (1 / (12 * np.pi) + 1 / (8 * np.pi) + 9.002e-3)
    assert slow.body == pytest.approx(ratio * usual.body, rel=1e-3)  # the spool's lag is rounded in `ratio`
    np.testing.assert_array_equal(slow.velocity, usual.velocity)


def test_stiffer_oil_is_the_oils_own_business_and_less_volume_asks_for_more(digger):
    """k_x times the bulk modulus is a share of the oil's spring, k_f times it a rate."""
    usual, stiff = of(digger), of(oiled(digger, bulk_modulus=2.0))
    np.testing.assert_allclose(stiff.velocity, usual.velocity)
    np.testing.assert_allclose(stiff.force, 0.5 * usual.force)
    small = of(oiled(digger, dead_volume_a=0.25, dead_volume_b=0.25))
    assert np.all(small.velocity > 1.1 * usual.velocity)


def test_noisy_encoders_make_the_gains_smaller(digger):
    usual, noisy = of(digger), of(changed(digger, sensors={"encoder": 1e-2}))
    assert np.all(noisy.velocity < 0.5 * usual.velocity) and noisy.body < 0.5 * usual.body
    assert noisy.body / usual.body == pytest.approx(noisy.velocity[0] / usual.velocity[0])


@pytest.mark.parametrize(("share", "grows"), [(0.3, False), (0.7, False), (1.3, True)])
def test_a_share_of_the_oils_spring_below_one_dies_away_and_above_one_grows(share, grows):
    """One mass on oil, Euler's steps of 50 us: f' = k_h ((1 - kappa) v(t - T) - v), as the module's equation says."""
    h, mass = 5e-5, 1.0
    late = round(LAG / h)
    v, f, past, seen = 0.1, 0.0, np.zeros(late), []
    for i in range(round(1.5 / h)):
        then, past[i % late] = past[i % late], v
        f += h * OMEGA_H**2 * ((1.0 - share) * then - v)
        v += h * f / mass
        seen.append(abs(v))
    window = round(0.3 / h)
    first, last = max(seen[:window]), max(seen[-window:])
    assert (last > first) if grows else (last < 0.2 * first)


def test_a_linear_model_of_the_loop_says_that_the_digger_rests_by_its_own_gains_and_rings_by_the_cranes(digger):
    gains = law_gains(ClosedChain(digger))
    for load in (60.0, 0.0):
        robot = load_model(with_payload(digger.spec, load))
        assert least_damping(poles(robot, gains)) > 0.2  # 0.30 full, 0.22 empty
        assert least_damping(poles(robot, gains, delay=0.02)) > 0.05  # valves that are 20 ms late
        assert poles(robot, HydraulicGains()).real.max() > 1.0  # 1/s: it grows


def test_gains_derived_for_the_crane_that_ships_would_damp_it_better_than_its_own():
    crane = load_model(load_robot("hiab_xs031"))
    found = derived_gains(ClosedChain(crane))
    derived = HydraulicGains(velocity=tuple(found.velocity), force=tuple(found.force), body=found.body)
    for load in (475.0, 0.0):
        robot = load_model(with_payload(crane.spec, load))
        assert least_damping(poles(robot, derived)) > least_damping(poles(robot, HydraulicGains())) > 0.05
