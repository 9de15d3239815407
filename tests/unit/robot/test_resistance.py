"""Friction and damping of joints: what robot.toml says in place of the URDF, and what they take of a push."""

import shutil

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.errors import InputError, UnknownName
from skillframe.extend.reading import write_demonstration
from skillframe.robot.audit import PUSH, SPEED, TURNING, audit, hurting, resistance_note, resistances
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names

ARM = '[[arm]]\nname = "arm"\ntool_frame = "hand"\n'


def arm(save, urdf, dynamics='<dynamics damping="3" friction="4"/>', toml="", kind="revolute"):
    """One joint about x (or along it), its hand 0.5 m out along z."""
    text = urdf.robot(
        urdf.link("base"), urdf.link("l", urdf.inertial(2.0, 0.5)), urdf.link("hand"),
        urdf.joint("j", "base", "l", kind=kind, inside=urdf.LIMIT + dynamics),
        urdf.joint("f", "l", "hand", "fixed", xyz="0 0 0.5", inside=""),
    )  # fmt: skip
    return load_model(load_robot(save(text, ARM + toml)))


def test_what_a_turning_joint_takes_of_a_push_is_its_friction_and_damping_over_its_lever(save, urdf):
    (found,) = resistances(arm(save, urdf))
    square = 0.5**2 + TURNING**2
    # to rounding
    assert found.push == pytest.approx(4.0 / np.sqrt(square) + 3.0 * SPEED / square, rel=1e-12)
    assert found.figures == "friction 4 Nm and damping 3 Nm s/rad"


def test_a_sliding_joint_takes_its_friction_and_its_damping_times_the_speed(save, urdf):
    (found,) = resistances(arm(save, urdf, kind="prismatic"))
    assert found.push == pytest.approx(4.0 + 3.0 * SPEED, rel=1e-12)
    assert found.figures == "friction 4 N and damping 3 N s/m"


@pytest.mark.parametrize(
    ("toml", "friction", "damping"),
    [
        ("", 4.0, 3.0),
        ("[dynamics]\ncompensate = true", 4.0, 3.0),
        ("[dynamics.joint]\nj = { friction = 0.25 }", 0.25, 3.0),
        ("[dynamics.joint]\nj = { friction = 0.0, damping = 0.0 }", 0.0, 0.0),
        ("[dynamics]\njoint.j.damping = 7", 4.0, 7.0),
    ],
)
def test_robot_toml_replaces_what_it_names_and_leaves_the_rest(save, urdf, toml, friction, damping):
    model = arm(save, urdf, toml=toml).model
    assert (model.friction[0], model.damping[0]) == (friction, damping)


def test_robot_toml_gives_friction_where_the_urdf_has_none(save, urdf):
    model = arm(save, urdf, dynamics="", toml="[dynamics.joint]\nj = { friction = 0.25 }").model
    assert (model.friction[0], model.damping[0]) == (0.25, 0.0)


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ("[dynamics.joint]\nj = { friction = -1.0 }", r"dynamics\.joint\.j\.friction: is -1; give 0 or more"),
        ("[dynamics.joint]\nj = { damping = inf }", r"dynamics\.joint\.j\.damping: is inf"),
        ("[dynamics.joint]\nj = { drag = 1.0 }", "unknown key 'drag'|drag"),
        ("[dynamics]\ncompensate = 1", "expected true or false"),
    ],
)
def test_impossible_values_are_refused(save, urdf, toml, sentence):
    with pytest.raises(InputError, match=sentence):
        arm(save, urdf, toml=toml)


def test_an_unknown_joint_is_refused(save, urdf):
    with pytest.raises(UnknownName, match=r"named in .*'s \[dynamics\]"):
        arm(save, urdf, toml="[dynamics.joint]\nk = { friction = 1.0 }")


