"""The real client, pylibfranka, against the fake controller."""

import re

import pytest
from rehearsal import cell, rehearse
from skillframe_franka.fake import COMMAND, STATE

import skillframe
from skillframe.execution.trace import Trace


def test_states_and_commands_have_the_maker_s_size():
    """Of libfranka's protocol 10; the real client reads and writes these bytes in the tests below."""
    assert (STATE.itemsize, COMMAND.itemsize) == (1377, 371)


@pytest.mark.slow
def test_a_check_through_the_real_client_finds_the_robot_at_its_start(tmp_path):
    ended = rehearse("franka", ["check", str(cell(tmp_path, "fr3", "franka"))])
    assert ended.code == 0 and ended.said.count("ok ") == 4 and "1000 states a second" in ended.said
    assert "0 commands" in ended.fake


def test_no_robot_is_one_sentence(tmp_path, capsys):
    from skillframe.cli.main import run

    assert run(["drive", "check", str(cell(tmp_path, "fr3", "franka"))]) == 2
    said = capsys.readouterr().err
    assert "there is no Franka robot at 127." in said and said.count("error") == 1


@pytest.mark.slow
def test_the_valley_through_the_real_client_is_the_simulated_one(tmp_path, valley_skill):
    out = tmp_path / "run.npz"
    words = ["run", str(valley_skill), "--press", "--cell", str(cell(tmp_path, "fr3", "franka")), "--out", str(out)]
    ended = rehearse("franka", words, "--fault", "press=20")
    assert ended.code == 0 and "the task is done" in ended.fake, ended
    assert "ok  the wrench, pressed by hand" in ended.said
    durations = [skillframe.run(valley_skill, "valley", "fr3", seed=seed).duration_s for seed in range(6)]
    duration = Trace.load(out).meta["duration_s"]
    assert 0.9 * min(durations) < duration < 1.1 * max(durations)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "cause", "stopped"),
    [
        ("protective_stop=0.4", "aborted by reflex", "reflex: planted"),
        ("cut=0.4", "Timeout|connection", ""),
        ("stall=0.4", "no state from the robot for 100 ms", ""),
    ],
)
def test_a_fault_is_named_and_the_process_ends(tmp_path, valley_skill, fault, cause, stopped):
    words = ["run", str(valley_skill), "--cell", str(cell(tmp_path, "fr3", "franka"))]
    ended = rehearse("franka", words, "--fault", fault)
    assert ended.code == 1 and re.search(f"failure: .*({cause})", ended.said), ended
    assert re.search(stopped, ended.fake), ended
    assert ended.late_s < 30.0


@pytest.mark.slow
def test_a_runner_that_is_killed_leaves_a_robot_that_stops(tmp_path, valley_skill):
    words = ["run", str(valley_skill), "--cell", str(cell(tmp_path, "fr3", "franka"))]
    ended = rehearse("franka", words, kill=True)
    assert ended.code == -9 and "the connection is lost, and the motion ends" in ended.fake, ended


@pytest.mark.slow
def test_a_turned_sign_is_named_before_the_robot_moves(tmp_path, valley_skill):
    words = ["run", str(valley_skill), "--press", "--cell", str(cell(tmp_path, "fr3", "franka"))]
    ended = rehearse("franka", words, "--fault", "press=20", "--fault", "sign=-1")
    assert ended.code == 2 and "the wrench, pressed by hand: its sign is wrong" in ended.said, ended
    assert "0 commands" in ended.fake
