"""The real client, ur_rtde, against the fake controller."""

import re
import shutil
from pathlib import Path

import pytest
from rehearsal import cell, host, rehearse

import skillframe
from skillframe.execution.trace import Trace
from skillframe.robot.interface import Control
from skillframe.robot.spec import load_robot


@pytest.mark.slow
def test_a_check_through_the_real_client_finds_the_robot_at_its_start(tmp_path):
    ended = rehearse("ur", ["check", str(cell(tmp_path, "ur5e", "ur"))])
    assert ended.code == 0 and ended.said.count("ok ") == 4 and "500 states a second" in ended.said
    assert "0 commands" in ended.fake


def test_no_robot_is_one_sentence(tmp_path, capsys):
    from skillframe.cli.main import run

    assert run(["drive", "check", str(cell(tmp_path, "ur5e", "ur"))]) == 2
    said = capsys.readouterr().err
    assert "there is no Universal Robot at 127." in said and said.count("error") == 1


@pytest.mark.slow
def test_the_valley_through_the_real_client_is_the_simulated_one(tmp_path, valley_skill):
    out = tmp_path / "run.npz"
    words = ["run", str(valley_skill), "--cell", str(cell(tmp_path, "ur5e", "ur")), "--out", str(out)]
    ended = rehearse("ur", words)
    assert ended.code == 0 and "the task is done" in ended.fake, ended.said + ended.fake
    durations = [skillframe.run(valley_skill, "valley", "ur5e", seed=seed).duration_s for seed in range(6)]
    trace = Trace.load(out)
    assert 0.9 * min(durations) < trace.meta["duration_s"] < 1.1 * max(durations)
    assert trace.meta["source"] == "real" and trace.meta["link"] == "ur"


@pytest.mark.slow
def test_the_cell_and_the_rehearsal_of_the_page_end_well(tmp_path, valley_skill):
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "drive.md").read_text()
    text = re.search(r"```toml\n(# cell\.toml\n.*?)```", page, re.DOTALL)[1]
    assert 'host = "192.168.0.10"' in text and 'witness = "person"' in text
    written = tmp_path / "cell.toml"
    written.write_text(text.replace("192.168.0.10", host()).replace('"person"', '"pose"'))
    truth = re.search(r"drive fake ur --world valley (.*) --lockstep", page)[1].split()
    ended = rehearse("ur", ["run", str(valley_skill), "--cell", str(written)], *truth)
    assert ended.code == 0 and "success" in ended.said and "the task is done" in ended.fake, ended


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "cause", "stopped"),
    [
        ("protective_stop=0.4", r"protective or emergency stop", r"protective stop: planted"),
        ("cut=0.4", r"no state from the robot for 100 ms", r"the watchdog ends the program after 5\d ms"),
        ("stall=0.4", r"no state from the robot for 100 ms|program has stopped", r""),
    ],
)
def test_a_fault_is_named_the_robot_stops_and_the_process_ends(tmp_path, valley_skill, fault, cause, stopped):
    words = ["run", str(valley_skill), "--cell", str(cell(tmp_path, "ur5e", "ur"))]
    ended = rehearse("ur", words, "--fault", fault)
    assert ended.code == 1 and re.search(f"failure: .*({cause})", ended.said), ended
    assert re.search(stopped, ended.fake), ended
    assert ended.late_s < 30.0  # a client library that hangs takes minutes; a quiet machine takes less than 1 s


@pytest.mark.slow
def test_a_runner_that_is_killed_leaves_a_robot_that_stops(tmp_path, valley_skill):
    words = ["run", str(valley_skill), "--cell", str(cell(tmp_path, "ur5e", "ur"))]
    ended = rehearse("ur", words, kill=True)
    assert ended.code == -9 and re.search(r"the watchdog ends the program after 5\d ms", ended.fake), ended


@pytest.mark.slow
def test_a_turned_sign_is_named_before_the_robot_moves(tmp_path, valley_skill):
    words = ["run", str(valley_skill), "--press", "--cell", str(cell(tmp_path, "ur5e", "ur"))]
    ended = rehearse("ur", words, "--fault", "press=20", "--fault", "sign=-1")
    assert ended.code == 2 and "the wrench, pressed by hand: its sign is wrong" in ended.said, ended
    assert "0 commands" in ended.fake


@pytest.mark.slow
def test_a_late_robot_with_a_wrong_payload_is_identified_through_the_real_client(tmp_path):
    """A fake with 20 ms and 6 Hz, where robot.toml gives 8 ms and 10 Hz, and 0.4 kg that it does not know."""
    slow = tmp_path / "late"
    shutil.copytree(load_robot("ur5e").folder, slow)
    text = (slow / "robot.toml").read_text()
    changed = text.replace("delay_s = 0.008", "delay_s = 0.020").replace("bandwidth_hz = 10.0", "bandwidth_hz = 6.0")
    assert changed.count("0.020") == 1 and changed.count("6.0 ") > text.count("6.0 ")
    (slow / "robot.toml").write_text(changed)
    truth = Control(rate_hz=500.0, interface="position", delay_s=0.020, bandwidth_hz=6.0).admittance.total_delay
    words = ["--robot", str(slow), "--fault", "payload=0.4", "--set", "start.offset_z=0.15"]
    words += ["--set", "sensor.force_bias_x=2", "--set", "sensor.force_bias_z=3"]
    ended = rehearse("ur", ["identify", str(cell(tmp_path, "ur5e", "ur"))], *words)
    assert ended.code == 1, ended
    late, delay, bandwidth = re.search(r"answers ([\d.]+) ms late.* of (\d+) ms .* of ([\d.]+) Hz", ended.said).groups()
    assert float(late) == pytest.approx(1e3 * truth, abs=1.0), ended.said
    assert float(delay) == pytest.approx(20.0, abs=2.1) and float(bandwidth) == pytest.approx(6.0, rel=0.1)
    assert "NO  answers" in ended.said and "certify again" in ended.said
    mass, tip = re.search(r"wrench: ([+-][\d.]+) kg: .*, (\d+)\] mm", ended.said).groups()
    assert float(mass) == pytest.approx(0.4, abs=0.02) and float(tip) == pytest.approx(200.0, abs=20.0), ended.said
    assert re.search(r"bias of the sensor \[2\.\d|1\.9", ended.said), ended.said
    assert "# robot.toml\n[control]\ndelay_s = 0.0" in ended.said
