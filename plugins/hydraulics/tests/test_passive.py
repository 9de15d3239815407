"""A joint without a drive: a digger with a grapple that hangs on its bucket."""

import math
import re

import numpy as np
import pytest
from scipy.special import ellipk
from skillframe_hydraulics.faults import moved_joints
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic import tool_task
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_papers.rows.crane_runs import FIXTURE, MOVING, Follow, Stiffness, blend, scene

from skillframe.errors import InputError, SkillframeError
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.digger import write_digger
from tests.excavator import write_excavator

MASS, DOWN, INERTIA = 80.0, 0.4, 4.0
"""Of the grapple [kg], its centre below the joint [m], about the centre [kg m^2]."""
HUNG = (
    '<joint name="hang" type="revolute"><parent link="bucket"/><child link="grapple"/><origin xyz="0.4 0 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="0" velocity="3"/></joint>\n'
    f'<link name="grapple"><inertial><origin xyz="0 0 -{DOWN}"/><mass value="{MASS}"/><inertia ixx="{INERTIA}" ixy="0"'
    f' ixz="0" iyy="{INERTIA}" iyz="0" izz="1"/></inertial></link>\n</robot>'
)


MOUNT = '<joint name="tool_mount" type="fixed"><parent link="{}"/><child link="tool"/><origin xyz="{}"'


def write_grapple(folder, passive='[[passive]]\njoint = "hang"\n', tool="bucket"):
    """The digger with a grapple below its tool, or with its tool on the grapple, 0.8 m below the joint."""
    write_digger(folder, passive)
    urdf = folder / "digger.urdf"
    text, on_bucket = urdf.read_text().replace("</robot>", HUNG), MOUNT.format("bucket", "0.4 0 0.0")
    assert on_bucket in text
    urdf.write_text(text if tool == "bucket" else text.replace(on_bucket, MOUNT.format(tool, "0.1 0 -0.8")))
    return folder


CARDAN = (
    '<joint name="along" type="revolute"><parent link="bucket"/><child link="cross"/><origin xyz="1.3 0 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="0" velocity="3"/></joint>\n'
    '<link name="cross"><inertial><mass value="40"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    '</inertial></link>\n<joint name="across" type="revolute"><parent link="cross"/><child link="grapple"/>'
    '<origin xyz="0 0 -0.2"/><axis xyz="1 0 0"/><limit lower="-2.5" upper="2.5" effort="0" velocity="3"/></joint>\n'
    '<link name="grapple"><inertial><origin xyz="0.05 0.1 -0.7"/><mass value="350"/><inertia ixx="40" ixy="0" ixz="0" '
    'iyy="40" iyz="0" izz="20"/></inertial></link>\n</robot>'
)


def write_cardan(folder, damping=0.0):
    """The excavator on ground that leans by 0.2 rad, its tool on a grapple below two hinges 0.2 m apart."""
    write_excavator(folder, "0.2 0 0")
    urdf, toml = folder / "excavator.urdf", folder / "robot.toml"
    text, count = re.subn(
        r'(name="teeth_mount" type="fixed"><parent link=)"bucket"(.*?xyz=)"[^"]*"', r'\1"grapple"\2"0 0 -1.1"',
        urdf.read_text(), count=1, flags=re.DOTALL,
    )  # fmt: skip
    assert count == 1
    urdf.write_text(text.replace("</robot>", CARDAN))
    tables = "".join(f'[[passive]]\njoint = "{name}"\ndamping = {damping}\n' for name in ("along", "across"))
    toml.write_text(toml.read_text() + tables)
    return folder


@pytest.fixture
def chain(tmp_path):
    return ClosedChain(load_model(load_robot(write_grapple(tmp_path))))


def test_at_home_it_hangs_below_its_joint_and_is_last_of_the_coordinates(chain):
    assert chain.independent == ("boom", "stick", "bucket", "hang") and chain.steered == 3
    state = chain.at(chain.minimal(chain.home), np.zeros(4))
    below = state.data.oMi[chain.model.getJointId("hang")].rotation @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(below, [0.0, 0.0, -1.0], atol=1e-9)
    upright = chain.minimal(chain.home) + np.array([0.0, 0.0, 0.0, math.pi])
    assert abs(chain.settled(upright)[3] - chain.home[chain.free[3]]) % (2 * math.pi) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("reach", [0.01, 1.0])
