import json
import os
import socket
import subprocess
import sys

import pytest
from campaign_fakes import dark, run, start
from hypothesis import given
from hypothesis import strategies as st
from skillframe_reports.results import read_results

from skillframe.campaign.folder import FolderLock, holder
from skillframe.campaign.rows import MEASURES, decode, differences, encode
from skillframe.campaign.store import RowLog, read_content, repair_tail
from skillframe.errors import InputError


@pytest.fixture
def out(campaign, tmp_path):
    return start(campaign(trials=6), tmp_path / "out")


@given(value=st.floats())
def test_every_measure_comes_back_from_its_line_to_the_last_bit(value):
    row = {"trial": 0, "peak_force_n": value}
    text = json.dumps({key: encode(v) for key, v in row.items()}, allow_nan=False)
    assert differences(row, decode(json.loads(text))) == {}


def test_rows_differ_by_a_bit_by_a_sign_and_not_by_nan():
    assert differences({"a": float("nan")}, {"a": float("nan")}) == {}
    assert differences({"a": 0.0}, {"a": -0.0}) == {"a": (0.0, -0.0)}
    assert list(differences({"a": 1.0, "b": "x"}, {"a": 1.0 + 2**-52, "b": "y"})) == ["a", "b"]


def test_results_have_the_contracts_columns_in_order(out):
    run(out)
    lines = (out / "results.csv").read_text().splitlines()
    assert lines[0] == (
        "trial,skill,seed,start.tilt_y,start.offset_x,world.friction,"
        "success,failure,duration_s,peak_force_n,final_error_m,final_error_rad,"
        "peak_force_filtered_n,peak_torque_share,peak_speed_share,ended_by,peak_force_10ms_n,"
        "peak_range_share,peak_torque_joint,peak_speed_joint,peak_range_joint,goal_reached,ended_itself,distance_to_collision_m"
    )
    keys = [tuple(line.split(",")[:2]) for line in lines[1:]]
    assert keys == [(str(t), label) for t in range(6) for label in ("a.skill.json", "replay:demo.npz")]
    assert {line.split(",")[6] for line in lines[1:]} <= {"0", "1"}


def test_rows_of_version_0_1_make_a_table_whose_later_cells_are_empty(out):
    """The rows of these fakes hold what rows of 0.1 held."""
    run(out)
    lines = (out / "results.csv").read_text().splitlines()
    assert {tuple(line.split(",")[-11:]) for line in lines[1:]} == {("",) * 11}
    assert not read_results(out / "results.csv").notes


def test_a_column_that_came_after_a_row_was_stored_is_no_difference():
    stored = {"trial": 0, "duration_s": 1.0}
    assert differences(stored, {**stored, "goal_reached": True}) == {}
    assert differences({**stored, "goal_reached": True}, stored) == {"goal_reached": (True, None)}


def test_a_torn_line_cut_at_every_byte_is_taken_off_and_no_more(out):
    run(out, chunk=3, traces=0)
    path = out / "rows.jsonl"
    content = path.read_bytes()
    lines = content.splitlines(keepends=True)
    row = max(i for i, line in enumerate(lines) if b'"trial"' in line)
    ends = [sum(map(len, lines[:i])) for i in range(len(lines) + 1)]
    # at every byte of a row, and of every other line around its end
    cuts = {*range(ends[row], ends[row + 1]), *(end + off for end in ends for off in (-2, -1, 0, 1))}
    for cut in sorted(cuts & {*range(len(content) + 1)}):
        path.write_bytes(content[:cut])
        done = read_content(out).done
        repair_tail(path)
        assert path.read_bytes() == content[: content[:cut].rfind(b"\n") + 1]
        assert len(done) == path.read_bytes().count(b'"trial"')
        assert read_content(out).done.keys() == done.keys()


