"""Rows come from a plug-in made on disk, so that each is computed in a process of its own, as in earnest."""

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import pytest
from skillframe_papers import committed, document, page, store
from skillframe_papers.command import _end, _show
from skillframe_papers.jobs import jobs_of
from skillframe_papers.published import row_types
from skillframe_papers.runner import Outcome

from skillframe.cli.main import run
from skillframe.cli.output import PAGE_WIDTH
from skillframe.extend import Illustration, RowResult, RowType
from skillframe.extend.registry import Plugin, Registry, registry

PLUGIN = """
    import os, pathlib, time
    from skillframe import hookimpl
    from skillframe.errors import InputError
    from skillframe.extend import RowResult, RowType

    def double(job):
        print("noise on stdout")
        value = 2.0 * job.settings["gain"] * job.count(10, 1)
        with open(os.environ["COUNTED"], "a") as file:
            file.write("x")
        return RowResult(ours=f"{value:g}", verdict="pass" if value == 20.0 else "fail", values={"value": value})

    def crash(job):
        raise ZeroDivisionError("as told")

    def refuse(job):
        raise InputError("--set gain", "is odd", "make it even")

    def slow(job):
        pathlib.Path(os.environ["COUNTED"] + ".process").write_text(str(os.getpid()))
        time.sleep(60.0)

    def die(job):
        os.kill(os.getpid(), 9)

    def leave(job):
        raise SystemExit(4)

    @hookimpl
    def skillframe_rows():
        functions = {"901": double, "902": crash, "903": refuse, "904": slow, "905": leave, "906": double, "907": die,
                     "908": double}
        for name, function in functions.items():
            yield RowType(name=name, summary=function.__name__, published="20", source="nobody", bar="20",
                          settings={"gain": 1.0}, run=function, group="fatal" if name > "905" else "")
"""


@pytest.fixture
def rows(tmp_path, monkeypatch, fresh_registry):
    """The plug-in's folder on the path, and the file that counts how often row 901 was computed."""
    place = tmp_path / "site"
    info = place / "toy-1.0.dist-info"
    info.mkdir(parents=True)
    (place / "toy_rows.py").write_text(textwrap.dedent(PLUGIN))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[skillframe]\ntoy = toy_rows\n")
    counted = tmp_path / "counted"
    counted.write_text("")
    monkeypatch.syspath_prepend(place)
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "toy,papers")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("COUNTED", str(counted))
    yield counted
    sys.modules.pop("toy_rows", None)


def reproduce(*words):
    return subprocess.run(
        [sys.executable, "-m", "skillframe.cli.main", "reproduce", *map(str, words)], capture_output=True, text=True
    )


@pytest.mark.parametrize(
    "change", [{"head": None}, {"values": {"a": "0.1"}}, {"wall_s": [1]}, {"ours": "0.2"}, {"cpu_s": float("inf")}]
)
def test_a_kept_row_that_somebody_changed_is_computed_again(tmp_path, change):
    job = jobs_of(registry(), ["1"], {}, seed=0, quick=True)[0]
    result = RowResult(ours="0.1", values={"a": 0.1}, head=("a", "b"), rows=(("1", "2"),))
    store.keep(tmp_path, store.entry(registry().row("1"), job, result, 1.0, 1.0))
    found = store.kept(tmp_path, job)
    assert found["ours"] == "0.1" and "sum" not in found
    path = store.path_of(tmp_path, "1")
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **change}), encoding="utf-8")
    assert store.kept(tmp_path, job) is None


