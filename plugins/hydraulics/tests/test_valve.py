"""Overlap and supply pressure of valves, from steady flows through edges whose overlap, supply and lag are known."""

from dataclasses import replace

import numpy as np
import pytest
from skillframe_hydraulics.checks.figures import EDGES
from skillframe_hydraulics.force.valve import ValveIdentification, ValveSettings
from skillframe_hydraulics.law.hydraulic import Measured, Terms
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.errors import SkillframeError
from skillframe.robot.spec import load_robot
from tests.oracle.valve_law import opening

CYLINDERS = cylinders(load_robot("hiab_xs031").actuation)
DT, SECONDS = 1e-3, 6.0
OVERLAP, SUPPLY = np.array([[0.0, 0.01, 0.03], [0.02, 0.005, 0.0]]), np.array([[150e5], [205e5]])
NOISE = 1e-3  # m/s of the piston rates, as of the crane's lift and tilt behind their filters


def machine(x, velocity, pressures):
    nothing = np.zeros((len(x), 1))
    measured = Measured(nothing, nothing, *pressures, nothing, nothing)
    return measured, Terms(*(nothing for _ in range(5)), x, velocity, nothing, nothing, nothing)


def steady(c, valve, overlap, supply):
    """(velocity, p_a, p_b) of a piston without load that follows its valve at once: both edges pass what it moves."""
    u, extends = opening(overlap, valve), valve > 0.0
    into, out = np.where(extends, c.area_a, c.area_b), np.where(extends, c.area_b, c.area_a)
    pushed = 20e5 * c.area_a  # a load, so that the pressures differ
    load = np.where(extends, pushed, -pushed)
    wide_in, wide_out = (np.where(extends, *each) for each in ((c.edge_pa, c.edge_pb), (c.edge_bt, c.edge_at)))
    share = (wide_in * out / (wide_out * into)) ** 2  # p_out - p_R over p_S - p_in
    filled = (np.abs(load) + out * (c.return_pressure + share * supply)) / (into + out * share)
    drained = c.return_pressure + share * (supply - filled)
    velocity = np.sign(u) * np.abs(u) * c.edge * wide_in * np.sqrt(supply - filled) / into
    return velocity, np.where(extends, filled, drained), np.where(extends, drained, filled)


def found(lag=0, true=OVERLAP, size=0.15, seed=0, believed=CYLINDERS, breath=0.0, **settings):
    """Slow swings of the valves, seen `lag` ticks late, rates noisy, and so much breath [Pa] in the pressures."""
    rng, known = np.random.default_rng(seed), ValveIdentification(believed, 2, DT, ValveSettings(**settings))
    times = np.arange(round(SECONDS / DT)) * DT
    valve = size * np.sin(2 * np.pi * times[:, None, None] / 3.0 + np.arange(3)) * np.ones((1, 2, 1))
    x = np.full((2, 3), 0.3)
    for k in range(1, len(times)):
        velocity, p_a, p_b = steady(believed, valve[max(0, k - 1 - lag)], true, SUPPLY)
        seen = velocity + NOISE * rng.normal(size=(2, 3))
        breathed = breath * np.sin(2 * np.pi * times[k] / 0.7)
        known.step(valve[k - 1], *machine(x, seen, (p_a + breathed, p_b + breathed)))
    known.solve()
    return known


@pytest.mark.parametrize(("lag", "edges"), [(0, (1.0,) * 4), (20, (1.0,) * 4), (0, (0.8, 0.6, 1.5, 1.2))])
@pytest.mark.slow
def test_overlap_supply_and_lag_are_found_from_noisy_flows(lag, edges):
    """Overlap to 4 deviations and 2e-3 of the travel; the command's filter lags 13 ms by itself."""
    own = {name: np.full(3, share) for name, share in zip(EDGES, edges, strict=True)}
    known = found(lag, believed=replace(CYLINDERS, **own))
    error = np.abs(known.overlap - OVERLAP)
    assert np.all(error < 4.0 * known.overlap_deviation)
    assert error.max() < 2e-3
    assert known.overlap_deviation.max() < 2e-3
    np.testing.assert_allclose(known.supply, np.tile(SUPPLY, 3), atol=2e5)
    assert np.all(np.abs(known.lag - max(0.0, 1e-3 * lag - 0.013)) <= 0.008)


def test_what_softer_oil_would_change_is_what_a_fit_with_softer_oil_finds():
    """Without priors, at one lag the fit is linear in the openings, and goes just as far by itself.

    So for the tilt. The others have rows that count with one oil and not with the other.
    """
    soft = replace(CYLINDERS, bulk_modulus=0.95 * CYLINDERS.bulk_modulus)
    alone = {"breath": 1e5, "share": 1e3, "overlap": 1e3, "supply": 1e9, "lags": 1, "squeezed": 1e9, "oil": 0.05}
    known, other = (found(believed=c, **alone) for c in (CYLINDERS, soft))
    np.testing.assert_allclose(known.overlap_oil[:, 1], np.abs(other.overlap - known.overlap)[:, 1], rtol=0.01)
    np.testing.assert_allclose(known.supply_oil[:, 1], np.abs(other.supply - known.supply)[:, 1], rtol=0.01)


def test_two_deviations_of_the_oil_cover_one_of_0_7_of_the_modulus_that_is_believed():
    """It is compressed 1 / 0.7 times as much; campaigns draw 0.7 to 1.3."""
    assert 1.0 + 2.0 * (1.0 / (1.0 - ValveSettings().oil) - 1.0) >= 1.0 / 0.7


def test_a_few_rows_that_lie_on_a_line_by_chance_are_no_overlap():
    """Five rows in which a piston keeps its speed while the command rises by a fifth, alone a slope of zero."""
    known = ValveIdentification(CYLINDERS, 1, DT)
    valve = np.full((1, 3), 0.06)
    velocity, *pressures = steady(CYLINDERS, valve, np.zeros(3), 190e5)
    for k in range(60):
        known.step(valve + 2e-4 * k, *machine(np.full((1, 3), 0.3), velocity, pressures))
    known.solve()
    assert np.all(np.abs(known.overlap) < 2.0 * known.overlap_deviation)
    assert np.all(np.abs(known.ratio - 1.0) < 2.0 * known.settings.share)


@pytest.mark.slow
def test_what_is_compensated_lies_a_deviation_below_what_was_found_and_never_below_zero():
    known = found(true=0.0 * OVERLAP)
    assert np.all(known.compensated >= 0.0)
    assert np.all(known.compensated <= np.maximum(known.overlap, 0.0))


@pytest.mark.slow
def test_valves_that_hardly_open_say_nothing_and_leave_what_is_nominal():
    known = found(size=0.015)
    np.testing.assert_allclose(known.overlap, np.tile(CYLINDERS.deadband, (2, 1)))
    np.testing.assert_allclose(known.overlap_deviation, known.settings.overlap)
    np.testing.assert_allclose(known.supply, np.tile(CYLINDERS.supply_pressure, (2, 1)))


@pytest.mark.slow
def test_a_supply_far_from_the_nominal_one_is_not_believed():
    known = found(reach=0.05)
    np.testing.assert_allclose(known.supply[0], 0.95 * CYLINDERS.supply_pressure)


@pytest.mark.parametrize("name", ["period", "drop", "overlap"])
def test_a_setting_that_is_not_positive_is_refused(name):
    with pytest.raises(SkillframeError, match=f"{name} must be positive"):
        ValveSettings(**{name: 0.0})
