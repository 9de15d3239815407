"""An arm that takes positions or velocities, beside the same arm as an ideal source of torques."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from skillframe_testkit.suites import HoldSkill

from skillframe.control.joint_steps import JointSteps
from skillframe.errors import InputError
from skillframe.execution.drives.admittance import AdmittanceDrive
from skillframe.execution.executor import Setup, begin, simulate
from skillframe.robot.interface import Control
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.scene import Geom, Mover
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import SILENT, generators, scene

KINDS = {
    "position": Control(interface="position", rate_hz=500.0),
    "slow": Control(interface="position", rate_hz=125.0, delay_s=0.02),
    "velocity": Control(interface="velocity", delay_s=0.003, bandwidth_hz=50.0),
}
EACH = ["position", pytest.param("slow", marks=pytest.mark.slow), "velocity"]
STIFF = np.diag([1000.0] * 3 + [50.0] * 3)
DOWN = (0.0, 0.0, -1.0)


@cache
def robot(kind, **limits):
    model = load_model(load_robot("panda"))
    return replace(model, spec=replace(model.spec, control=KINDS[kind] if kind in KINDS else Control()))


def setup(kind, world="valley", sensors=SILENT, model=None, **params):
    task = scene(world, **params)
    return Setup(robot=model or robot(kind), scene=task, center_of_compliance=np.array(task.tool.frames["tip"]),
                 sensors=sensors)  # fmt: skip


def run(kind, skill, draws=None, seconds=3.0, count=1, trace_hz=100.0, **given):
    columns = {key: np.full(count, value) for key, value in (draws or {}).items()}
    return simulate(skill, setup(kind, **given), columns, generators(count), duration_s=seconds, trace_hz=trace_hz)


@pytest.mark.parametrize("kind", KINDS)
def test_an_arm_that_is_told_to_hold_stands_as_it_was_put(kind):
    result = run(kind, HoldSkill(), seconds=0.3)
    position = result.traces[0].position
    assert np.abs(position - position[0]).max() < 1e-5
    assert result.reason[0].startswith("time limit")


@pytest.mark.parametrize("kind", EACH)
def test_in_the_air_the_tool_goes_at_the_pace_of_the_arm_and_along_the_skills_way(kind):
    """D v_d is in the drive, so that nothing lags but the arm: after the start, the speed is 10 mm/s over the pace.

    A velocity's integral follows the joints by 1/s: while they lag by 17 ms, the tool goes faster by up to 1.7 %.
    """
    pace = KINDS[kind].pace()
    result = run(kind, Push(DOWN, STIFF, speed=0.01, stall=False), {"start.offset_z": 0.05}, seconds=0.8)
    trace = result.traces[0]
    late = trace.time > 0.5 * trace.time[-1]
    speed = np.polyfit(trace.time[late], trace.position[late], 1)[0]
    np.testing.assert_allclose(speed, [0.0, 0.0, -0.01 / pace], atol=2e-4)  # 2 % of 10 mm/s
    assert trace.time[-1] == pytest.approx(0.8 * pace, abs=0.02)


def test_a_skill_that_says_how_fast_it_moves_goes_at_the_arms_own_speed_and_no_slower():
    """Paced for 20 mm/s a skill of 10 mm/s would go at 3.6 mm/s, where 20 N move this arm at 7.3 mm/s."""
    arm = KINDS["position"].admittance
    task = replace(setup("position"), skill_speed=0.01)
    skill, air = Push(DOWN, STIFF, speed=0.01, stall=False), {"start.offset_z": np.array([0.05])}
    trace = simulate(skill, task, air, generators(1), duration_s=0.8, trace_hz=100.0).traces[0]
    assert trace.time[-1] == pytest.approx(0.8 * 0.01 / arm.speed, abs=0.02)
    late = trace.time > 0.5 * trace.time[-1]
    speed = np.polyfit(trace.time[late], trace.position[late, 2], 1)[0]
    assert speed == pytest.approx(-arm.speed, abs=1e-4)  # 0.1 mm/s, half of what the test above allows
    assert any("the skill's clock ran 1.4 times slower" in note for note in trace.meta["notes"])


@pytest.mark.parametrize("kind", EACH)
@pytest.mark.slow
def test_against_the_valley_it_pushes_as_hard_as_it_may_and_comes_to_rest_without_bouncing(kind):
    """The law's drive is cut to 20 N, and at rest the contact carries all of it."""
    result = run(kind, Push(DOWN, STIFF, cap=60.0, stall=False), {"start.offset_z": 0.001}, seconds=1.6)
    trace = result.traces[0]
    force = np.linalg.norm(trace.wrench_true[-20:, :3], axis=1)
    np.testing.assert_allclose(force, 20.0, atol=0.1)
    assert result.peak_force_n[0] < 2.0 * 20.0  # 1.2 to 1.75 times by the rule, for D as designed


