"""A loop that reads encoders and whose torques arrive late: what the law knows, and what is judged."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from skillframe_testkit.suites import HoldSkill

from skillframe.errors import InputError
from skillframe.execution.executor import begin
from skillframe.frames import norm
from skillframe.robot.spec import Limits, load_robot
from skillframe.robot.tables import Encoders
from skillframe.signals import CommandDelay
from skillframe.world.scene import Holder
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import generators, robot, run, setup

STIFF = np.diag([1000.0] * 3 + [50.0] * 3)


def told(name="panda", world="free", delay_s=0.0, **encoders):
    """A set-up whose robot has encoders, if any are given, and a delay."""
    now = setup(name, world, limits=Limits())
    spec = now.robot.spec
    declared = Encoders(**encoders) if encoders else None
    spec = replace(spec, encoders=declared, control=replace(spec.control, delay_s=delay_s))
    return replace(now, robot=replace(now.robot, spec=spec))


def test_the_law_sees_the_tool_where_the_counted_joints_put_it():
    """With 8 bits the tool is up to centimetres off. Pinocchio's kinematics at the counted joints is the reference."""
    now, model = told(bits=8), robot("panda").model
    loop = begin(HoldSkill(), now, {"start.offset_x": np.array([0.0, 0.013])}, generators(2))
    seen = loop.drive.sense(0, loop.active)
    data, count = model.createData(), 2.0 * np.pi / 256
    for i, q in enumerate(loop.plant.configuration):
        pin.framesForwardKinematics(model, data, np.rint(q / count) * count)
        frame = data.oMf[robot("panda").tool_frames[0]]
        # rounding of two libraries
        np.testing.assert_allclose(seen.pose.rotation[i], frame.rotation, atol=1e-12)
        tool = frame.translation + frame.rotation @ now.center_of_compliance
        np.testing.assert_allclose(seen.pose.position[i], tool, atol=1e-12)
        truth = loop.plant.tool_pose().at(now.center_of_compliance).position[i]
        assert norm(seen.pose.position[i] - truth) > 1e-4


def test_what_is_judged_is_the_true_state():
    """The scene's error at the end is that of a robot put at the true joints, and not at the counted ones."""
    now = told(world="peg_in_hole", bits=10)
    loop = begin(Hold(STIFF), now, {}, generators(1))
    loop.prepare()
    loop.run(0.05, None)
    judged, count = loop.result().final_error_m[0], 2.0 * np.pi / 1024
    true = loop.plant.configuration[0]
    errors = []
    for q in (true, np.rint(true / count) * count):
        loop.plant.reset(q[None])
        errors.append(now.scene.goal_error(loop.plant.tip_state())[0][0])
    assert judged == pytest.approx(errors[0], abs=1e-12)  # to rounding
    assert abs(judged - errors[1]) > 1e-5


def test_fine_encoders_behind_a_fast_filter_change_a_push_by_less_than_a_tenth_of_a_millimetre():
    """24 bits are 4e-7 rad; the filter of 500 Hz lags by 0.3 ms."""
    push = {"duration_s": 0.5, "trace_hz": 1000}
    exact = run(Push((0, 0, -1.0), impedance()), told(), **push).traces[0]
    fine = run(Push((0, 0, -1.0), impedance()), told(bits=24, corner_hz=500.0), **push).traces[0]
    assert 0.0 < norm(exact.position - fine.position).max() < 1e-4


def test_without_encoders_and_delay_a_run_keeps_its_bits():
    plain = run(Push((0, 0, -1.0), impedance()), setup("panda", "free", limits=Limits()), duration_s=0.1, trace_hz=1000)
    same = run(Push((0, 0, -1.0), impedance()), told(), duration_s=0.1, trace_hz=1000)
    assert plain.traces[0].q.tobytes() == same.traces[0].q.tobytes()


def test_trials_with_encoders_and_delay_are_independent_of_those_beside_them():
    now = told(bits=14, delay_s=0.003)
    draws = {"robot.mass_scale": [1.0, 1.2], "start.offset_x": [0.0, 0.01]}
    both = run(Hold(STIFF), now, draws, count=2, duration_s=0.2, trace_hz=1000)
    alone = run(Hold(STIFF), now, {k: v[:1] for k, v in draws.items()}, duration_s=0.2, trace_hz=1000)
    assert both.traces[0].q.tobytes() == alone.traces[0].q.tobytes()
    assert both.traces[0].twist.tobytes() == alone.traces[0].twist.tobytes()


@pytest.mark.parametrize("ticks", [1, 7])
def test_a_torque_arrives_so_many_ticks_after_its_command(ticks):
    """What the plant gets is what the law asked for then; until then, what holds the arm."""
    now = told(delay_s=1e-3 * ticks)
    loop = begin(HoldSkill(), now, {}, generators(1))
    asked, given = [], []
    law, push = loop.drive.controller.torque, loop.drive.limb.push

    def asking(*args):
        torque, wrench = law(*args)
        asked.append(torque.copy())
        return torque, wrench

    loop.drive.controller.torque = asking
    loop.drive.limb.push = lambda torque, active: (given.append(torque.copy()), push(torque, active))[1]
    holding = loop.plant.kinematics(now.center_of_compliance).bias.copy()
    loop.prepare()
    np.testing.assert_array_equal(given[:ticks], [holding] * ticks)
    np.testing.assert_array_equal(given[ticks:], asked[:-ticks])