@pytest.mark.slow
def test_a_resume_after_a_torn_line_ends_in_the_identical_table(out):
    run(out, chunk=3, traces=0)
    reference, content = (out / "results.csv").read_bytes(), (out / "rows.jsonl").read_bytes()
    for cut in [1, content.index(b"\n"), content.index(b"\n") + 1, *range(50, len(content), 97), len(content) - 1]:
        (out / "rows.jsonl").write_bytes(content[:cut])
        (out / "results.csv").unlink()
        run(out, traces=0)
        assert (out / "results.csv").read_bytes() == reference


def test_a_file_without_any_whole_line_is_emptied(tmp_path):
    (tmp_path / "rows.jsonl").write_bytes(b'{"format": "skillf')
    repair_tail(tmp_path / "rows.jsonl")
    assert (tmp_path / "rows.jsonl").read_bytes() == b""


def test_a_line_damaged_in_the_middle_is_named(out):
    run(out)
    lines = (out / "rows.jsonl").read_bytes().splitlines(keepends=True)
    lines[3] = b"\xff" + lines[3][5:]
    (out / "rows.jsonl").write_bytes(b"".join(lines))
    with pytest.raises(InputError, match="line 4: is damaged"):
        run(out)


@pytest.mark.parametrize("file", ["skills/a.skill.json", "robots/box/robot.toml", "campaign.toml"])
def test_rows_of_another_campaign_are_refused(out, file):
    run(out)
    path = out / file
    path.write_text(path.read_text().replace("seed = 7", "seed = 8") + "\n# edited\n")
    with pytest.raises(InputError, match="its rows are of campaign"):
        run(out)


def test_rows_of_a_newer_version_and_foreign_files_are_refused(out):
    (out / "rows.jsonl").write_text('{"format": "skillframe.campaign", "version": 99}\n')
    with pytest.raises(InputError, match="newer than 3"):
        read_content(out)
    (out / "rows.jsonl").write_text('{"trial": 0}\n')
    with pytest.raises(InputError, match="not the head"):
        read_content(out)


def test_a_trial_keeps_its_first_row(tmp_path):
    first = {"trial": 0, "skill": "a", "seed": 1, "success": True, "failure": "", **dict.fromkeys(MEASURES, 1.0)}
    with RowLog(tmp_path, "hash") as log:
        assert log.append([first]) != []
        assert log.append([{**first, "success": False}]) == []
    assert read_content(tmp_path, "hash").done == {(0, "a"): first}


def test_measures_that_are_not_numbers_survive_a_resume(out):
    run(out, dark, traces=0)
    before = (out / "results.csv").read_bytes()
    assert b",nan,inf," in before
    run(out, dark, traces=0)
    assert (out / "results.csv").read_bytes() == before


def test_a_second_writer_is_refused_while_the_first_lives(out):
    with FolderLock(out):
        assert holder(out) == (os.getpid(), socket.gethostname())
        with pytest.raises(InputError, match=f"process {os.getpid()} on {socket.gethostname()} is writing"):
            run(out)
    assert holder(out) is None
    assert run(out)["complete"]


def test_the_lock_of_a_dead_process_on_this_host_is_taken_over(out):
    child = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], check=True, capture_output=True, text=True
    )
    (out / "lock").write_text(json.dumps({"pid": int(child.stdout), "host": socket.gethostname()}))
    assert run(out)["complete"]
    assert not (out / "lock").exists()


@pytest.mark.parametrize("content", ["", "{", '{"pid": "x"}', "[]"])
def test_a_damaged_lock_that_nobody_holds_is_taken_over(out, content):
    (out / "lock").write_text(content)
    assert run(out)["complete"]


def test_a_lock_from_another_host_is_refused_with_what_to_do(out):
    (out / "lock").write_text(json.dumps({"pid": 1, "host": "elsewhere"}))
    with pytest.raises(InputError, match=r"on elsewhere may be writing.*delete"):
        run(out)


def test_the_lock_ends_with_a_killed_process(out):
    code = (
        "import sys, os, signal, pathlib; from skillframe.campaign.folder import FolderLock\n"
        f"FolderLock(pathlib.Path({str(out)!r})).__enter__(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    assert (out / "lock").exists()
    assert run(out)["complete"]
