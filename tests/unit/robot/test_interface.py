"""[control] of robot.toml for arms that take velocities or positions: what follows, and what is refused, in words."""

import json
import math
import shutil

import pytest

from skillframe.errors import SkillframeError
from skillframe.extend.drives import audit
from skillframe.files import data_dirs
from skillframe.robot.describe import describe
from skillframe.robot.interface import LEVER, TAUGHT_SPEED, Control
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

POSITION = 'interface = "position"\nrate_hz = 500\n'


@pytest.fixture
def robot(tmp_path):
    """Makes a Panda whose [control] is as given, with other text after it."""
    source = next(folder / "panda" for folder in data_dirs("robots") if (folder / "panda").is_dir())

    def make(control, more="", replaced=("", "")):
        folder = tmp_path / "arm"
        shutil.copytree(source, folder, dirs_exist_ok=True)
        text = (source / "robot.toml").read_text().replace("rate_hz = 1000\n", control).replace(*replaced)
        (folder / "robot.toml").write_text(text + more)
        return load_robot(folder)

    return make


def test_by_default_an_arm_takes_torques_and_nothing_is_slower():
    control = load_robot("panda").control
    assert control == Control() and control.interface == "torque"
    assert (control.tick_hz, control.pace()) == (1000.0, 1.0)
    assert control.figures() == {"takes": "torque", "rate_hz": 1000.0}


def test_the_total_delay_counts_transport_hold_lag_and_the_servo_below(robot):
    """500 Hz, 8 ms, 15 Hz: 8 + 1 + 2 x 0.8 / (2 pi 15) + 2 / (2 pi 30), that is 8 + 1 + 17.0 + 10.6 ms."""
    arm = robot(POSITION).control.admittance
    assert arm.total_delay == pytest.approx(0.008 + 0.001 + 0.01698 + 0.01061, abs=1e-5)
    assert arm.damping == pytest.approx(1.5 * 5e4 * arm.total_delay)
    assert arm.turning_damping() == pytest.approx(arm.damping * LEVER**2)
    assert arm.turning_damping(0.2) == pytest.approx(arm.damping * 0.2**2)
    assert arm.speed == pytest.approx(20.0 / arm.damping)
    assert arm.slow_down() == pytest.approx(TAUGHT_SPEED * arm.damping / 20.0)
    assert arm.slow_down(0.015) == pytest.approx(0.015 * arm.damping / 20.0)
    assert arm.slow_down(0.001) == 1.0  # a skill that is slower than the arm keeps its own time
    velocity = robot('interface = "velocity"\ndelay_s = 0.003\nbandwidth_hz = 50.0\n').control.admittance
    assert velocity.total_delay == pytest.approx(0.003 + 0.0005 + 1 / (2 * math.pi * 50) + 0.01061, abs=1e-5)


def test_what_is_given_is_taken(robot):
    given = ("delay_s = 0.02", "bandwidth_hz = 10", "contact_stiffness = 1e4", "contact_turning_stiffness = 80.0")
    arm = robot(POSITION + "\n".join([*given, "push_n = 30.0", "push_nm = 3.0", ""])).control.admittance
    assert (arm.delay_ticks, arm.ticks, arm.stiffness, arm.push) == (20, 2, 1e4, (30.0, 3.0))
    assert arm.turning_damping(0.5) == pytest.approx(1.5 * 80.0 * arm.total_delay)


