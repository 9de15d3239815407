"""Motors that saturate, joints that are too fast or pressed against their end: each ends a trial with its joint."""

import json
import shutil
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run as command
from skillframe.control.motors import MOTOR_S, JointLimits, Motors, joint_limits, unstated
from skillframe.execution.trace import SHARE_JOINTS, SHARES
from skillframe.extend.reading import write_demonstration
from skillframe.frames import norm
from skillframe.robot.model import load_model
from skillframe.robot.spec import Limits, load_robot, robot_names
from skillframe.world.convert import build_spec
from skillframe.world.quantities import SensorSettings
from skillframe.world.scene import Holder
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

DT, TICKS = 1e-3, round(MOTOR_S / 1e-3)
STIFF = np.diag([1000.0] * 3 + [50.0] * 3)


def motors(rate=None, count=1):
    limits = JointLimits(
        ("shoulder", "slide"), (False, True), np.array([10.0, np.inf]), np.array([1.0, 0.5]),
        np.array([-2.0, 0.0]), np.array([1.0, 0.4]), np.ones(2),
    )  # fmt: skip
    return Motors([limits], rate, count, DT)


def after(ticks, torque=(0.0, 0.0), velocity=(0.0, 0.0), position=(0.0, 0.2)):
    drive = motors()
    rows = [np.array([value], dtype=float) for value in (torque, velocity, position)]
    given = [drive.held(*rows) for _ in range(ticks)]
    return drive, given[-1][0]


def test_torques_are_held_to_the_effort_and_no_limit_is_no_limit():
    np.testing.assert_array_equal(after(1, torque=(13.1, -500.0))[1], [10.0, -500.0])
    np.testing.assert_array_equal(after(1, torque=(-13.1, 0.0))[1], [-10.0, 0.0])
    np.testing.assert_array_equal(after(1, torque=(9.9, 0.0))[1], [9.9, 0.0])


@pytest.mark.parametrize(
    ("what", "code", "text"),
    [
        (
            {"torque": (13.1, 0.0)},
            "motor",
            "motor limit: shoulder at its 10 Nm for 100 ms, the controller commands 13.1 Nm",
        ),
        ({"velocity": (0.0, -0.6)}, "speed", "joint speed limit: slide at 0.6 m/s, above its 0.5 m/s, for 100 ms"),
        ({"position": (-2.01, 0.2)}, "range", "joint range: shoulder pressed against its end at -2 rad for 100 ms"),
        ({"position": (0.0, 0.402)}, "range", "joint range: slide pressed against its end at 0.4 m for 100 ms"),
    ],
)
def test_what_a_joint_cannot_do_for_a_tenth_of_a_second_ends_the_trial_and_one_tick_less_does_not(what, code, text):
    drive, _ = after(TICKS - 1, **what)
    assert drive.fine().all()
    drive, _ = after(TICKS, **what)
    assert not drive.fine().any()
    assert drive.broken(0) == (0, code, text)


def test_a_joint_at_its_limits_is_fine():
    assert after(2 * TICKS, torque=(10.0, 0.0), velocity=(-1.0, 0.5), position=(1.0, 0.0))[0].fine().all()


def test_a_moment_within_the_limits_starts_the_count_again():
    drive, _ = after(TICKS - 1, torque=(20.0, 0.0))
    zero = np.zeros((1, 2))
    drive.held(zero, zero, zero)
    for _ in range(TICKS - 1):
        drive.held(np.array([[20.0, 0.0]]), zero, zero)
    assert drive.fine().all()


def test_shares_are_those_of_the_worst_joint_and_unknown_where_no_limit_is_given():
    """The range of the shoulder is -2 to 1: at -1.4 it is 0.9 of 1.5 from the middle. The slide is in its middle."""
    (torque, speed, place), joints = after(
        3, torque=(-15.0, 900.0), velocity=(0.2, 0.3), position=(-1.4, 0.2)
    )[0].shares()  # fmt: skip
    assert torque[0] == 1.5
    assert speed[0] == pytest.approx(0.6)
    assert place[0] == pytest.approx(0.6)
    assert joints[:, 0].tolist() == ["shoulder", "slide", "shoulder"]
    none = np.full(2, np.inf)
    silent = Motors([JointLimits(("a", "b"), (False,) * 2, none, none, -none, none, np.zeros(2))], 1000.0, 1, DT)
    silent.held(*np.ones((3, 1, 2)))
    shares, joints = silent.shares()
    assert np.isnan(shares).all()
    assert (joints == "").all()


@pytest.mark.parametrize(("position", "share"), [(-0.5, 0.0), (1.0, 1.0), (-2.0, 1.0), (0.25, 0.5)])
def test_the_share_of_a_range_is_0_in_its_middle_and_1_at_either_end(position, share):
    """To rounding; the slide stands in its middle."""
    assert after(1, position=(position, 0.2))[0].shares()[0][2, 0] == pytest.approx(share, abs=1e-15)