def test_it_swings_with_the_period_of_a_physical_pendulum_while_the_cylinders_hold(chain, reach):
    """4 sqrt(I/(m g d)) K(sin^2(reach/2)), a quarter of it from the greatest angle to the lowest point."""
    about = INERTIA + MASS * DOWN**2
    period = 4.0 * math.sqrt(about / (MASS * 9.81 * DOWN)) * float(ellipk(math.sin(reach / 2.0) ** 2))
    hung = chain.minimal(chain.home)
    place, rate, dt, time = reach, 0.0, 2e-3, 0.0

    def pull(angle):
        state = chain.at(hung + np.array([0.0, 0.0, 0.0, angle]), np.zeros(4))
        return -float(state.bias[3] / state.mass[3, 3])

    while place > 0.0:  # Stoermer-Verlet
        rate += 0.5 * dt * pull(place)
        place += dt * rate
        rate += 0.5 * dt * pull(place)
        time += dt
    assert time - place / rate == pytest.approx(period / 4.0, rel=1e-5)


@pytest.mark.parametrize("tool", ["bucket", "grapple"])
def test_the_law_gives_the_driven_joints_their_acceleration_whatever_swings(tmp_path, tool):
    """With forces for which the passive joint's force is zero, the tool accelerates as commanded."""
    chain = ClosedChain(load_model(load_robot(write_grapple(tmp_path, tool=tool))))
    known = cylinders(chain.robot.spec.actuation)
    law = CompiledLaw(chain, known, law_gains(chain), 1, 1e-3, use_compiler=False)
    law.adapt(False)
    task, rng = tool_task(chain), np.random.default_rng(2)
    for swing in (0.0, 3.0):
        measured, reference = law.given
        measured.z[:] = chain.minimal(chain.home) + rng.uniform(-0.1, 0.1, (1, 4))
        measured.rate[:] = rng.uniform(-0.3, 0.3, (1, 4))
        measured.rate[0, 3] = swing
        for pressure in measured[2:4]:
            pressure[:] = 90e5
        measured.sigma[:] = 1e3
        state = chain.at(measured.z[0], measured.rate[0])
        wanted = rng.uniform(-2.0, 2.0, 4)
        at, jacobian = task.position(state), task.jacobian(state)
        reference.position[:], reference.velocity[:] = at[:2], (jacobian @ state.zd)[:2]
        reference.stiffness[:], reference.damping[:] = np.zeros((2, 2)), 5e4 * np.eye(2)
        reference.joint[:], reference.joint_rate[:] = at[2:], state.zd[2:]
        reference.acceleration[:] = wanted
        law.friction[:] = 0.0  # again, as its bounds exclude none
        law.start()
        force = law.step(measured, reference, np.arange(1)).required[0]
        before, after = (task.jacobian(chain.at(state.z + s * state.zd, state.zd)) for s in (-1e-4, 1e-4))
        drift = (after - before) @ state.zd / 2e-4
        found = jacobian @ chain.at(state.z, state.zd).acceleration(force) + drift
        np.testing.assert_allclose(found[:3], wanted[:3], atol=1e-5)  # of differences
        assert abs(found[3] - wanted[3]) > 0.1  # and nothing gives it its own


@pytest.mark.parametrize(
    ("passive", "said"),
    [
        ("", "no actuator moves hang"),
        ('[[passive]]\njoint = "hung"\n', "hung"),
        ('[[passive]]\njoint = "boom_piston"\n', "boom_piston is passive and moved by an [[actuation]]"),
        ('[[passive]]\njoint = "hang"\n' * 2, "names hang twice"),
        ('[[passive]]\njoint = "boom_barrel_pivot"\n', "boom_barrel_pivot is passive and moved by a [[loop]]"),
    ],
)
def test_what_cannot_swing_is_named(tmp_path, passive, said):
    with pytest.raises(SkillframeError, match=re.escape(said)):
        ClosedChain(load_model(load_robot(write_grapple(tmp_path, passive))))


def test_check_says_that_it_swings_without_end(tmp_path):
    found = audit(load_robot(write_grapple(tmp_path)))
    assert found.usable
    assert [p.message for p in found.problems if p.code == "undamped_swing"] == [
        "passive joint hang has no damping: it swings without end"
    ]
    damped = '[[passive]]\njoint = "hang"\ndamping = "20 Nms/rad"\n'
    assert not [p for p in audit(load_robot(write_grapple(tmp_path, damped))).problems if p.code == "undamped_swing"]
    twice = f"{damped}[dynamics.joint.hang]\nfriction = 1.0\n"
    with pytest.raises(InputError, match="hang has damping and a table in"):
        load_robot(write_grapple(tmp_path, twice))


