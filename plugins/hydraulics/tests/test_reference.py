"""The cylinder without a compiler: the same equations in numpy and in casadi, and each cylinder by itself."""

import numpy as np
import pytest
from skillframe_hydraulics.cylinder.bank import open_cylinders
from skillframe_hydraulics.cylinder.reference import ReferenceBank

from skillframe.fmu.actuator import DISCARD, ActuatorSpec
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.table import read_table
from tests.unit.fmu.fmu_fakes import Swing

H = 1e-3
SMALL = {"dead_volume_a": 3e-4, "dead_volume_b": 3e-4}
EVERYTHING = SMALL | {
    "deadband": 0.1, "hysteresis": 0.02, "air_fraction": 0.01, "static_friction": 6000.0, "cushion_length": 0.35
}  # fmt: skip
PLAIN = [{}, {"deadband": 0.05, "supply_pressure": 15e6}, {"coulomb_friction": 1000.0, "static_friction": 1000.0}]
HELD = SMALL | {"counterbalance_b": 250e5, "pilot_ratio": 2.0, "edge_bt": 4.0}
MIXED = [EVERYTHING, {}, SMALL | {"edge_pa": 0.5, "edge_bt": 2.0}, HELD]


def bank(sets, **settings):
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    return ReferenceBank([ActuatorSpec(fmu="hydraulic_cylinder", parameters=p) for p in sets], table, **settings)


def history(b, steps=120, commands=None):
    """Outputs at every step and refresh on a swing that reverses, with random commands."""
    swing, rng, found = Swing(), np.random.default_rng(3), []
    drawn = rng.uniform(-1.2, 1.2, (steps // 20 + 1, b.count)) if commands is None else commands
    b.u[:, 1:3] = swing.at(0.0)[:2]
    b.start()
    for k in range(steps):
        b.u[:, 0], b.u[:, 1:4] = drawn[k // 20], swing.at(k * H)
        assert b.step(k * H, H)
        found.append(b.y.copy())
        b.u[:, 1] += 1e-5
        assert b.refresh()
        found.append(b.y.copy())
    return np.array(found)


@pytest.mark.parametrize("sets", [PLAIN, pytest.param(MIXED, marks=pytest.mark.slow)])
def test_expressions_and_arrays_give_the_same_cylinder(sets):
    fast, plain = (history(bank(sets, symbolic=symbolic), 60) for symbolic in (True, False))
    # powers and exponentials of two libraries differ in the last bit, and sixty steps of a damped system keep that
    scale = np.abs(plain).max(axis=(0, 1))
    assert np.all(np.abs(fast - plain) <= 1e-12 * scale)


@pytest.mark.parametrize("symbolic", [True, False])
@pytest.mark.slow
def test_a_cylinders_numbers_do_not_depend_on_those_beside_it(symbolic):
    sets = [*PLAIN, HELD]
    commands = np.random.default_rng(4).uniform(-1.0, 1.0, (4, len(sets)))
    together = history(bank(sets, symbolic=symbolic), 60, commands)
    for i, one in enumerate(sets):
        alone = history(bank([one], symbolic=symbolic), 60, commands[:, i : i + 1])
        np.testing.assert_array_equal(together[:, i], alone[:, 0])


@pytest.mark.parametrize("symbolic", [True, False])
@pytest.mark.parametrize("column", range(4))
def test_a_step_with_an_input_that_is_no_number_is_refused_and_changes_nothing(symbolic, column):
    b = bank(PLAIN, symbolic=symbolic)
    history(b, 20)
    b.save()
    kept = b.u.copy()
    b.step(0.02, H)
    expected = b.y.copy()
    b.restore()
    b.u[1, column] = np.nan
    assert not b.step(0.02, H)
    assert b.status.tolist() == [0, DISCARD, 0]
    assert "no finite pressures" in b.problem(1)
    np.testing.assert_array_equal(b.y[[0, 2]], expected[[0, 2]])
    b.u[:] = kept
    assert b.step(0.02, H)
    np.testing.assert_array_equal(b.y[1], expected[1])


def test_what_has_ended_stands_still_while_the_others_go_on():
    b, c = bank(PLAIN), bank(PLAIN)
    for each in (b, c):
        history(each, 20)
    before = b.y[1].copy()
    b.active[1] = 0
    for each in (b, c):
        each.step(0.02, H)
    np.testing.assert_array_equal(b.y[[0, 2]], c.y[[0, 2]])
    np.testing.assert_array_equal(b.y[1], before)


def test_without_a_compiler_the_python_reference_takes_over_and_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    bank = open_cylinders([ActuatorSpec(fmu="hydraulic_cylinder")], trials=2)
    assert type(bank).__name__ == "ReferenceBank" and "no C compiler" in bank.notes[0]
    bank.u[:, 1] = 0.3
    bank.start()
    assert bank.step(0.0, 1e-3) and np.isfinite(bank.y).all()