def test_a_range_that_is_not_given_has_no_share_and_still_ends_a_trial():
    limits = JointLimits(
        ("elbow",), (False,), *(np.array([x]) for x in (9.0, 1.0, -2.0 * np.pi, 2.0 * np.pi)), np.zeros(1)
    )
    drive = Motors([limits], None, 1, DT)
    for _ in range(TICKS):
        drive.held(np.zeros((1, 1)), np.zeros((1, 1)), np.array([[2.0 * np.pi + 0.01]]))
    assert np.isnan(drive.shares()[0][2, 0])
    assert drive.broken(0).code == "range"


def panda(effort=None, velocity=None):
    """The shipped arm with other figures in its URDF's limits."""
    spec = load_robot("panda")
    model = load_model(replace(spec, limits=Limits()))
    for joint in model.urdf.joints.values():
        limit = joint.element.find("limit")
        for name, value in (("effort", effort), ("velocity", velocity)):
            if limit is not None and value is not None:
                limit.set(name, value)
    return model


def insertion(robot):
    """A peg pushed into its hole for 3 s: what every sound arm here does."""
    now = replace(setup("panda", "peg_in_hole"), robot=robot, sensors=SensorSettings())
    return run(Push((0.0, 0.0, -1.0), impedance("x", "y"), speed=0.03, stall=True), now, duration_s=4.0, trace_hz=10)


@pytest.mark.slow
def test_a_sound_arm_inserts_and_one_whose_motors_give_a_hundredth_of_a_newton_metre_does_not():
    sound, weak, slow = insertion(panda()), insertion(panda(effort="0.01")), insertion(panda(velocity="0.0001"))
    assert sound.success[0], sound.failure[0]
    assert 0.0 < sound.peak_torque_share[0] < 1.0 and 0.0 < sound.peak_speed_share[0] < 1.0
    assert 0.0 < sound.peak_range_share[0] < 1.0
    assert not weak.success[0]
    assert weak.failure[0].startswith("motor limit: joint") and weak.ended_by[0] == "motor"
    assert not slow.success[0]
    assert slow.failure[0].startswith("joint speed limit: joint") and slow.ended_by[0] == "speed"
    assert slow.duration_s[0] < 1.0


def test_an_effort_just_below_what_holding_needs_ends_the_trial_and_one_just_above_does_not():
    """Holding still takes gravity's torque. Its largest share of an effort is measured with the sound arm first."""

    def held(effort):
        now = replace(setup("panda", "free", "wrist"), robot=panda(effort=effort))
        return run(Hold(STIFF), now, duration_s=0.3, trace_hz=10)

    needed = 87.0 * held("87").peak_torque_share[0]
    assert held(f"{1.001 * needed}").success[0]
    assert held(f"{0.999 * needed}").failure[0].startswith("motor limit: joint2 at its")


@pytest.mark.parametrize("given", ["0", "0.0"])
def test_zero_means_not_given_and_the_result_says_so(given):
    result = run(Hold(STIFF), replace(setup("panda", "free"), robot=panda(effort=given, velocity=given)),
                 duration_s=0.2, trace_hz=10)  # fmt: skip
    assert result.success[0]
    assert np.isnan(result.peak_torque_share[0])
    (note,) = result.traces[0].meta["notes"]
    assert note.startswith("the URDF gives no effort or no velocity for joint1, joint2, joint3 and 4 more")


def test_a_joint_whose_range_is_not_given_is_named_and_the_others_are_judged(tmp_path):
    """The worst of the others is found from URDF and configuration."""
    tree = ElementTree.parse(load_robot("panda").urdf)
    limit = tree.find("joint[@name='joint4']/limit")
    limit.attrib.pop("lower")
    limit.attrib.pop("upper")
    tree.write(tmp_path / "panda.urdf")
    robot = load_model(replace(load_robot("panda"), urdf=tmp_path / "panda.urdf"))
    assert unstated(robot) == ["the URDF gives no range for joint4; it counts as free within +-2 pi rad or +-10 m"]
    result = run(Hold(STIFF), replace(setup("panda", "free"), robot=robot), duration_s=0.05, trace_hz=1000)
    trace = result.traces[0]
    assert trace.meta["notes"] == unstated(robot)
    limits = [robot.urdf.joints[f"joint{k}"].element.find("limit") for k in range(1, 8)]
    low, high = (np.array([float(x.get(end, "nan")) for x in limits]) for end in ("lower", "upper"))
    share = (np.abs(trace.q - (low + high) / 2) / ((high - low) / 2)).max(axis=0)
    # a trace has every tick but the last; a tenth of a second of holding still moves no joint by 1e-3 of its range
    assert result.peak_range_share[0] == pytest.approx(np.nanmax(share), abs=1e-3)
    assert result.peak_range_joint[0] == f"joint{np.nanargmax(share) + 1}"
    assert trace.meta["peak_range_joint"] == result.peak_range_joint[0]