def test_an_arm_with_a_delay_does_not_fall_before_its_first_torque():
    trace = run(Hold(STIFF), told(delay_s=0.01), duration_s=0.05, trace_hz=1000).traces[0]
    start = run(Hold(STIFF), told(), duration_s=0.05, trace_hz=1000).traces[0]
    # free fall of 10 ms is 0.5 mm
    assert norm(trace.position - start.position[0]).max() < 1e-4


def test_a_delay_that_is_too_long_for_the_law_ends_the_trial():
    """Damping and stiffness of the law act on what was: the loop swings up until a limit ends it."""
    now = told(delay_s=0.05)
    result = run(Push((0, 0, -1.0), impedance(stiffness=4000.0), speed=0.1), now, duration_s=4.0)
    assert not result.success[0]
    assert result.ended_by[0] != "time"


def test_two_arms_and_servos_read_encoders_too():
    now = told("dual_panda", "peg_in_hole", bits=10)
    scene = replace(now.scene, holder=Holder(tool=now.scene.tool, position=(0.0, 0.0, 0.15)))
    two = begin(HoldSkill(), replace(now, scene=scene, center_of_compliance=np.zeros(3)), {}, generators(1))
    seen = two.drive.sense(0, two.active).pose.position[0]
    truth = [view.tool_pose().position[0] for view in two.drive.limb.views]
    assert (norm(seen - truth) > 1e-5).all()
    servo = begin(HoldSkill(), told("panda_servo", bits=10), {}, generators(1))
    before = servo.drive.sense(0, servo.active).pose.position.copy()
    truth = servo.plant.tool_pose().at(servo.setup.center_of_compliance).position
    assert norm(before - truth)[0] > 1e-5


@pytest.mark.parametrize("name", ["panda", "panda_servo"])
def test_what_is_read_follows_the_joints_tick_by_tick(name):
    """A push on joint 7 turns it by many counts of 14 bits; what is read is never farther off than half a count."""
    loop = begin(HoldSkill(), told(name, bits=14), {}, generators(1))
    loop.prepare()
    limb, count = loop.drive.limb, 2.0 * np.pi / 2**14
    start = loop.plant.configuration[0, 6]
    for _ in range(100):
        bias = loop.plant.kinematics(limb.point).bias
        limb.push(bias + np.array([0, 0, 0, 0, 0, 0, 1.0]), loop.active)
        nominal = getattr(limb, "arm", limb).nominal
        limb.kinematics(loop.active)
        # and rounding of the count
        assert np.abs(nominal.configuration - loop.plant.configuration).max() <= 0.5 * count * (1.0 + 1e-9)
    assert abs(loop.plant.configuration[0, 6] - start) > 10.0 * count


def test_commands_that_were_sent_before_the_start_arrive_first():
    delay = CommandDelay(np.array([2]), 1)
    delay.start(np.array([[5.0]]))
    assert [delay.step(np.array([[float(k)]]))[0, 0] for k in range(4)] == [5.0, 5.0, 0.0, 1.0]


HEAD = '[[arm]]\nname = "arm"\ntool_frame = "flange"\n'


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ("[encoders]", "gives neither bits nor step_m"),
        ("[encoders]\nbits = 4", r"encoders\.bits: is 4; give 8 to 32 bits a turn"),
        ("[encoders]\nbits = 17.0", "whole number"),
        ("[encoders]\nstep_m = 0.01", r"encoders\.step_m: is 0\.01 m"),
        ("[encoders]\nbits = 17\ncorner_hz = 600", r"corner_hz: is 600 Hz at a control rate of 1000 Hz"),
        ("[encoders]\nbits = 17\ncorner = 100", "did you mean 'corner_hz'"),
        ("[control]\ndelay_s = -0.001", r"control\.delay_s: cannot be -0\.001 s"),
        ("[control]\ndelay_s = 8", "8 ms is 0.008"),
    ],
)
def test_encoders_and_delays_that_cannot_be_are_refused(tmp_path, toml, sentence):
    (tmp_path / "panda.urdf").write_bytes(load_robot("panda").urdf.read_bytes())
    (tmp_path / "robot.toml").write_text(f'urdf = "panda.urdf"\n{HEAD}{toml}\n')
    with pytest.raises(InputError, match=sentence):
        load_robot(tmp_path)


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [("[encoders]\nbits = 17", "encoders: its drive has"), ("delay_s = 0.002", r"control\.delay_s: its drive has")],
)
def test_a_robot_whose_drive_has_its_own_control_law_takes_no_encoders_and_delays(tmp_path, toml, sentence):
    folder = load_robot("hiab_xs031").folder
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    text = text.replace("[control]\n", f"[control]\n{toml}\n") if "delay" in toml else f"{text}\n{toml}\n"
    (tmp_path / "hiab_xs031.urdf").write_bytes((folder / "hiab_xs031.urdf").read_bytes())
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=sentence):
        load_robot(tmp_path)


def test_the_shipped_pandas_differ_in_what_their_controllers_know_alone():
    ideal, counted = load_robot("panda"), load_robot("panda_encoders")
    assert ideal.encoders is None
    assert counted.encoders == Encoders(bits=17, corner_hz=100.0)
    named = {"name": "panda", "folder": ideal.folder, "summary": ideal.summary, "encoders": None}
    assert replace(counted, **named) == ideal
