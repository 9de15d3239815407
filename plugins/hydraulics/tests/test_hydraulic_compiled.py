"""The generated law and the readable one are one law."""

import dataclasses

import numpy as np
import pytest
from skillframe_hydraulics.law.generated import NOTE, source
from skillframe_hydraulics.law.hydraulic import HydraulicGains, Measured, Reference
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.hydraulic_symbolic import law_function
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.robot.chain import ClosedChain
from tests.laws.vdc_loop import START, crane
from tests.oracle.hydraulic_law import HydraulicLaw, terms

DT = 1e-3
SAME = 1e-9  # relative; both do some thousand operations in double precision, in another order


def machine(chain=None):
    return chain or crane(), cylinders(crane().robot.spec.actuation), HydraulicGains(friction=(1e5, 2e5))


def fed_by(compensation):
    """The crane with a pump of compensated valves."""
    pump = {"kind": "load_sensing", "flow": 3e-3, "volume": 0.01, "margin": 15e5, "compensation": compensation}
    spec = dataclasses.replace(crane().robot.spec, tables={"supply": {"main": pump}})
    return ClosedChain(dataclasses.replace(crane().robot, spec=spec))


def draw(rng, count):
    """What sensors and skills may say, N trials."""

    def around(middle, width, *shape):
        return middle + width * rng.uniform(-1.0, 1.0, (count, *shape))

    z = around(START, 0.3, 3)
    rising = around(0.0, 1.0, 2, 2)
    measured = Measured(
        z, around(0.0, 0.3, 3), around(100e5, 89e5, 3), around(100e5, 89e5, 3), around(0.0, 8e3, 2),
        around(700.0, 700.0, 2),
    )  # fmt: skip
    reference = Reference(
        around([3.0, 1.0], 0.3, 2), around(0.0, 0.3, 2), 3e4 * rising @ np.swapaxes(rising, -1, -2),
        5e4 * np.eye(2) + 1e4 * rising, around(0.0, 1e3, 2), around(0.5, 0.1, 1), around(0.0, 0.1, 1),
        around(0.0, 0.5, 3),
    )  # fmt: skip
    return measured, reference


def test_an_acceleration_that_is_not_given_is_zero():
    measured, reference = draw(np.random.default_rng(8), 2)
    laws = [CompiledLaw(*machine(), 2, DT) for _ in range(2)]
    given = [reference._replace(acceleration=a) for a in (None, np.zeros((2, 3)))]
    close(*(law.step(measured, r, np.arange(2)) for law, r in zip(laws, given, strict=True)))


@pytest.mark.parametrize("use_compiler", [True, False])
def test_a_pressure_that_is_no_number_gives_a_command_that_is_none_and_leaves_other_trials_alone(use_compiler):
    """Bounds that hide it (fmin, fmax) would make a full command of it."""
    measured, reference = draw(np.random.default_rng(12), 2)
    expected = CompiledLaw(*machine(), 2, DT, use_compiler=use_compiler).step(measured, reference, np.arange(2)).valve
    measured.pressure_a[0] = np.nan
    found = CompiledLaw(*machine(), 2, DT, use_compiler=use_compiler).step(measured, reference, np.arange(2)).valve
    assert np.isnan(found[0]).all()
    np.testing.assert_array_equal(found[1], expected[1])


def close(found, expected):
    for own, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(own, other, rtol=SAME, atol=SAME * np.abs(other).max())


@pytest.mark.parametrize("use_compiler", [True, False])
def test_the_generated_law_is_the_readable_law_sample_after_sample(use_compiler):
    rng, count, everyone = np.random.default_rng(3), 3, np.arange(3)
    laws = [HydraulicLaw(*machine(), count, DT), CompiledLaw(*machine(), count, DT, use_compiler=use_compiler)]
    deadband, supply = 0.02 * rng.random((count, 3)), 190e5 + 20e5 * rng.random((count, 3))
    for law in laws:
        law.deadband[:], law.supply[:] = deadband, supply
    for _ in range(4):
        measured, reference = draw(rng, count)
        readable, generated = (law.step(measured, reference, everyone) for law in laws)
        close(generated, readable)
        close([laws[1].theta, laws[1].friction], [laws[0].theta, laws[0].friction])
    for law in laws:
        law.start()
    close(*(law.step(*draw(np.random.default_rng(4), count), everyone) for law in reversed(laws)))


@pytest.mark.parametrize("compensation", ["pre", "post"])
def test_the_generated_law_of_compensated_valves_is_the_readable_one(compensation):
    rng, count, everyone = np.random.default_rng(3), 8, np.arange(8)
    plain = CompiledLaw(*machine(), count, DT, use_compiler=False)
    parts = machine(fed_by(compensation))
    laws = [HydraulicLaw(*parts, count, DT), CompiledLaw(*parts, count, DT, use_compiler=False)]
    deadband, supply = 0.02 * rng.random((count, 3)), 190e5 + 20e5 * rng.random((count, 3))
    for law in (*laws, plain):
        law.deadband[:], law.supply[:] = deadband, supply
    for _ in range(4):
        measured, reference = draw(rng, count)
        readable, generated, other = (law.step(measured, reference, everyone) for law in (*laws, plain))
        close(generated, readable)
        assert np.abs(generated.valve - other.valve).max() > 0.1


