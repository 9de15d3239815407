"""An exported URScript program against `skillframe drive run`, number by number, and in the fake controller."""

import copy
import json
import re
import shutil
import socket
from dataclasses import replace

import numpy as np
import pytest
from direct_link import arm
from rehearsal import host, start_fake
from replay import MODEL, RESTS, H, by_drive, by_program
from skillframe_ur.fake import FakeUr
from skillframe_ur.program import program

import skillframe
from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.frames import rotation_matrix, unit
from skillframe.robot.spec import Limits, load_robot

NOTHING = {"desired_direction": None, "speed": 0.0}


def part(rng, k, **changes):
    """A part that pushes in a random direction, free along one across it."""
    push = unit(rng.normal(size=3))
    free = unit(np.cross(push, rng.normal(size=3)))
    return {
        "desired_direction": push.tolist(), "speed": 0.016, "compliant_axes": [free.tolist()],
        "fully_compliant": False, "stiffness": (k * (np.eye(3) - np.outer(free, free))).tolist(),
        "damping": np.eye(3).tolist(), "evidence": {}, **changes,
    }  # fmt: skip


def document(seed=0, axes="base", translation=None, rotation=None, **stop):
    rng = np.random.default_rng(seed)
    center, tip = rng.uniform(-0.05, 0.05, 3), [0.0, 0.0, 0.2]
    phase = {
        "translation": part(rng, 1000.0, **(translation or {})), "pitch": None, "stop": stop,
        "rotation": part(rng, 40.0, **{"speed": 0.1, **(rotation or {})}),
    }  # fmt: skip
    frame = {
        "axes": axes, "center_of_compliance": center.tolist(), "learned_at": [0.0] * 3, "work_at": [0.0] * 3,
        "frames": {"tip": tip},
    }  # fmt: skip
    return {
        "format": "skillframe.skill", "version": 1, "type": "lmc", "type_version": 1, "created_by": {"by": "hand"},
        "learned_from": [], "frame": frame, "phases": [phase],
    }  # fmt: skip


def down(**stop):
    """A skill for the valley: push down, free along x, as the shipped teacher's demonstrations teach it."""
    stiff = np.diag([0.0, 1000.0, 1000.0]).tolist()
    made = document(
        translation={"desired_direction": [0.0, 0.0, -1.0], "compliant_axes": [[1.0, 0.0, 0.0]], "stiffness": stiff},
        rotation={**NOTHING, "compliant_axes": [], "stiffness": (40.0 * np.eye(3)).tolist()}, **stop,
    )  # fmt: skip
    made["frame"]["center_of_compliance"] = [0.0] * 3
    return made