def test_with_a_fifth_of_the_damping_the_contact_rings_into_the_force_limit():
    """What the floor is for: 0.3 k_e T_tot, below the 0.57 that is least."""
    bare = replace(KINDS["position"], contact_stiffness=1e4)
    model = replace(robot("position"), spec=replace(robot("position").spec, control=bare))
    result = run("position", Push(DOWN, STIFF, stall=False), {"start.offset_z": 0.001}, seconds=2.0, model=model)
    assert result.peak_force_n[0] > 60.0


def test_on_contacts_twice_as_stiff_as_declared_the_arm_calms_down():
    """c is 0.75 there. Damped all alike it keeps shaking: 22 N about the push. 2 N is where the watch sets in."""
    bare = replace(KINDS["position"], contact_stiffness=2.5e4)
    model = replace(robot("position"), spec=replace(robot("position").spec, control=bare))
    result = run("position", Push(DOWN, STIFF, stall=False), {"start.offset_z": 0.001}, seconds=1.6, model=model)
    force = np.linalg.norm(result.traces[0].wrench_true[-50:, :3], axis=1)
    assert np.abs(force - 20.0).max() < 8.0  # 2 N as the filter sees it, which leaves out the contact's first instant


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_force_on_a_free_axis_moves_the_tool_at_force_over_damping(kind):
    """K = 0 along x, a feed-forward of 10 N: v = 10 / D, and it stays where it is when the push ends."""
    arm = KINDS[kind].admittance
    skill = Hold(
        impedance("x"), feedforward=lambda time: np.array([10.0 * (time < 1.0 / arm.slow_down()), 0, 0, 0, 0, 0])
    )
    result = run(kind, skill, {"start.offset_z": 0.05}, seconds=2.0 / arm.slow_down())
    way = result.traces[0].position[-1, 0] - result.traces[0].position[0, 0]
    assert way == pytest.approx(10.0 / arm.damping, rel=0.03)


@pytest.mark.parametrize("kind", EACH)
def test_a_trial_does_not_depend_on_its_neighbours(kind):
    skill = Push(DOWN, STIFF, stall=False)
    draws = {"start.offset_z": np.array([0.005, 0.03, 0.004]), "fixture.tilt_y": np.array([0.1, 0.0, -0.1])}
    both = simulate(skill, setup(kind), draws, generators(3), duration_s=0.4, trace_hz=100.0)
    first = {key: values[:1] for key, values in draws.items()}
    alone = simulate(skill, setup(kind), first, generators(1), duration_s=0.4, trace_hz=100.0)
    np.testing.assert_array_equal(both.traces[0].position, alone.traces[0].position)
    np.testing.assert_array_equal(both.traces[0].wrench_true, alone.traces[0].wrench_true)


