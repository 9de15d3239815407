"""Real trials: what is refused, what a torn table holds, and that no claim mixes them with simulated ones."""

import csv
import io
import os
import signal
import subprocess
import sys
import time

import pytest
from skillframe_certify.real_trials import Real, open_real
from skillframe_certify.trials import read_trials
from skillframe_reports.page import write_report
from skillframe_reports.results import read_results

from skillframe.campaign.statistics import confidence_sequence
from skillframe.cli.main import run
from skillframe.errors import InputError


def enter(folder, *words):
    return run(["trials", "enter", str(folder), *words])


def two_skills(folder):
    for skill, outcomes in {"peg": "101", "push": "100"}.items():
        for i, won in enumerate(outcomes):
            words = ["--success"] if won == "1" else ["--failure", "--why", "jammed"]
            assert enter(folder, "--skill", skill, *words, "--samples", f"off={i + 0.5}") == 0


def test_trials_that_are_typed_stand_in_their_order_as_ones_and_zeros_marked_as_real(tmp_path):
    two_skills(tmp_path / "bench")
    rows = list(csv.DictReader((tmp_path / "bench" / "results.csv").read_text().splitlines()))
    assert [r["trial"] + r["skill"] for r in rows] == ["0peg", "1peg", "2peg", "0push", "1push", "2push"]
    assert [r["success"] for r in rows] == list("101100")
    assert [float(r["off"]) for r in rows] == [0.5, 1.5, 2.5] * 2
    assert {r["source"] for r in rows} == {"real"} and rows[1]["failure"] == "jammed"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--success", "--trial", "4", "--samples", "off=1"], "trial 3 comes next"),
        (["--success", "--trial", "1", "--samples", "off=1"], "is there already"),
        (["--success", "--samples", "on=1"], "gives the samples on"),
        (["--success"], "gives the samples none"),
        (["--success", "--samples", "off=nan"], "give a finite number"),
        (["--success", "--why", "jammed", "--samples", "off=1"], "give one of the two"),
        (["--success", "--samples", "off=1", "--samples", "off=2"], "no new NAME=VALUE"),
    ],
)
def test_what_cannot_come_next_is_refused_and_leaves_the_table_as_it_was(tmp_path, capsys, words, said):
    two_skills(tmp_path)
    before = (tmp_path / "results.csv").read_bytes()
    assert enter(tmp_path, "--skill", "peg", *words) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "results.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,a,1\n2,a,1\n", "row 3 is trial 2 of a, but trial 1 comes next"),
        ("0,a,1\n0,a,0\n", "row 3 is trial 0 of a, which is there already"),
        ("0,a,1\n1,a,maybe\n", "success is 'maybe'"),
        ("0,a,1\nx,a,1\n", "trial is 'x'"),
        ("5,a,1\n", "trial 0 comes next"),
    ],
)
def test_a_csv_with_gaps_or_repeated_trials_enters_nothing(tmp_path, capsys, rows, said):
    (tmp_path / "given.csv").write_text("trial,policy,success\n" + rows)
    assert enter(tmp_path / "bench", "--from", str(tmp_path / "given.csv")) == 2
    assert said in capsys.readouterr().err.replace(": is", " is")
    assert not (tmp_path / "bench" / "results.csv").exists()


def test_a_csv_is_entered_after_what_is_there_and_numbers_may_begin_at_one(tmp_path):
    (tmp_path / "given.csv").write_text("policy;trial;success;off\na;1;true;2.5\nb;1;0;2.5\n")
    assert enter(tmp_path, "--from", str(tmp_path / "given.csv")) == 0
    assert enter(tmp_path, "--skill", "b", "--success", "--samples", "off=3") == 0
    assert [(r.skill, r.trial, r.success) for r in open_real(tmp_path).rows] == [
        ("a", 1, True), ("b", 1, False), ("b", 2, True)
    ]  # fmt: skip


def test_real_and_simulated_rows_are_never_read_as_one_table(tmp_path):
    path = tmp_path / "results.csv"
    for other in ("simulated", ""):
        path.write_text(f"trial,skill,success,source\n0,a,1,real\n0,b,1,{other}\n")
        for read in (read_trials, read_results, open_real):
            with pytest.raises(InputError, match=r"mixes real and simulated|no table of real"):
                read(path)
    path.write_text("trial,skill,success,source\n0,a,1,lab\n0,b,1,\n")  # somebody's own column
    assert not read_trials(path).real


def test_a_real_table_and_a_simulated_one_joined_under_each_other_are_refused_by_compare(tmp_path, capsys):
    two_skills(tmp_path / "bench")
    real = (tmp_path / "bench" / "results.csv").read_text()
    head = real.splitlines()[0].split(",")
    for source in ("", "simulated"):
        row = {"trial": "3", "skill": "peg", "success": "1", "off": "3.5", "source": source}
        path = tmp_path / "joined.csv"
        path.write_text(real + ",".join(row.get(name, "") for name in head) + "\n")
        assert run(["compare", str(path)]) == 2
        said = capsys.readouterr().err
        assert "mixes real and simulated trials" in said and "keep them in two tables" in said