def test_a_tool_that_hangs_is_where_its_grapple_is_at_rest(tmp_path):
    chain = ClosedChain(load_model(load_robot(write_grapple(tmp_path, tool="grapple"))))
    task, h = tool_task(chain), 1e-6
    z = chain.minimal(chain.home) + np.array([0.1, -0.1, 0.05, 0.7])
    state = chain.at(z, np.zeros(4))
    at = chain.at(chain.settled(z), np.zeros(4)).data.oMf[chain.robot.tool_frames[0]].translation
    np.testing.assert_allclose(task.position(state)[:2], [at[0], at[2]], atol=1e-12)
    moved = [task.position(chain.at(z + s, state.zd)) - task.position(chain.at(z - s, state.zd)) for s in h * np.eye(4)]
    np.testing.assert_allclose(task.jacobian(state), np.array(moved).T / (2 * h), atol=1e-7)
    found = task.solve(chain, task.position(state) + np.array([0.05, -0.05, 0.0, 0.0]), z)
    np.testing.assert_allclose(task.position(chain.at(found, state.zd))[:2], [at[0] + 0.05, at[2] - 0.05], atol=1e-9)


def test_a_tool_below_two_hinges_hangs_in_the_law_where_it_hangs_by_newtons_rule(tmp_path):
    """The law's closed form, hinge after hinge, against the rest that `settled` finds; the Jacobian by differences."""
    chain = ClosedChain(load_model(load_robot(write_cardan(tmp_path))))
    assert chain.independent[chain.steered :] == ("along", "across")
    assert [chain.independent[j] for j in moved_joints(chain)] == ["slew", "boom", "boom", "stick", "bucket"]
    task, rng, h = tool_task(chain), np.random.default_rng(3), 1e-6
    law = CompiledLaw(chain, cylinders(chain.robot.spec.actuation), law_gains(chain), 1, 1e-3, use_compiler=False)
    for _ in range(5):
        z = chain.minimal(chain.home) + rng.uniform(-0.2, 0.2, 6) * [1, 1, 1, 1, 3, 3]
        state = chain.at(z, np.zeros(6))
        rest = chain.at(chain.settled(z), np.zeros(6))
        assert abs(rest.z[5]) > 0.05  # it leans, and its mass is off its axis
        law.given[0].z[:] = z
        for _ in range(6):  # each call closes the loops by two steps of Newton's rule
            terms = law.terms(law.given[0])
        np.testing.assert_allclose(terms.tip[0], task.position(state)[:3], atol=1e-6)
        moved = [task.position(chain.at(z + s, 0 * z)) - task.position(chain.at(z - s, 0 * z)) for s in h * np.eye(6)]
        np.testing.assert_allclose(task.jacobian(state), np.array(moved).T / (2 * h), atol=1e-6)


def missed(robot, way, seconds, gains, duration):
    """How far the tool is off a straight way [m] that it is led in so many seconds, every 20 ms."""
    chain = ClosedChain(robot)
    home = chain.at(chain.minimal(chain.home), np.zeros(len(chain.free)))
    tip = home.data.oMf[robot.tool_frames[0]].translation

    def path(time):
        value, rate = blend(time / seconds)
        return value * np.array(way), rate / seconds * np.array(way)

    where = scene(tip - np.array(robot.spec.workspace.fixture) + FIXTURE, plate=False)
    setup, rngs = Setup(robot=robot, scene=where), [np.random.default_rng(5)]
    run = simulate(Follow(path, gains), setup, {}, rngs, duration_s=duration, trace_hz=50.0)
    trace = run.traces[0]
    assert trace.time[-1] > duration - 0.1, run.failure
    return np.linalg.norm(trace.position - trace.position[0] - [path(time)[0] for time in trace.time], axis=1)


@pytest.mark.slow
def test_a_tool_below_two_hinges_comes_to_rest_where_it_is_commanded(tmp_path):
    """0.5 m out, 0.6 m aside by the slew and 0.2 m up in 3 s: it swings by less than 0.2 m, and ends within 3 mm."""
    robot = load_robot_model(str(write_cardan(tmp_path, 150.0)))
    off = missed(robot, (0.5, 0.6, 0.2), 3.0, Stiffness(1.5e5, 1.5e5), 9.0)
    assert 5e-3 < off.max() < 0.2
    assert off[-20:].max() < 3e-3


@pytest.mark.slow
def test_a_tool_on_a_grapple_comes_to_rest_where_it_is_commanded(tmp_path):
    """0.25 m out and 0.1 m up in 1.5 s: within 60 mm while it swings, and 1 mm when damping has stopped it."""
    passive = '[[passive]]\njoint = "hang"\ndamping = 50.0\n'
    robot = load_robot_model(str(write_grapple(tmp_path, passive, "grapple")))
    off = missed(robot, (0.25, 0.0, 0.1), 1.5, MOVING, 4.5)
    assert 5e-3 < off.max() < 0.06
    assert off[-10:].max() < 1e-3
