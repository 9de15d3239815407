"""What a machine goes by after its swing: friction and payload as found, and where its tool is now."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.drive_reference import ToolReference
from skillframe_hydraulics.force.calibration import hold_identified
from skillframe_hydraulics.force.identification import Identification, IdentificationSettings
from skillframe_hydraulics.force.load import carrier
from skillframe_hydraulics.law.hydraulic import HydraulicGains, Measured, Reference
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_hydraulics.sensors import MachineSensors

from skillframe.control.limits import LimitGuard
from skillframe.robot.spec import Limits
from tests.laws.vdc_loop import crane

DT = 1e-3
_REFERENCE = ((2,), (2,), (2, 2), (2, 2), (2,), (0,), (0,), (2,))


@pytest.fixture(scope="module")
def law():
    """Of two machines, after a swing in which other parameters were learned."""
    own = CompiledLaw(crane(), cylinders(crane().robot.spec.actuation), HydraulicGains(), 2, DT, use_compiler=False)
    own.theta *= 1.05
    own.friction *= 0.9
    return own


def held(law, coulomb=0.0, viscous=0.0, payload=0.0):
    """The law once it holds errors (N, k) and (N,) that were found."""
    found = Identification(2, 3, IdentificationSettings())
    found.theta[:] = np.concatenate([np.zeros((2, 3)) + coulomb, np.zeros((2, 3)) + viscous, np.zeros((2, 1))], axis=1)
    found.theta[:, -1] = payload
    hold_identified(law, found)
    return law


def test_friction_is_held_as_it_was_found_above_and_below_the_nominal_one(law):
    """Nominal 4 kN and more: 400 N more, or less, lie within the bound of a half."""
    error = np.array([[400.0, -300.0, 200.0], [-400.0, 300.0, -200.0]])
    nominal = np.array([a.known["coulomb_friction"] for a in crane().robot.spec.actuation])
    rubbing = np.array([a.known["viscous_friction"] for a in crane().robot.spec.actuation])
    own = held(law, coulomb=error, viscous=0.1 * error)
    np.testing.assert_allclose(own.friction[:, 0], nominal + error, rtol=1e-12)
    np.testing.assert_allclose(own.friction[:, 1], rubbing + 0.1 * error, rtol=1e-12)


def test_no_more_than_half_of_the_nominal_friction_is_believed(law):
    nominal = np.array([a.known["coulomb_friction"] for a in crane().robot.spec.actuation])
    np.testing.assert_allclose(held(law, coulomb=1e6).friction[:, 0], np.tile(1.5 * nominal, (2, 1)))
    np.testing.assert_allclose(held(law, coulomb=-1e6).friction[:, 0], np.tile(0.5 * nominal, (2, 1)))


def test_the_payload_found_is_carried_and_what_adaptation_had_come_to_is_dropped(law):
    """Mass and first moments of the body that carries it grow alike; the other bodies are as told."""
    told, row = law.told.copy(), carrier(law.chain)
    mass = pin.Inertia.FromDynamicParameters(told[0, row]).mass
    own = held(law, payload=np.array([20.0, -20.0]))
    np.testing.assert_allclose(own.theta[:, row, 0], [mass + 20.0, mass - 20.0], rtol=1e-12)
    np.testing.assert_allclose(own.theta[:, row] / own.theta[:, row, :1], told[:, row] / mass, rtol=1e-12)
    others = np.delete(np.arange(told.shape[1]), row)
    np.testing.assert_array_equal(own.theta[:, others], told[:, others])


def test_a_skill_sees_the_tool_where_it_is_and_not_where_it_was_when_the_filters_heard_of_it():
    """A tool that moves steadily along base x and z at 0.2 m/s: the filters' 13 ms are 2.7 mm, of a sample 0.08."""
    gauges, rate = MachineSensors(MachineNoise(encoder=0.0, pressure=0.0), [np.random.default_rng(0)], 2, 1, DT), 0.2
    gauges.start(np.zeros((1, 2)), np.zeros((1, 1)), np.zeros((1, 1)))
    for k in range(500):
        place = np.full((1, 2), rate * k * DT)
        gauges.sample(place, np.zeros((1, 1)), np.zeros((1, 1)))
    zeros, force = (np.zeros((1, size)) for size in (2, 2, 1, 1, 2, 2)), np.zeros((1, 2))
    law = SimpleNamespace(
        at=SimpleNamespace(tip=gauges.z, tip_rate=gauges.rate),
        given=(Measured(*zeros), Reference(*(np.zeros((1, *shape)) for shape in _REFERENCE))),
    )  # fmt: skip
    estimator = SimpleNamespace(estimate=SimpleNamespace(feedback=force, answered=force, sigma=force))
    task = ToolReference(gauges, estimator, law, LimitGuard(Limits(), 1, DT), np.eye(3)[[0, 2]], np.zeros((1, 3)), DT)
    seen = task.seen(0.5, np.eye(3)[None])
    np.testing.assert_allclose(seen.pose.position[:, [0, 2]], place, atol=0.08 * rate * gauges.lag)
    np.testing.assert_allclose(seen.twist[:, [0, 2]], rate, rtol=1e-9)