@pytest.mark.parametrize("kind", ["torque", "position"])
def test_a_tare_in_contact_is_named_with_the_force_that_it_hides_and_one_in_the_air_is_not(kind):
    """The sensor reads a spring's push on the tool and takes it for its bias, so that what is left of it is that.

    A lid on a spring of 200 N/m, 50 mm from slack, leans on the tool where it starts, and goes 0.5 mm with it at most.
    The tool's inertia is read with it: 0.6 kg that leave at 50 mm/s have taken 0.3 N for the 100 ms of the tare.
    """
    now = setup(kind)
    under = Geom(kind="box", size=(0.02, 0.02, 0.01), position=(0.0, 0.0, now.scene.start_tip[2] - 0.005 - 0.01))
    lid = Mover(name="lid", geoms=(under,), joint="slide", mass=0.2, center_of_mass=under.position, damping=1.0,
                inertia=1e-4 * np.eye(3), stiffness=200.0, rest=0.05, range=(-0.02, 0.0005))  # fmt: skip
    now = replace(now, scene=replace(now.scene, sprung=(lid,)))
    loop = begin(HoldSkill(), now, {"start.offset_z": np.array([0.0, 0.02])}, generators(2))
    loop.prepare()
    hidden = np.linalg.norm(loop.drive.limb.sensors._bias[:, :3], axis=1)  # silent sensors have none of their own
    force = loop.drive.contact_at_tare
    assert force[0] > 2.0 and force[1] == 0.0
    assert hidden[0] == pytest.approx(force[0], abs=0.3) and hidden[1] < 0.1
    loop.run(0.02, None)
    result = loop.result()
    assert "after a tare in contact" in result.failure[0] and "tare" not in result.failure[1]
    assert any(f"all forces are {force[0]:.1f} N wrong; start higher" in note for note in loop.drive.notes(0))
    assert not any("tared" in note for note in loop.drive.notes(1))


def test_time_limits_are_stretched_with_the_skills_clock_and_every_result_says_so():
    pace = KINDS["position"].pace()
    result = run("position", HoldSkill(), seconds=0.1)
    assert result.duration_s[0] == pytest.approx(0.1 * pace, abs=1e-3)
    assert f"{0.1 * pace:g} s of simulated time" in result.reason[0]
    meta = result.traces[0].meta
    assert meta["interface"]["takes"] == "position"
    assert any(
        "takes a position 500 times a second" in n and "the skill's clock ran 2.7 times slower" in n
        for n in meta["notes"]
    )


def test_a_skill_that_the_arm_cannot_hold_is_refused_with_the_figure():
    with pytest.raises(InputError, match=r"commands 6e\+04 N/m"):
        run("position", Hold(np.diag([6e4] * 3 + [50.0] * 3)), seconds=0.1)


def test_torques_that_the_arms_own_loop_makes_have_no_rate_limit_and_motors_are_watched():
    loop = begin(HoldSkill(), setup("position"), {}, generators(1))
    assert isinstance(loop.drive, AdmittanceDrive)
    assert loop.setup.limits.torque_rate_nm_s is None
    assert setup("torque").limits.torque_rate_nm_s == 1000.0
    result = run("position", HoldSkill(), seconds=0.05)
    assert 0.0 < result.peak_torque_share[0] < 1.0


def test_a_push_against_a_joint_at_its_end_does_not_wind_up():
    """The law goes on with the twist that is made, which is none."""
    loop = begin(Push((0.0, 0.0, 1.0), STIFF, speed=0.02, stall=False), setup("position"), {}, generators(1))
    loop.prepare()
    drive = loop.drive
    stop = drive._joints[0, drive._dofs] + 1e-4
    limits = drive._steps._limits._replace(upper=stop, lower=stop - 2e-4)
    drive._steps = JointSteps(drive._steps._home, limits, drive.arm.total_delay, drive._dt_command)
    for tick in range(1000):
        loop.tick(tick)
    assert np.all(drive._joints[0, drive._dofs] <= stop + 1e-9)
    assert np.abs(drive.admittance.twist).max() < 1e-3


def test_what_a_velocity_s_integral_is_off_fades_with_a_second():
    """The arm stands, nothing pushes and nothing is stiff: the integral goes to the joints as exp(-t)."""
    model = load_model(load_robot("ur5e"))  # six joints, of which none is spare to go home
    model = replace(model, spec=replace(model.spec, control=KINDS["velocity"]))
    air = {"start.offset_z": np.array([0.05])}
    loop = begin(Hold(np.zeros((6, 6))), setup("velocity", model=model), air, generators(1))
    loop.prepare()
    drive = loop.drive
    off = np.array([1.0, -2.0, 3.0, 1.0, -1.0, 2.0]) * 1e-3
    drive._joints = drive._joints.copy()
    drive._joints[:, drive._dofs] += off
    for tick in range(400):
        loop.tick(tick)
    left = (drive._joints - drive.limb.joint_positions())[0, drive._dofs]
    np.testing.assert_allclose(left, off * np.exp(-0.4), atol=2e-5)  # 2 % of the least: what the joints move meanwhile