def test_the_generated_law_of_valves_with_points_is_the_readable_one():
    """The second valve has none. Interpolation by numpy, with a residual overlap of up to 2 % of the flow."""
    points = {"opening_points": 3, "travel_1": 0.1, "opening_1": 0.0, "travel_2": 0.5, "opening_2": 0.12}
    spec = crane().robot.spec
    own = [dataclasses.replace(a, parameters={**a.parameters, **points}) for a in spec.actuation]
    spec = dataclasses.replace(spec, actuation=(own[0], spec.actuation[1], own[2]))
    chain = ClosedChain(dataclasses.replace(crane().robot, spec=spec))
    rng, count, everyone = np.random.default_rng(3), 8, np.arange(8)
    parts = chain, cylinders(spec.actuation), machine()[2]
    laws = [HydraulicLaw(*parts, count, DT), CompiledLaw(*parts, count, DT, use_compiler=False)]
    deadband = 0.02 * rng.random((count, 3))
    for law in laws:
        law.deadband[:] = deadband
    for _ in range(4):
        measured, reference = draw(rng, count)
        close(*(law.step(measured, reference, everyone) for law in reversed(laws)))


@pytest.mark.slow
def test_both_laws_go_by_the_inertias_that_they_are_told():
    """Terms, net forces, and the bounds of what is learned: with a drive that no bound would stop, they stop there."""
    measured, reference = draw(np.random.default_rng(11), 2)
    laws = [HydraulicLaw(*machine(), 2, DT), CompiledLaw(*machine(), 2, DT)]
    told = laws[0].theta * np.array([0.4, 1.2])[:, None, None]
    before = laws[0].terms(measured)
    for law in laws:
        law.tell(told)
    readable, generated = (law.terms(measured) for law in laws)
    for name, own, other in zip(readable._fields, generated, readable, strict=True):
        bar = 1e-8 if name == "drift" else SAME  # a central difference
        np.testing.assert_allclose(own, other, rtol=0, atol=bar * np.abs(other).max(), err_msg=name)
    np.testing.assert_allclose(readable.mass, np.array([0.4, 1.2])[:, None, None] * before.mass, rtol=1e-9)
    for _ in range(200):
        close(*(law.step(measured, reference, np.arange(2)) for law in laws))
    close([laws[1].theta], [laws[0].theta])
    assert np.all(np.abs(laws[0].theta - told) <= 0.3 * np.abs(told) * (1.0 + 1e-12))


def test_the_generated_terms_are_those_of_the_loop_embedding_model():
    """Coriolis' part to 1e-8: the readable one is a central difference of step 1e-5 (rounding 1e-16/1e-5)."""
    measured, _ = draw(np.random.default_rng(5), 4)
    found = CompiledLaw(*machine(), 4, DT).terms(measured)
    expected = terms(crane(), measured.z, measured.rate)
    for name, own, other in zip(expected._fields, found, expected, strict=True):
        bar = 1e-8 if name == "drift" else 1e-12
        np.testing.assert_allclose(own, other, rtol=0, atol=bar * np.abs(other).max(), err_msg=name)


def test_a_trial_is_the_same_to_the_bit_alone_and_in_a_batch():
    measured, reference = draw(np.random.default_rng(6), 5)
    batch = CompiledLaw(*machine(), 5, DT)
    together = batch.step(measured, reference, np.arange(5))
    for i in range(5):
        alone = CompiledLaw(*machine(), 1, DT)
        own = alone.step(
            Measured(*(x[i : i + 1] for x in measured)), Reference(*(x[i : i + 1] for x in reference)), np.arange(1)
        )  # fmt: skip
        for one, many in zip(
            (*own, alone.theta, alone.friction), (*together, batch.theta, batch.friction), strict=True
        ):
            np.testing.assert_array_equal(one[0], many[i])


@pytest.mark.parametrize("law", [HydraulicLaw, CompiledLaw])
def test_trials_that_have_ended_learn_nothing_more(law):
    measured, reference = draw(np.random.default_rng(7), 3)
    own = law(*machine(), 3, DT)
    before, rub = own.theta.copy(), own.friction.copy()
    own.step(measured, reference, np.array([0, 2]))
    np.testing.assert_array_equal(own.theta[1], before[1])
    np.testing.assert_array_equal(own.friction[1], rub[1])
    assert np.any(own.theta[0] != before[0])
    assert np.any(own.friction[0] != rub[0])


def test_without_a_compiler_the_law_says_so(monkeypatch):
    monkeypatch.setattr("skillframe.fmu.build.find_compiler", lambda: None)
    assert CompiledLaw(*machine(), 1, DT).notes == (NOTE,)


def test_the_same_machine_gives_the_same_code():
    """Else every process would compile again."""
    first, second = (source(law_function(crane(), np.eye(3)[[0, 2]])) for _ in range(2))
    assert first == second


@pytest.mark.parametrize("law", [HydraulicLaw, CompiledLaw])
def test_a_law_that_is_told_to_hold_learns_nothing_and_later_goes_on(law):
    measured, reference = draw(np.random.default_rng(9), 1)
    own = law(*machine(), 1, DT)
    own.adapt(False)
    theta, rub = own.theta.copy(), own.friction.copy()
    own.step(measured, reference, np.arange(1))
    np.testing.assert_array_equal(own.theta, theta)
    np.testing.assert_array_equal(own.friction, rub)
    own.adapt(True)
    own.step(measured, reference, np.arange(1))
    assert np.any(own.theta != theta)
    assert np.any(own.friction != rub)