@pytest.mark.parametrize(
    ("control", "words"),
    [
        ('interface = "position"\n[encoders]\nbits = 17\n', "encoders is for arms that take torques"),
        ('interface = "velocity"\n[dynamics]\ncompensate = true\n', "dynamics.compensate is for arms that"),
        ("rate_hz = 1000\npush_n = 10\n", "control.push_n is for arms that take velocities or positions"),
        ('interface = "force"\n', 'control.interface'),
        ('interface = "position"\nrate_hz = 300\n', "rate_hz is 300, and the simulated arm's 1000 Hz is no whole"),
        ('interface = "position"\nrate_hz = 2000\n', "control.rate_hz is 2000"),
        (POSITION + "delay_s = -0.1\n", "control.delay_s is -0.1; give a positive"),
        (POSITION + "delay_s = 0.0085\n", "control.delay_s is 0.0085 s, not a whole number of milliseconds"),
        (POSITION + "delay_s = nan\n", "control.delay_s is not a number"),
        (POSITION + "bandwidth_hz = 0\n", "control.bandwidth_hz is 0"),
        (POSITION + "bandwidth_hz = 500\n", "control.bandwidth_hz is 500 Hz, faster than an arm's inner loop"),
        (POSITION + "contact_stiffness = inf\n", "control.contact_stiffness is inf"),
        (POSITION + "push_n = 0\n", "control.push_n is 0"),
        (POSITION + "stiffness = 3\n", "contact_stiffness"),
    ],
)  # fmt: skip
def test_what_no_arm_can_be_told_is_refused_with_its_key(robot, control, words):
    with pytest.raises(SkillframeError) as raised:
        robot(control)
    assert words in " ".join(str(raised.value).replace(":", "").split()) or words in str(raised.value)


def test_an_arm_that_would_be_stable_only_if_it_stood_still_is_refused_with_the_figures(robot):
    figures = r"answers 162 ms late.*2\.44e\+05 Ns/m.*1e\+06 N/m.*0\.082 mm/s: it cannot be stable and move"
    with pytest.raises(SkillframeError, match=figures) as raised:
        robot(POSITION + "delay_s = 0.119\nbandwidth_hz = 8.0\ncontact_stiffness = 1e6\n")
    assert "push_n = 122" in str(raised.value)


def test_a_slow_arm_and_a_late_one_are_warned_of_and_a_usual_one_is_not(robot):
    def doubts(text):
        return [p.message for p in audit(robot(POSITION + text)).problems if p.code == "slow_interface"]

    assert doubts("") == []
    assert doubts("contact_stiffness = 2e5\n") == ["at 20 N the tool moves at 1.8 mm/s, 11 times slower than taught"]
    late = doubts("delay_s = 0.06\ncontact_stiffness = 1e4\n")
    assert late == ["the arm answers 89 ms late, where 20 to 80 ms are usual"]


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("dual_panda", "has several arms"), ("hiab_xs031", "is a machine"), ("free_tool", "stands on a free base"),
        ("panda_servo", "is a machine whose joints are driven as [[actuation]] says"),
    ],
)  # fmt: skip
def test_what_is_no_single_arm_on_a_fixed_base_keeps_torques(tmp_path, name, what):
    source = next(folder / name for folder in data_dirs("robots") if (folder / name).is_dir())
    shutil.copytree(source, tmp_path / name)
    shutil.copytree(source.parent / "panda", tmp_path / "panda")  # whose URDF the servo arm's is
    path = tmp_path / name / "robot.toml"
    text = path.read_text()
    path.write_text(text.replace("[control]\n", '[control]\ninterface = "position"\n'))
    with pytest.raises(SkillframeError) as raised:
        load_robot(tmp_path / name)
    assert what in str(raised.value) and "which one arm on a fixed base takes" in str(raised.value)


def test_check_and_show_tell_delay_damping_speed_and_slow_down(robot):
    from skillframe.cli.main import run

    spec = robot(POSITION)
    told = (
        "takes a position 500 times a second and answers 37 ms late; damping 2744 Ns/m and 5.6 Nms/rad for contacts "
        "of 5e+04 N/m; at most 7.3 mm/s at 20 N, so skills take 2.7 times as long as taught"
    )
    assert told in describe(load_model(spec))
    assert spec.control.admittance.told() == told
    assert run(["robots", "--check", str(spec.folder)]) == 0


def test_scripts_get_the_figures(robot, capsys):
    from skillframe.cli.main import run

    folder = str(robot(POSITION).folder)
    for words in (["--check"], []):
        assert run(["robots", *words, folder, "--json"]) == 0
        figures = json.loads(capsys.readouterr().out)["interface"]
        assert figures["takes"] == "position" and figures["slow_down"] == pytest.approx(2.744, abs=1e-3)