def series(seed, ticks, rest=False):
    """Joints and wrenches (T, 12): at rest, then motion, contact that rings, and rest again where `rest`."""
    rng = np.random.default_rng(seed)
    time = H * np.arange(ticks)
    made = np.zeros((RESTS + ticks, 12))
    made[:, :6] = MODEL.home
    size = np.repeat([1e-3, 4.0, 0.4], [6, 3, 3]) * np.minimum(1.0, 3.0 * time / time[-1])[:, None]
    if rest:
        size[ticks // 2 :] *= np.exp(-np.arange(ticks - ticks // 2) / 20.0)[:, None]
    for hertz in (0.7, 3.0, 7.5, 15.0):
        made[RESTS:] += size * rng.normal(size=12) * np.sin(2.0 * np.pi * hertz * time[:, None] + rng.uniform(0, 6, 12))
    made[RESTS:, :6] -= made[RESTS, :6] - MODEL.home
    made[:, 6:] += rng.normal(size=(RESTS + ticks, 6)) * np.repeat([0.1, 0.01], 3) + rng.normal(size=6)
    return made


def text_of(made, robot="ur5e"):
    return program(made, load_robot(robot), ["a test"])


def loaded(made, tmp_path):
    path = tmp_path / "made.skill.json"
    path.write_text(json.dumps(made))
    return skillframe.LearnedSkill.load(path)


def compared(made, given, tmp_path, robot="ur5e"):
    """What the program sent, which is what `drive run` sent."""
    theirs, ours = by_drive(loaded(made, tmp_path), given, robot), by_program(text_of(made, robot), given)
    assert ours.success == theirs.success and ours.sent.shape == theirs.sent.shape, (ours.reason, theirs.reason)
    assert np.abs(ours.sent - theirs.sent).max() < 1e-9  # rad; their rounding differs by some 1e-15
    assert np.ptp(ours.sent, axis=0).max() > 1e-4  # they moved
    return ours, theirs


SOFT = {"stiffness": np.zeros((3, 3)).tolist()}
SKILLS = {
    "push and turn": document(1),
    "in the tool's axes": document(2, "phase_start"),
    "push alone": document(3, "phase_start", rotation=NOTHING),
    "turn alone": document(4, translation=NOTHING),
    "neither": document(5, translation=NOTHING, rotation=NOTHING, time_limit_s=0.1),
    "no stiffness along the push": document(6, translation=SOFT),
    "fast, with a short lead": document(7, translation={"speed": 0.2}, lead_force_n=2.0, lead_torque_nm=0.2),
}


def test_the_first_cycles_of_a_program_are_those_of_drive_run(tmp_path):
    compared(document(1), series(2, 60), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", SKILLS)
def test_a_program_sends_what_drive_run_sends(name, tmp_path):
    compared(SKILLS[name], series(sum(map(ord, name)), 200), tmp_path)


@pytest.mark.slow
def test_a_program_ends_as_drive_run_ends(tmp_path):
    """Each end of a skill, and the robot's force limit, in the same cycle."""
    given = series(1, 400, rest=True)
    still = {"lead_force_n": 2.0, "stall_s": 0.03, "stall_m": 2e-4, "stall_rad": 3e-4}
    ends = [
        ("came to rest", still), ("time limit", {"time_limit_s": 0.2}), ("turned too far", {"travel_limit_m": 2e-3}),
        ("turned too far", {"turn_limit_rad": 0.01}), ("above the skill's limit", {"force_limit_n": 5.0}),
    ]  # fmt: skip
    for words, stop in ends:
        ours, theirs = compared(document(1, **stop), given, tmp_path)
        assert words in ours.reason and len(ours.sent) < 400 and theirs.reason
    strong = given * np.repeat([1.0, 30.0], 6)
    ours, theirs = compared(document(1, force_limit_n=500.0), strong, tmp_path)
    assert "the robot's limit" in ours.reason and "force limit" in theirs.reason


@pytest.mark.slow
def test_a_weak_wrench_counts_as_none_where_it_does_in_drive_run(tmp_path):
    given = series(5, 200) * np.repeat([1.0, 0.05], 6)  # around the threshold of 0.5 N and 0.03 Nm
    compared(document(1), given, tmp_path)


@pytest.mark.slow
def test_slow_joints_hold_a_program_back_as_they_hold_drive_run(tmp_path):
    slow = tmp_path / "slow"
    shutil.copytree(load_robot("ur5e").folder, slow)
    text, count = re.subn(r'velocity="[\d.]+"', 'velocity="0.01"', (slow / "ur5e.urdf").read_text())
    assert count == 6
    (slow / "ur5e.urdf").write_text(text)
    given = series(4, 200)
    given[:, :6] = MODEL.home + 4.0 * (given[:, :6] - MODEL.home)  # further from the command than the leash
    ours, _ = compared(SKILLS["in the tool's axes"], given, tmp_path, str(slow))
    assert (np.abs(np.diff(ours.sent, axis=0)).max(axis=1) == 0.0).any()  # it waited
    assert np.abs(np.diff(ours.sent, axis=0)).max() == pytest.approx(0.01 * H)


def in_fake(text, **truth):
    """The fake controller after it ran a program: its arm, what it said, and the largest true force."""
    said: list[str] = []
    fake = FakeUr(arm("ur5e", **truth), host(), lockstep=True, say=said.append)
    try:
        fake.load(text.encode())
        peak = 0.0
        while fake.had_clients():
            fake.run(iter((False, True)).__next__)
            peak = max(peak, fake.arm.contact_n)
    finally:
        fake.close()
    return fake, said, peak


@pytest.mark.slow
def test_a_program_in_the_fake_controller_does_the_task_as_the_simulation_does(tmp_path):
    """Duration within 2 % and peak within 2 N of the simulation, success by the fake's own truth."""
    made = down()
    fake, said, peak = in_fake(text_of(made))
    simulated = skillframe.run(loaded(made, tmp_path), "valley", "ur5e", seed=0)
    assert simulated.success and fake.arm.ground().goal, said
    assert any("success: came to rest while pushing" in each for each in said), said
    assert fake.commands * H == pytest.approx(simulated.duration_s, rel=0.02)
    assert peak == pytest.approx(simulated.peak_force_n, abs=2.0)


@pytest.mark.slow
def test_a_program_that_pushes_too_hard_ends_with_its_own_reason(tmp_path):
    fake, said, peak = in_fake(text_of(down(force_limit_n=8.0)), fixture__offset_x=0.004)
    assert any("failure: contact force above the skill's limit of 8 N" in each for each in said), said
    assert 8.0 < peak < 50.0 and not fake.arm.ground().goal


def test_a_program_does_not_move_another_robot_nor_one_in_contact():
    text = text_of(down()).replace("[0.0, 0.0, 0.1625]", "[0.0, 0.0, 0.1725]")
    assert "another robot than ur5e" in by_program(text, series(0, 3)).reason
    shaken = series(0, 3)
    shaken[RESTS // 2, 0] += 3e-3
    found = by_program(text_of(down()), shaken)
    assert "start in free air" in found.reason and not len(found.sent)


def test_a_program_gives_up_near_a_singular_posture_and_where_the_tool_is_turned_away():
    given = series(0, 60)
    nearer = text_of(document(1)).replace("norm(turn_error) > 3.0", "norm(turn_error) > 0.001")
    assert "3.0 rad away" in by_program(nearer, given).reason
    given[:, 4] = 0.0
    assert "singular posture" in by_program(text_of(document(1)), given).reason


def test_a_program_ends_before_a_joint_passes_its_end():
    text, end = text_of(document(1)), 6.283185307179586
    given = series(0, 60)
    first = by_program(text, given).sent[:, 5]
    nearer = float(first.max() + first.min()) / 2.0 if np.ptp(first) > 0.0 else 0.0
    name = "upper" if first.argmax() > first.argmin() else "lower"
    old = re.search(rf"local {name} = \[.*\]", text)[0]
    new = re.sub(r"-?[\d.]+\]$", f"{nearer:.9f}]", old)
    assert str(end) in old
    found = by_program(text.replace(old, new), given)
    assert "end of its range" in found.reason and 0 < len(found.sent) < len(first)
    assert (found.sent[:, 5].max() <= nearer) if name == "upper" else (found.sent[:, 5].min() >= nearer)


def changed(made, **keys):
    made = copy.deepcopy(made)
    made.update(keys)
    return made


@pytest.mark.parametrize(
    ("made", "robot", "said"),
    [
        (changed(down(), type="seat"), "ur5e", "is of type seat"),
        (down(), "ur5e_torque", "takes a joint torque"),
        (down(), replace(load_robot("panda"), control=load_robot("ur5e").control), "is no Universal Robot"),
        (down(), replace(load_robot("ur5e"), limits=Limits(energy_j=1.0)), "limits.energy_j: cannot be kept"),
        (changed(down(), frame={**down()["frame"], "frames": {}}), "ur5e", "no point 'tip'"),
        (document(translation={"stiffness": (1e5 * np.eye(3)).tolist()}), "ur5e", "commands 1e.05 N/m"),
    ],
)
def test_what_a_program_cannot_do_is_refused(made, robot, said):
    with pytest.raises(InputError, match=said) as refusal:
        program(made, load_robot(robot) if isinstance(robot, str) else robot, [])
    assert "\n" not in str(refusal.value)


def test_a_folder_s_name_is_no_part_of_the_language_and_no_number_is_infinite():
    text = program(down(), replace(load_robot("ur5e"), name='my "arm"\nhalt()'), [])
    assert "def skillframe_my__arm__halt__():" in text
    assert all(line.startswith("#") for line in text.splitlines() if "halt()" in line)
    with pytest.raises(InputError, match="needs finite numbers"):
        program(document(stall_s=np.inf), load_robot("ur5e"), [])


def test_the_command_writes_a_program_and_says_what_it_loses(tmp_path, capsys):
    path, out = tmp_path / "down.skill.json", tmp_path / "down.script"
    path.write_text(json.dumps(down()))
    assert run(["export", str(path), "--to", "urscript", "--robot", "ur5e", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "no simulated robot beside it" in said and "it records no trace" in said
    text = out.read_text()
    assert text.index("safety controller is the only safety function") < text.index("def skillframe_ur5e():")
    for words, sentence in (
        (["--robot", "ur5e", "--phase", "1"], "--phase: is not used by urscript"),
        ([], "--robot: is missing: urscript is a program for one robot"),
        (["--robot", "ur5e_torque"], "takes a joint torque"),
    ):
        assert run(["export", str(path), "--to", "urscript", *words, "--out", str(tmp_path / "no")]) == 2
        assert sentence in capsys.readouterr().err and not (tmp_path / "no").exists()


@pytest.mark.slow
def test_a_program_sent_to_the_script_port_runs_and_one_with_an_unknown_word_does_not():
    fake = start_fake("ur")
    text = text_of(down(time_limit_s=0.05))
    for each, said in (
        (text.replace("stopj(", "stopl("), r"the program is refused, line \d+: the function 'stopl' is not known"),
        ("stopj(2.0)\n", "a text of 11 bytes has no end of a program"),
        (text, "a program of .* bytes starts"),
    ):
        with socket.create_connection((host(), 30002)) as port:
            port.sendall(each.encode())
        line = fake.stdout.readline()
        assert re.search(said, line), line
    printed, _ = fake.communicate(timeout=60)
    assert "failure: still under way after the skill's time limit of 0.05 s" in printed, line + printed


def test_axes_of_the_tool_are_those_at_the_start():
    """A skill in the tool's axes, and the same written in base axes for that start, send the same joints."""
    turn = rotation_matrix(np.pi * unit(np.array([1.0, 0.0, 0.0])))
    made = document(9, "phase_start")
    given = series(3, 40)
    given[:, :6] = MODEL.home
    base = copy.deepcopy(made)
    base["frame"]["axes"] = "base"
    for each in ("translation", "rotation"):
        values = base["phases"][0][each]
        values["desired_direction"] = (turn @ values["desired_direction"]).tolist()
        values["stiffness"] = (turn @ np.array(values["stiffness"]) @ turn.T).tolist()
    ours, theirs = by_program(text_of(made), given), by_program(text_of(base), given)
    # home points down to 1e-6 rad, as it is written
    assert np.abs(ours.sent - theirs.sent).max() < 1e-7 < np.ptp(ours.sent)
