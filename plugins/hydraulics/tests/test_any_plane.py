"""Machines of one plane that are more than the crane: turned by any angle, with twin cylinders and a linkage."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_papers.rows.crane_runs import ABOVE, FIXTURE, MOVING, Follow, blend, diamond, scene

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from tests.excavator import write_excavator
from tests.oracle.hydraulic_law import HydraulicLaw

TURNED = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0**0.5]]) / 2.0**0.5


@pytest.fixture(scope="module")
def excavator(tmp_path_factory):
    """The excavator with its slew locked: four cylinders for three freedoms."""
    return write_excavator(tmp_path_factory.mktemp("excavator"), slew="fixed")


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """The shipped crane turned by 45 degrees about the vertical."""
    folder = tmp_path_factory.mktemp("turned") / "crane"
    shutil.copytree(robot_names()["hiab_xs031"], folder)
    for name, old, new in (
        ("hiab_xs031.urdf", 'rpy="1.5707963267948966 0.0 0.0"', 'rpy="1.5707963267948966 0.0 0.7853981633974483"'),
        ("robot.toml", "fixture = [3.0, 0.0, 0.0]", f"fixture = {(TURNED @ FIXTURE).tolist()}"),
    ):
        text = (folder / name).read_text()
        assert text.count(old) == 1
        (folder / name).write_text(text.replace(old, new))
    return folder


@pytest.mark.slow
def test_a_turned_crane_moves_as_the_shipped_one_turned(turned):
    """Within rounding, which the loop passes on: 1e-9 m and 1e-4 N of 60 kN."""
    traces = []
    for robot, axes in (("hiab_xs031", np.eye(3)), (str(turned), TURNED)):
        where = scene(np.array([FIXTURE[0], 0.0, ABOVE]), plate=False)
        follow = Follow(lambda t, axes=axes: tuple(axes @ part for part in diamond(t)), MOVING)
        setup = Setup(robot=load_robot_model(robot), scene=where)
        rngs = [np.random.default_rng(4)]
        traces += simulate(follow, setup, {}, rngs, duration_s=0.5, trace_hz=100.0).traces
    one, other = traces
    assert np.ptp(one.position[:, 0]) > 1e-3
    np.testing.assert_allclose(other.position, one.position @ TURNED.T, atol=1e-9)
    np.testing.assert_allclose(other.wrench[:, :3], one.wrench[:, :3] @ TURNED.T, atol=1e-4)
    for name, column in one.machine.items():
        np.testing.assert_allclose(other.machine[name], column, rtol=1e-7, atol=1e-9 * np.abs(column).max())


def test_the_law_of_a_machine_with_twin_cylinders_and_a_linkage_is_the_readable_law(excavator):
    """Positions that jump farther than two steps of Newton's rule reach are closed from home."""
    chain = ClosedChain(load_model(load_robot(excavator)))
    parts = chain, cylinders(chain.robot.spec.actuation), law_gains(chain)
    readable, compiled = HydraulicLaw(*parts, 2, 1e-3), CompiledLaw(*parts, 2, 1e-3, use_compiler=False)
    rng = np.random.default_rng(5)
    for jump in (0.0, 0.2, 1e-4):
        measured, reference = compiled.given
        measured.z[:] = chain.minimal(chain.home) + jump * rng.uniform(-1.0, 1.0, (2, 3))
        measured.rate[:] = rng.uniform(-0.3, 0.3, (2, 3))
        for pressure in measured[2:4]:
            pressure[:] = rng.uniform(20e5, 200e5, (2, 4))
        measured.force[:], measured.sigma[:] = rng.uniform(-1e4, 1e4, (2, 2)), 800.0
        reference.position[:], reference.damping[:] = compiled.terms(measured).tip + 0.05, 5e4 * np.eye(2)
        reference.stiffness[:] = 3e5 * np.eye(2)
        reference.joint[:] = measured.z[:, 2:]
        given = [type(part)(*(np.copy(x) for x in part)) for part in (measured, reference)]
        own = compiled.step(measured, reference, np.arange(2))
        other = readable.step(*given, np.arange(2))
        np.testing.assert_allclose(own.required[:, 0], own.required[:, 1], rtol=1e-9)  # the twins share
        for found, expected in zip(own, other, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_cylinders_of_unequal_bore_on_one_joint_share_by_the_squares_of_their_areas(excavator):
    """Least squared pressure for equal arms, F_i = A_i p_i: minimal sum of p_i^2 at a given sum of A_i p_i."""
    chain = ClosedChain(load_model(load_robot(excavator)))
    own = cylinders(chain.robot.spec.actuation)
    own = replace(own, area_a=own.area_a * np.array([1.0, 2.0, 1.0, 1.0]))
    gains = replace(law_gains(chain), adaptation=0.0, friction=(0.0, 0.0))
    law = CompiledLaw(chain, own, gains, 1, 1e-3, use_compiler=False)
    measured, reference = law.given
    measured.z[:] = chain.minimal(chain.home)
    measured.pressure_a[:] = measured.pressure_b[:] = 100e5
    measured.sigma[:], reference.damping[:] = 800.0, 5e4 * np.eye(2)
    reference.position[:], reference.joint[:] = law.terms(measured).tip, measured.z[:, 2:]
    required = law.step(measured, reference, np.arange(1)).required[0]
    assert required[0] > 5e4
    assert required[1] / own.area_a[1] ** 2 == pytest.approx(required[0] / own.area_a[0] ** 2, rel=1e-9)
    expected = chain.at(measured.z[0], np.zeros(3)).holding_force(own.area_a**2)
    np.testing.assert_allclose(required, expected, rtol=1e-6)


def test_a_configuration_that_cannot_be_closed_gives_no_command_and_the_next_one_that_can_does(excavator):
    chain = ClosedChain(load_model(load_robot(excavator)))
    law = CompiledLaw(chain, cylinders(chain.robot.spec.actuation), law_gains(chain), 2, 1e-3, use_compiler=False)
    measured, home = law.given[0], chain.minimal(chain.home)
    tips = []
    for z in (home, np.array([np.nan, 0.0, 0.0]), home):
        measured.z[:] = home
        measured.z[0] = z
        tips.append(law.terms(measured).tip.copy())
    assert np.isnan(tips[1][0]).all() and np.isfinite(tips[1][1]).all()
    np.testing.assert_allclose(tips[2], tips[0], atol=1e-12)


@pytest.mark.slow
def test_an_excavator_with_its_slew_locked_comes_to_rest_where_it_was_sent_and_its_twins_share(excavator):
    """0.4 m down in 1 s, then a second at rest."""

    def path(time):
        value, rate = blend(time)
        return value * np.array([0.0, 0.0, -0.4]), rate * np.array([0.0, 0.0, -0.4])

    setup = Setup(robot=load_robot_model(str(excavator)), scene=scene(np.array([FIXTURE[0], 0.0, 2.0]), plate=False))
    rngs = [np.random.default_rng(5)]
    trace = simulate(Follow(path, MOVING), setup, {}, rngs, duration_s=2.0, trace_hz=100.0).traces[0]
    assert trace.time[-1] > 1.9  # nothing ended it
    assert np.linalg.norm(trace.position[-1] - trace.position[0] - path(2.0)[0]) < 0.01  # published for the crane
    force = trace.machine["piston_force_true"]
    assert np.abs(force[:, 0]).max() > 2e5
    assert np.abs(force[:, 0] - force[:, 1]).max() < 1e3  # of 4 kN that each one's friction may hide