@pytest.mark.slow
def test_a_row_is_computed_shown_and_kept_and_computed_once(rows, tmp_path, capsys):
    out = tmp_path / "out"
    done = reproduce("901", "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)  # what the row printed went elsewhere
    assert row == json.loads((out / "reproduce.json").read_text())[0]
    assert (row["row"], row["published"], row["ours"], row["verdict"], row["seed"]) == ("901", "20", "20", "pass", 0)
    assert row["command"].startswith("skillframe reproduce 901") and row["wall_s"] >= 0.0 and row["cpu_s"] >= 0.0
    assert "reproduce 901" in (out / "reproduce.md").read_text()
    assert run(["reproduce", "901", "--out", str(out)]) == 0
    assert "there already" in capsys.readouterr().err and rows.read_text() == "x"
    assert run(["reproduce", "901", "--out", str(out), "--fresh"]) == 0 and rows.read_text() == "xx"


@pytest.mark.slow
def test_a_setting_changes_its_row_and_is_part_of_the_command(rows, tmp_path):
    done = reproduce("901", "--out", tmp_path, "--set", "gain=3", "--json")
    (row,) = json.loads(done.stdout)
    assert (row["ours"], row["verdict"], row["settings"]) == ("60", "fail", {"gain": 3.0})
    assert "--set gain=3" in row["command"]
    assert json.loads(reproduce("901", "--out", tmp_path, "--quick", "--json").stdout)[0]["ours"] == "2"


@pytest.mark.slow
def test_rows_that_fail_cost_themselves_only(rows, tmp_path):
    broken = reproduce("901", "902", "--out", tmp_path)
    assert broken.returncode == 3 and "ZeroDivisionError" in broken.stderr and "Traceback" not in broken.stderr
    assert [row["row"] for row in json.loads((tmp_path / "reproduce.json").read_text())] == ["901"]
    refused = reproduce("903", "--out", tmp_path)
    assert refused.returncode == 2 and "make it even" in refused.stderr


@pytest.mark.slow
def test_a_process_that_dies_costs_the_rows_of_its_group_that_were_not_done(rows, tmp_path):
    died = reproduce("901", "906", "907", "908", "--out", tmp_path, "--json")
    assert died.returncode == 3 and "Traceback" not in died.stderr
    assert [row["row"] for row in json.loads(died.stdout)] == ["901", "906"]
    assert "row 907: its process was killed" in died.stderr and "row 908: its process was killed" in died.stderr
    assert died.stderr.count("row 906: pass after") == 1 and "row 906: its" not in died.stderr
    left = reproduce("905", "--out", tmp_path)
    assert left.returncode == 3 and "row 905: SystemExit" in left.stderr


def runs(process):
    """Whether a process is there and has not ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def until(condition):
    """Waits up to half a minute: this machine may be busy."""
    for _ in range(600):
        if condition():
            return True
        time.sleep(0.05)
    return False


def started(rows, out):
    """A run that has done row 901 and is at 904, which takes a minute, and the process that computes it."""
    words = [sys.executable, "-m", "skillframe.cli.main", "reproduce", "901", "904", "--out", str(out)]
    process = subprocess.Popen([*words, "--workers", "2"], stderr=subprocess.PIPE, text=True, start_new_session=True)
    told = rows.with_name("counted.process")
    assert until(lambda: (out / "rows" / "901.json").exists() and told.exists() and told.read_text())
    assert process.poll() is None
    return process, int(told.read_text())


@pytest.mark.slow
@pytest.mark.parametrize(("number", "all_of_the_group", "code"), [("SIGINT", True, 130), ("SIGTERM", False, 143)])
def test_a_signal_keeps_what_is_done_and_leaves_no_process_behind(rows, tmp_path, number, all_of_the_group, code):
    process, worker = started(rows, tmp_path)
    if all_of_the_group:
        os.killpg(process.pid, signal.Signals[number])  # as a terminal does
    else:
        process.send_signal(signal.Signals[number])
    _, said = process.communicate(timeout=30)
    assert process.returncode == code and not runs(worker)
    assert f"ended by {number}; finished rows are kept in {tmp_path} (901)" in said and "Traceback" not in said
    assert [row["row"] for row in json.loads((tmp_path / "reproduce.json").read_text())] == ["901"]
    assert "there already" in reproduce("901", "--out", tmp_path).stderr and rows.read_text() == "x"


@pytest.mark.slow
def test_a_run_that_is_killed_leaves_no_process_behind(rows, tmp_path):
    process, worker = started(rows, tmp_path)
    process.kill()
    process.communicate(timeout=30)
    assert until(lambda: not runs(worker))


def test_what_is_unknown_is_refused_in_a_sentence(rows, tmp_path, capsys):
    assert run(["reproduce", "x", "--out", str(tmp_path)]) == 2
    assert "unknown row" in capsys.readouterr().err
    assert run(["reproduce", "21", "--set", "cylinder.bor=1", "--out", str(tmp_path)]) == 2
    assert "did you mean 'cylinder.bore'" in capsys.readouterr().err
    assert run(["reproduce", "21", "--set", "cylinder.bore=wide", "--out", str(tmp_path)]) == 2
    capsys.readouterr()
    assert run(["reproduce", "1", "--out", str(tmp_path / "out"), "--seed", "1" * 41]) == 2
    assert "too large a whole number" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_the_listing_says_what_can_be_set(capsys):
    assert run(["reproduce", "21", "--list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["row"] == "21" and row["settings"]["cylinder.bore"] == 0.08


def toy(name="1", group="", **settings):
    return RowType(
        name=name, summary="a <claim> | of", published="1", source="s", bar="b", settings=settings, group=group,
        run=lambda job: RowResult(ours="1"),
    )  # fmt: skip


def made(*rows):
    registry = Registry()

    class Module:
        pass

    from skillframe import hookimpl

    module = Module()
    module.skillframe_rows = hookimpl(lambda: rows)
    module.skillframe_rows.__name__ = "skillframe_rows"
    registry.add(Plugin(name="toy", distribution="toy", version="1"), lambda: module)
    return registry


def test_rows_come_by_number_and_a_setting_reaches_every_row_that_has_it():
    registry = made(toy("10", a=1.0), toy("9", a=2, b=True), toy("coulomb"))
    jobs = jobs_of(registry, [], {"a": 5}, seed=3, quick=False)
    assert [job.row for job in jobs] == ["9", "10", "coulomb"]
    assert [dict(job.settings) for job in jobs] == [{"a": 5, "b": True}, {"a": 5.0}, {}]
    assert len({job.key for job in jobs}) == 3
    assert jobs[0].key != jobs_of(registry, ["9"], {"a": 5}, seed=4, quick=False)[0].key


def entries():
    picture = Illustration("a picture", "its caption", "<svg><script>alert(1)</script></svg>")
    result = RowResult(ours="1 <b>", head=("x",), rows=[("y | z",)], pictures=[picture], difference="why")
    registry = made(toy())
    (job,) = jobs_of(registry, [], {}, seed=0, quick=True)
    return [store.entry(registry.row("1"), job, result, 1.0, 0.5)]


def test_the_page_reaches_for_nothing_and_nothing_in_it_acts():
    text = page.render(entries())
    assert "default-src &#x27;none&#x27;" in text and "http://" not in text and "https://" not in text
    assert "<script" not in text and "&lt;claim&gt;" in text and "data:image/svg+xml;base64" in text
    assert text == page.render(entries())


def test_the_page_lists_its_rows_by_topic_and_an_older_row_without_one():
    first, second = ({**entries()[0], "row": row, "topic": topic} for row, topic in (("1", "crane"), ("2", "search")))
    third = {**{k: v for k, v in first.items() if k != "topic"}, "row": "3"}
    links = page.render([first, second, third, {**first, "row": "4"}]).partition("<main>")[0]
    shown = re.sub(r"<[^>]+>", " ", links.partition("<nav>")[2]).split()
    assert shown == ["skillframe", "crane", "1", "4", "search", "2", "row", "3"]


def test_the_docs_page_keeps_its_tables_whole():
    text = document.render(entries())
    assert "a \\<claim> \\| of" in text and "| y \\| z |" in text
    assert "- chosen together: method and worlds were developed side by side" in text and "- difference: why" in text


def test_what_the_command_says_in_a_pipe_fits_a_page(capsys):
    keys = ("row", "summary", "published", "ours", "verdict", "values_are", "wall_s")
    _show([dict.fromkeys(keys, "published figures of which there is much to say " * 4)], as_json=False)
    assert run(["reproduce", "--list"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= PAGE_WIDTH


def test_only_a_verdict_that_differs_from_the_docs_is_a_change():
    found = [{"row": "1", "verdict": "pass"}, {"row": "2", "verdict": "fail"}, {"row": "3", "verdict": "fail"}]
    assert len(committed.changes(found, {"1": "pass", "2": "pass"})) == 1


@pytest.mark.needs_plugins
def test_a_verdict_is_committed_for_every_row_and_a_changed_one_is_exit_code_1(capsys, tmp_path):
    for quick in (False, True):
        assert set(committed.verdicts(quick=quick)) == {row.name for row in row_types()}
    (entry,) = entries()
    said = committed.verdicts(quick=True)
    same, changed = (
        _end(Outcome([{**entry, "row": "21", "verdict": verdict}], [], [], False), tmp_path, True, True, 130)
        for verdict in (said["21"], "fail")
    )
    assert {"pass", "fail"} <= set(said.values()) <= {"pass", "fail", "reported"} and (same, changed) == (0, 1)
    assert "changed: row 21 is 'fail', the docs say 'pass'" in capsys.readouterr().err


def test_a_row_without_a_figure_is_neither_predicted_nor_calibrated():
    row = toy()
    assert store.values_are(row, RowResult(ours="not run here", computed=False)) == "not computed"
    assert store.values_are(row, RowResult(ours="1")) == "chosen together"
    assert store.values_are(replace(row, frozen=True), RowResult(ours="1")) == "predicted"
    assert store.values_are(replace(row, frozen=True, calibrated="x"), RowResult(ours="1")) == "calibrated"


def test_a_threshold_that_anything_reaches_can_be_missed_and_reaching_it_is_no_pass():
    weak = replace(toy(), weak="an average does so too")
    kept = {v: store.verdict(weak, RowResult(ours="1", verdict=v)) for v in ("pass", "fail", "reported")}
    assert kept == {"pass": "reported", "fail": "fail", "reported": "reported"}
    assert store.verdict(toy(), RowResult(ours="1", verdict="pass")) == "pass"
    shown = document.render([{**entries()[0], "weak": weak.weak}])
    assert "threshold: b. Reaching it is no pass: an average does so too; **" in shown


def test_a_share_that_is_missed_and_not_excluded_is_undecided_with_its_interval():
    from skillframe_papers.bars import judged, undecided

    assert judged(11, 12, 0.9, quick=False) == "pass" and not undecided(11, 12, 0.9, quick=False)
    assert judged(10, 12, 0.9, quick=False) == "reported"
    # Clopper and Pearson of 10 in 12: 0.5159 to 0.9791
    assert "52 to 98 %" in undecided(10, 12, 0.9, quick=False)
    # of 6 in 12: 0.2109 to 0.7891, below 0.9
    assert judged(6, 12, 0.9, quick=False) == "fail" and not undecided(6, 12, 0.9, quick=False)


COMMITTED = committed.FOLDER / "reproduce.json"


def test_the_committed_table_counts_as_passes_only_rows_that_can_fail():
    rows = {each["row"]: each for each in json.loads(COMMITTED.read_text(encoding="utf-8"))}
    assert {n for n, each in rows.items() if each["values_are"] == "predicted"} == {"1", "2", "21"}
    assert {n for n, each in rows.items() if each["weak"] and each["verdict"] == "pass"} == set(), (
        "anything reaches these"
    )
    own = ("7", "9", "10", "24", "25")
    assert {n for n in own if rows[n]["verdict"] != "fail"} == set(), "the two-arm paper's own claim"


@pytest.mark.needs_plugins
def test_each_committed_row_says_of_its_values_and_threshold_what_the_code_says(fresh_registry, capsys):
    assert run(["reproduce", "--list", "--json"]) == 0
    now = {each["row"]: each for each in json.loads(capsys.readouterr().out)}
    for each in json.loads(COMMITTED.read_text(encoding="utf-8")):
        assert {k: each[k] for k in ("bar", "calibrated", "weak")} == {
            k: now[each["row"]][k] for k in ("bar", "calibrated", "weak")
        }, f"row {each['row']} was computed with another threshold: type skillframe reproduce {each['row']}"


def test_a_quick_run_misses_a_share_only_where_its_counts_exclude_it():
    from skillframe_papers.bars import reached

    assert reached(54, 60, 0.9, quick=False) and not reached(53, 60, 0.9, quick=False)
    assert reached(9, 15, 0.75, quick=True) and not reached(6, 15, 0.75, quick=True)
    assert not reached(2, 3, 1.0, quick=True) and reached(3, 3, 1.0, quick=True)


def test_the_crane_is_taught_with_the_settings_that_the_how_to_gives():
    from skillframe_papers.rows.crane_taught import LEARN

    from skillframe.config import parse_setting

    text = (Path(__file__).parents[3] / "docs" / "how-to" / "own-crane.md").read_text(encoding="utf-8")
    command = text.partition("skillframe learn ")[2].partition("```")[0]
    assert dict(parse_setting(word) for word in command.split() if "=" in word) == LEARN
