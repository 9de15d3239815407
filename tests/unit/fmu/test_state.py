"""State: repeats to the bit, survives bytes, and refusals leave an instance as it was."""

import ctypes

import numpy as np
import pytest
from fmu_fakes import Swing, bank

from skillframe.fmu.bindings import Instance, InstanceFailed

H = 1e-3
EVERYTHING = {"deadband": 0.05, "hysteresis": 0.02, "air_fraction": 0.01, "static_friction": 6e3}


def drive(b, swing, first, last, seed=3):
    rows = []
    for k in range(first, last):
        b.u[:, 0] = np.random.default_rng(seed + k // 10).uniform(-1, 1)
        b.u[:, 1:4] = swing.at(k * H)
        assert b.step(k * H, H)
        rows.append(b.y.copy())
    return np.array(rows)


def test_a_restored_state_repeats_every_output_to_the_bit(cylinder):
    b, swing = bank(cylinder, EVERYTHING), Swing()
    b.start()
    drive(b, swing, 0, 37)
    b.save()
    first = drive(b, swing, 37, 90)
    b.restore()
    np.testing.assert_array_equal(drive(b, swing, 37, 90), first)
    b.close()


def test_a_reset_instance_repeats_a_fresh_one_to_the_bit(cylinder):
    b, swing = bank(cylinder, EVERYTHING), Swing()
    b.start()
    first = drive(b, swing, 0, 50)
    b.u[:] = 0.0
    b.u[:, 1] = 0.3
    b.start()
    np.testing.assert_array_equal(drive(b, swing, 0, 50), first)
    b.close()


def test_the_compiled_and_the_ctypes_stepper_agree_to_the_bit(cylinder):
    rows = []
    for compiled in (True, False):
        b = bank(cylinder, EVERYTHING, {}, compiled=compiled)
        assert b.compiled == compiled
        b.start()
        rows.append(drive(b, Swing(), 0, 50))
        b.close()
    np.testing.assert_array_equal(rows[0], rows[1])


def test_results_do_not_depend_on_how_many_trials_step_together(cylinder):
    from skillframe.fmu.actuator import ActuatorSpec
    from skillframe.fmu.driver import FmuBank

    spec = ActuatorSpec(fmu="x", parameters=EVERYTHING)
    many, one = FmuBank([spec], [cylinder], trials=7), FmuBank([spec], [cylinder])
    for b in (many, one):
        b.u[:, 1] = 0.3
        b.start()
    a, c = drive(many, Swing(), 0, 30), drive(one, Swing(), 0, 30)
    np.testing.assert_array_equal(a, np.broadcast_to(c, a.shape))
    many.close()
    one.close()


def test_a_serialised_state_continues_in_another_instance_to_the_bit(cylinder):
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    first, second = Instance(cylinder, "first"), Instance(cylinder, "second")
    for x in (first, second):
        x.start({"initial_force": 2e4}, {0: 0.3, 1: 0.3}, 0.0)
    for k in range(20):
        first.do_step(k * H, H)
    fmu: FMU2Slave | FMU3Slave = first._fmu
    two = first.version == 2
    state = fmu.getFMUstate() if two else fmu.getFMUState()
    data = fmu.serializeFMUstate(state) if two else fmu.serializeFMUState(state)
    other = second._fmu
    copy = other.deSerializeFMUstate(data) if two else other.deserializeFMUState(data)
    other.setFMUstate(copy) if two else other.setFMUState(copy)
    kind = "Real" if two else "Float64"
    for k in range(20, 40):
        first.do_step(k * H, H)
        second.do_step(k * H, H)
        assert first.get_values(kind, list(range(5, 16)), 11) == second.get_values(kind, list(range(5, 16)), 11)
    first.close()
    second.close()
    assert isinstance(data, bytes | ctypes.Array)


def test_the_probe_finds_what_the_cylinder_can_do(cylinder):
    b = bank(cylinder)
    assert b.capabilities(0) == (True, True, True, True, True, True)
    b.close()


def test_a_refused_step_names_the_reason_and_leaves_the_state(cylinder):
    b = bank(cylinder)
    b.start()
    b.step(0.0, H)
    b.save()
    before = b.y.copy()
    b.u[0, 1] = 0.7
    assert not b.step(H, H)
    assert "position 0.7 m is outside the stroke 0 to 0.59 m" in b.problem(0)
    assert b.active[0] and b.status[0] == 2
    b.u[0, 1] = 0.3
    b.refresh()
    np.testing.assert_array_equal(b.y, before)
    b.close()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bore": 0.0}, "parameter bore is 0; it must be greater than zero"),
        ({"rod": 0.09}, "parameter rod is 0.09; it must be smaller than bore"),
        ({"supply_pressure": 5e5}, "must be above return_pressure"),
        ({"leakage": -1.0}, "parameter leakage is -1; it must be zero or more"),
        ({"coulomb_friction": float("nan")}, "was given a value that is not finite"),
    ],
)
def test_impossible_parameters_are_refused_with_one_sentence(cylinder, parameters, words):
    b = bank(cylinder, parameters)
    with pytest.raises(InstanceFailed, match=words):
        b.start()
    b.close()


def test_inputs_that_are_no_numbers_end_the_instance_and_not_its_neighbour(cylinder):
    b = bank(cylinder, {}, {})
    b.start()
    b.u[0, 2] = np.nan
    assert not b.step(0.0, H)
    assert list(b.active) == [0, 1]
    assert "velocity" in b.problem(0) and "not finite" in b.problem(0)
    b.u[0, 2] = 0.0
    assert b.step(H, H)
    b.close()