def test_real_trials_are_compared_as_any_table_and_the_answer_says_that_they_are_real(tmp_path, capsys):
    two_skills(tmp_path)
    assert run(["compare", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("real trials\n") and "peg against push: 3 pairs" in said


def test_no_campaign_takes_real_trials_and_no_claim_is_written_over_trials_that_are_there(tmp_path, capsys):
    two_skills(tmp_path / "bench")
    assert run(["certify", "run", str(tmp_path / "bench")]) == 2
    assert "a claim has to be written before the trials" in capsys.readouterr().err
    for question in ("map", "find-failure", "sensitivity"):
        assert run(["certify", question, str(tmp_path / "bench")]) == 2
        assert "holds real trials, whose place skillframe cannot choose" in capsys.readouterr().err
    (tmp_path / "campaign.toml").write_text("")
    assert enter(tmp_path, "--skill", "a", "--success") == 2
    assert "whose trials are simulated" in capsys.readouterr().err


@pytest.mark.needs_plugins
def test_a_page_of_real_trials_says_so_and_offers_no_replay(tmp_path):
    two_skills(tmp_path)
    write_report([tmp_path], tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "2 of 3 real trials succeeded" in page and "What these trials do not show" in page
    assert "campaign replay" not in page and "every row is a simulation" not in page
    interval, expected = read_results(tmp_path / "results.csv").rate("peg").interval, confidence_sequence(2, 3)
    assert interval == expected  # a table that grows is looked at after every trial


def test_a_table_torn_at_any_byte_is_read_and_goes_on_as_if_the_torn_trial_had_not_been_entered(tmp_path):
    whole = tmp_path / "whole"
    two_skills(whole)
    content = (whole / "results.csv").read_bytes()
    torn = tmp_path / "torn" / "results.csv"
    torn.parent.mkdir()
    for length in range(1, len(content) + 1):
        torn.write_bytes(content[:length])
        kept = open_real(torn)
        kept_lines = content[:length].splitlines()[1:]
        if not content[:length].endswith((b"\n", b",real")):
            kept_lines = kept_lines[:-1]  # cut short
        assert len(kept.rows) == len(kept_lines), content[:length]
        kept.add([Real("new", True, "", {"off": 0.0})], ["here"])
        assert torn.read_bytes().splitlines()[1:-1] == kept_lines
        assert torn.read_bytes().endswith(b"\n%d,new,1,,0.0,real\n" % kept.first)


def test_two_that_enter_at_once_never_write_the_same_trial_twice(tmp_path):
    two_skills(tmp_path)
    here, there = open_real(tmp_path), open_real(tmp_path)
    here.add([Real("peg", True, "", {"off": 1.0})], ["here"])
    with pytest.raises(InputError, match="somebody else"):
        there.add([Real("peg", False, "", {"off": 1.0})], ["there"])


ENTER_FOR_EVER = """
import sys
from pathlib import Path
from skillframe_certify.real_trials import Real, open_real
table = open_real(Path(sys.argv[1]))
while True:
    table.add([Real("a", True, "", {"off": 0.25})], ["here"])
"""


@pytest.mark.slow
def test_kill_9_while_entering_leaves_a_table_that_reads_and_goes_on(tmp_path):
    for moment in (0.02, 0.07, 0.15):  # seconds after the first row; any will do
        process = subprocess.Popen([sys.executable, "-c", ENTER_FOR_EVER, str(tmp_path)])
        path = tmp_path / "results.csv"
        begun, before = time.monotonic(), len(open_real(tmp_path).rows)
        while (
            not path.exists() or len(path.read_bytes().splitlines()) <= before + 1
        ) and time.monotonic() < begun + 60:
            time.sleep(0.01)
        time.sleep(moment)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        rows = open_real(tmp_path).rows
        assert [row.trial for row in rows] == list(range(len(rows))) and len(rows) > before


class Terminal(io.StringIO):
    """Somebody who types."""

    def isatty(self):
        return True


def test_a_terminal_asks_for_trial_after_trial_and_for_one_again_that_cannot_be_taken(tmp_path, capsys, monkeypatch):
    two_skills(tmp_path)
    typed = ["n", "jammed", "3.5", "perhaps", "y", "four", "y", "4.5", ""]  # one trial, then a slip, then another
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(typed) + "\n"))
    assert enter(tmp_path, "--skill", "peg") == 0
    assert [(r.trial, r.success, r.failure, r.draws["off"]) for r in open_real(tmp_path).rows[-2:]] == [
        (3, False, "jammed", 3.5),
        (4, True, "", 4.5),
    ]
    assert "type this trial again" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))  # no terminal: nobody is asked
    assert enter(tmp_path, "--skill", "peg") == 2
    assert "give --success or --failure" in capsys.readouterr().err
