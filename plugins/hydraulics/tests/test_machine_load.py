"""A hydraulic machine finds out what it carries, over the whole rating, and says what it found beyond a bound."""

from functools import cache

import numpy as np
import pytest
from skillframe_hydraulics.law.hydraulic import Measured
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_papers.rows.crane_runs import MOVING, Follow

from plugins.hydraulics.tests.test_machine import rngs, setup, standing
from skillframe.errors import InputError
from skillframe.execution.executor import begin, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import load_robot
from tests.fmu_cache import own_cache  # noqa: F401
from tests.oracle.hydraulic_law import terms

START = np.array([0.785, -1.571, 0.5])
CARRIER = 2  # lift, tilt, extension: the boom's last part holds the grip


@cache
def crane(payload=475.0):
    return ClosedChain(load_model(with_payload(load_robot("hiab_xs031"), payload)))


def loop(draws):
    count = len(next(iter(draws.values())))
    return begin(Follow(standing, MOVING), setup(), draws, rngs(range(count)), None)


def carried(payload):
    """Mass of the body that holds the load, with such a load in it, by Pinocchio."""
    return crane(payload).model.inertias[CARRIER + 1].mass


@pytest.mark.slow
def test_the_load_is_found_over_the_whole_rating_and_the_law_goes_by_it():
    """Told of 475 kg; found within 3 kg, as near the nominal one, and the tool is back where the swing began."""
    loads = np.array([0.0, 100.0, 200.0, 320.0])
    own = loop({"robot.payload": loads})
    own.prepare()
    np.testing.assert_allclose(own.drive.law.theta[:, CARRIER, 0], [carried(load) for load in loads], atol=3.0)
    away = own.plant.tool_pose().position @ own.drive.task.axes.T - own.drive.home
    assert np.abs(away).max() < 5e-3  # stiction over the spring of the force loop: 1 mm; at 4c3a7e9 0.07 to 0.7 m


@pytest.mark.slow
def test_what_was_not_as_told_or_is_beyond_a_bound_is_said_and_nothing_else_is():
    draws = {
        "robot.payload": np.array([475.0, 200.0, 475.0]), "actuator.friction_scale": np.array([1.0, 1.0, 2.0]),
    }  # fmt: skip
    result = simulate(Follow(standing, MOVING), setup(), draws, rngs(range(3)), duration_s=0.1, trace_hz=100.0)
    sound, light, rough = (trace.meta["notes"] for trace in result.traces)
    assert sound == []
    assert light == [
        "the controller was given 475 kg in the grip; at rest the cylinders' pressures hold 200 kg, and it goes by "
        "these"
    ]
    assert any(text.startswith("coulomb_friction of lift_piston: the swing found 8") for text in rough)
    assert any(text.endswith("beyond its bound; the controller uses 6000 N") for text in rough)


@pytest.mark.parametrize("payload", [0.0, 150.0, 475.0])
def test_a_machine_at_rest_is_weighed_exactly_and_to_what_friction_may_hide(payload):
    """R^T F_p = g_z of a model with that load; every piston may stick with its Coulomb friction, either way."""
    from skillframe_hydraulics.force.load import believed, weigh

    chain, known = crane(), cylinders(load_robot("hiab_xs031").actuation)
    z, zero = START[None], np.zeros((1, 3))
    at, hold = terms(chain, z, zero), crane(payload).at(START, np.zeros(3)).holding_force()
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    for stuck in (np.zeros(3), *(known.coulomb_friction * signs)):
        pressure_a = (hold + stuck + known.area_b * 50e5) / known.area_a
        seen = Measured(z, zero, pressure_a[None], np.full((1, 3), 50e5), np.zeros((1, 2)), np.zeros((1, 2)))
        found = weigh(chain, known, seen, at)
        assert np.abs(475.0 + found.error[0] - payload) <= (found.hidden[0] if stuck.any() else 1e-6)
        assert 50.0 < found.hidden[0] < 100.0  # the lift alone: 1.5 x 4 kN x 0.31 m over 9.81 N/kg x 2.83 m is 67 kg
    assert believed(np.array([475.0]), found, 475.0)[0] == (475.0 if payload == 475.0 else 475.0 + found.error[0])


@pytest.mark.slow
def test_the_controller_is_told_of_a_load_by_the_nominal_payload():
    """Its model's terms are those of a robot made with that load, by Pinocchio; the true load is another matter."""
    own = loop({"robot.nominal_payload": np.array([475.0, 200.0, 0.0])})
    seen = own.drive._seen
    found = own.drive.law.terms(seen)
    for i, payload in enumerate([475.0, 200.0, 0.0]):
        other = terms(crane(payload), seen.z[i : i + 1], seen.rate[i : i + 1])
        for name in ("mass", "gravity"):
            expected = getattr(other, name)[0]
            np.testing.assert_allclose(getattr(found, name)[i], expected, atol=1e-9 * np.abs(expected).max())
    assert np.ptp(own.plant.mass_matrix(), axis=0).max() == 0.0


@pytest.mark.parametrize("others", [[], [100.0]], ids=["alone", "beside another"])
@pytest.mark.slow
def test_a_controller_told_too_little_goes_by_the_nominal_load_if_that_is_what_it_holds(others):
    """As weighed, 475 kg is robot.toml's own, to the bit, because it is the rating too."""
    loads = np.array([475.0, *others])
    own = loop({"robot.payload": loads, "robot.nominal_payload": np.full(len(loads), 200.0)})
    drive = own.drive
    drive._sample()
    assert drive.load.weigh(drive._seen, drive.terms)
    np.testing.assert_allclose(drive.load.mass, loads, atol=5.0)
    expected = [carried(load) for load in drive.load.mass]
    np.testing.assert_allclose(drive.law.told[:, CARRIER, 0], expected, rtol=1e-9)


@pytest.mark.parametrize(("told", "words"), [(476.0, "rating of 475 kg"), (-1.0, "-1 kg is beyond 0kg to 20000kg")])
@pytest.mark.slow
def test_a_controller_is_not_told_of_a_load_beyond_the_rating(told, words):
    with pytest.raises(InputError, match=words):
        loop({"robot.nominal_payload": np.array([told])})


def test_an_arm_has_no_load_to_be_told_of():
    with pytest.raises(InputError, match=r"robot\.nominal_payload: panda has no drive with such a quantity"):
        simulate(
            Follow(standing, MOVING), setup(load_robot_model("panda")), {"robot.nominal_payload": np.ones(1)}, rngs([0])
        )