def test_a_robot_whose_drive_has_its_own_control_law_is_not_told_to_compensate_friction(tmp_path):
    folder = load_robot("hiab_xs031").folder
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    (tmp_path / "hiab_xs031.urdf").write_bytes((folder / "hiab_xs031.urdf").read_bytes())
    (tmp_path / "robot.toml").write_text(f"{text}\n[dynamics]\ncompensate = true\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"dynamics\.compensate: its drive has a control law of its own"):
        load_robot(tmp_path)


def test_the_audit_names_a_joint_that_resists_and_its_cure_cures_it(save, urdf):
    robot = arm(save, urdf)
    (problem,) = [p for p in audit(robot).problems if p.code == "joint_resists"]
    assert problem.severity == "warning"
    assert problem.where == "j"
    assert "friction 4 Nm and damping 3 Nm s/rad, which takes 8.1 N of the 20 N" in problem.message
    lines = problem.fix.split("\n", 1)[1]
    assert not hurting(arm(save, urdf, toml=lines))
    assert "robot.toml's [dynamics]" in resistance_note(robot)
    assert "j (friction 4 Nm and damping 3 Nm s/rad: 8.1 N of a push); the controller does not know" in (
        resistance_note(robot)
    )
    told = arm(save, urdf, toml="[dynamics]\ncompensate = true")
    assert "compensates them while a joint moves, not at rest" in resistance_note(told)


def test_a_joint_just_below_the_threshold_is_not_named(save, urdf):
    for share, named in ((0.999, False), (1.001, True)):
        friction = share * PUSH * np.sqrt(0.5**2 + TURNING**2)
        robot = arm(save, urdf, dynamics="", toml=f"[dynamics.joint]\nj = {{ friction = {friction} }}")
        assert bool(hurting(robot)) == named
        assert bool(resistance_note(robot)) == named


def test_a_bare_urdf_with_followers_counts_by_whatever_frame_moves_most(save, urdf):
    """Joint k follows j and has no freedom of its own; the tip is 0.3 m from the axis of j at home."""
    follow = f'{urdf.LIMIT}<mimic joint="j"/><dynamics friction="9"/>'
    text = urdf.robot(
        urdf.link("a"), urdf.link("b", urdf.inertial(1, 0.3)), urdf.link("c", urdf.inertial(1, 0.2)),
        urdf.joint("j", "a", "b", inside=urdf.LIMIT + '<dynamics friction="4"/>'),
        urdf.joint("k", "a", "c", inside=follow), urdf.link("d"),
        urdf.joint("t", "b", "d", "fixed", xyz="0 0 0.3", inside=""),
    )  # fmt: skip
    (found,) = resistances(load_model(load_robot(save(text))))
    assert found.joint == "j"
    assert found.push == pytest.approx(4.0 / np.hypot(0.3, TURNING), rel=1e-12)


def test_joints_that_carry_no_tool_do_not_count_and_shipped_arms_do_not_resist(save, urdf):
    text = urdf.robot(
        urdf.link("base"), urdf.link("hand", urdf.inertial(2.0, 0.5)), urdf.link("finger", urdf.inertial(0.1, 0.05)),
        urdf.joint("j", "base", "hand"),
        urdf.joint("g", "hand", "finger", inside=urdf.LIMIT + '<dynamics friction="50"/>'),
    )  # fmt: skip
    assert resistances(load_model(load_robot(save(text, ARM)))) == []
    for name in ("panda", "dual_panda", "free_tool"):
        assert not hurting(load_model(load_robot(name)))


@pytest.mark.needs_plugins
@pytest.mark.parametrize("friction", [5.0, 0.0])
@pytest.mark.slow
def test_a_run_and_a_campaign_that_fail_name_the_joints_that_resist(tmp_path, capsys, friction):
    """No skill ends within 0.1 s. The largest share is 5 Nm over the lever of 0.1 m: 50 N."""
    folder = tmp_path / "stiff_panda"
    shutil.copytree(robot_names()["panda"], folder)
    with (folder / "robot.toml").open("a") as file:
        file.write(f"\n[dynamics.joint]\njoint7 = {{ friction = {friction} }}\n")
    write_demonstration(example_demonstrations()[0], tmp_path / "left.npz")
    skill = f"lmc:{tmp_path / 'left.npz'}"
    text = "note: joints of stiff_panda resist: joint7 (friction 5 Nm: 50 N of a push); the controller does not know"
    assert run(["run", skill, "--world", "valley", "--robot", str(folder), "--duration", "0.1"]) == 1
    assert (text in capsys.readouterr().err) == bool(friction)
    campaign = ['name = "c"', "seed = 1", "trials = 2", "duration_s = 0.1", 'robot = "stiff_panda"', 'world = "valley"']
    campaign += [f'skills = ["{skill}"]', "[vary]", '"world.friction" = { uniform = [0.1, 0.2] }', ""]
    (tmp_path / "c.toml").write_text("\n".join(campaign))
    assert run(["campaign", "run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "c")]) == 0
    assert (text in capsys.readouterr().err) == bool(friction)