def test_a_free_flying_tool_has_no_motors_and_nothing_to_say():
    result = run(Hold(STIFF), setup(world="free"), duration_s=0.05, trace_hz=10)
    assert np.isnan(result.peak_torque_share[0])
    assert result.traces[0].meta["notes"] == []


def test_a_motor_at_its_effort_is_not_said_to_change_its_torque_too_fast():
    """The law goes on asking for 30 Nm, of which the motor gives 10: after 10 ticks of 1 Nm nothing changes."""
    drive, zero = motors(rate=1000.0), np.zeros((1, 2))
    drive.held(zero, zero, zero)
    given = [drive.held(np.array([[30.0, 0.0]]), zero, zero)[0, 0] for _ in range(TICKS)]
    np.testing.assert_allclose(given[:12], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10, 10])
    assert drive.broken(0).code == "motor"


def test_limits_stand_in_the_order_of_the_simulator():
    robot, now = panda(), setup("panda", "free")
    (limits,) = joint_limits(robot, build_spec(robot, now.scene).compile())
    tree = ElementTree.parse(robot.spec.urdf)
    for i, name in enumerate(limits.names):
        written = tree.find(f"joint[@name='{name}']/limit")
        assert [float(written.get(k)) for k in ("effort", "velocity", "lower", "upper")] == [
            part[i] for part in (limits.effort, limits.velocity, limits.lower, limits.upper)
        ]
    assert limits.ranged.all()


def test_motors_of_two_arms_are_watched_on_both():
    model = load_model(load_robot("dual_panda"))
    now = setup("dual_panda", "peg_in_hole", np.zeros(3))
    scene = replace(now.scene, holder=Holder(tool=now.scene.tool, position=(0.0, 0.0, 0.15)))
    causes = {}
    for name, joint in model.urdf.joints.items():
        limit = joint.element.find("limit")
        if joint.type != "revolute" or not name.endswith("joint2"):
            continue
        kept = limit.get("effort")
        limit.set("effort", "0.01")
        result = run(Hold(STIFF), replace(now, robot=model, scene=scene), duration_s=0.2)
        causes[name] = result.failure[0]
        assert result.peak_torque_joint[0] == name
        assert result.peak_torque_share[0] > 1.0
        limit.set("effort", kept)
    assert len(causes) == 2
    for name, cause in causes.items():
        assert f"motor limit: {name} at its 0.01 Nm" in cause


def test_rows_with_motors_are_independent():
    """A trial beside one whose arm is heavier than its motors carry runs as it does alone, to the last bit."""
    now = replace(setup("panda", "free"), robot=panda(effort="40"))
    both = run(Hold(STIFF), now, {"robot.mass_scale": [1.0, 2.0]}, count=2, duration_s=0.3, trace_hz=1000)
    alone = run(Hold(STIFF), now, {"robot.mass_scale": [1.0]}, count=1, duration_s=0.3, trace_hz=1000)
    assert norm(both.traces[0].position - alone.traces[0].position).max() == 0.0
    for name in (*SHARES, *SHARE_JOINTS):
        assert getattr(both, name)[0] == getattr(alone, name)[0]


@pytest.mark.slow  # a campaign and its report
@pytest.mark.needs_plugins
@pytest.mark.parametrize("given", [True, False])
def test_a_campaign_its_report_and_a_run_say_what_the_urdf_does_not_limit(tmp_path, capsys, given):
    folder = tmp_path / "my_panda"
    shutil.copytree(robot_names()["panda"], folder)
    tree = ElementTree.parse(folder / "panda.urdf")
    if not given:
        tree.find("joint[@name='joint3']/limit").attrib.pop("velocity")
    tree.write(folder / "panda.urdf")
    write_demonstration(example_demonstrations()[0], tmp_path / "left.npz")
    skill = f"lmc:{tmp_path / 'left.npz'}"
    text = "the URDF gives no effort or no velocity for joint3; what it does not give counts as unlimited"
    told = ["--world", "valley", "--robot", str(folder), "--duration", "0.1", "--json"]
    assert command(["run", skill, *told]) == 1
    assert (text in json.loads(capsys.readouterr().out)["notes"]) != given
    plan = ['name = "c"', "seed = 1", "trials = 2", "duration_s = 0.1", 'robot = "my_panda"', 'world = "valley"']
    plan += [f'skills = ["{skill}"]', "[vary]", '"world.friction" = { uniform = [0.1, 0.2] }', ""]
    (tmp_path / "c.toml").write_text("\n".join(plan))
    assert command(["campaign", "run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "c")]) == 0
    assert (f"note: {text}" in capsys.readouterr().err) != given
    assert command(["report", str(tmp_path / "c"), "--out", str(tmp_path / "c.html")]) == 0
    assert (f"T{text[1:]}." in (tmp_path / "c.html").read_text(encoding="utf-8")) != given
