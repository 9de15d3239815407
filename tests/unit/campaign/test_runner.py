import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from campaign_fakes import (
    FakeParams,
    always_raises,
    edit_rows,
    good,
    run,
    start,
    table,
    tells_quickly,
)

from skillframe.campaign.driver import CampaignError, chunk_size
from skillframe.campaign.partial_results import status_of
from skillframe.campaign.runner import replay_trial
from skillframe.campaign.store import read_content
from skillframe.campaign.summary import below_bar, read_summary
from skillframe.errors import InputError, UnknownName

FAKES = Path(__file__).with_name("campaign_fakes.py")


@pytest.mark.parametrize("chunk", [1, 5, 7, 64])
def test_the_table_does_not_depend_on_the_chunks(out, reference, chunk):
    run(out, chunk=chunk)
    assert table(out) == reference(48)


def test_the_table_does_not_depend_on_the_order_in_which_trials_end(out, reference):
    run(out)
    lines = (out / "rows.jsonl").read_text().splitlines(keepends=True)
    (out / "rows.jsonl").write_text("".join([lines[0], *lines[:0:-1]]))
    run(out)
    assert table(out) == reference(48)


@pytest.mark.parametrize("trial", [0, 17, 47])
def test_replaying_a_trial_alone_gives_its_row(out, trial):
    run(out)
    for skill in (None, "replay"):
        found = replay_trial(out, trial, good, skill, FakeParams)
        assert found.changed == {}
        assert found.environment == []
        assert found.trace == f"trace of {trial}".encode()


def test_a_replay_that_differs_says_in_what_and_on_which_machine(out):
    run(out)

    def change(records):
        row = next(r for r in records if r.get("trial") == 0 and r["skill"] == "a.skill.json")
        row |= {"success": not row["success"], "failure": "" if row["failure"] else "stuck"}
        for session in (r["session"] for r in records if "session" in r):
            for versions in (session, session.get("environment", {}), session.get("ran_on", {})):
                versions |= {"numpy": "0.1"} if "numpy" in versions else {}
        return records

    then = read_content(out).done[0, "a.skill.json"]["success"]
    edit_rows(out, change)
    found = replay_trial(out, 0, good, None, FakeParams)
    assert found.changed["success"] == (not then, then)
    assert [line.split(":")[0] for line in found.environment] == ["numpy"]


def test_a_replay_of_what_is_not_there_is_refused(out):
    run(out)
    with pytest.raises(InputError, match=r"trial 48 of a.skill.json has no row .it has 48 trials, 0 to 47"):
        replay_trial(out, 48, good, None, FakeParams)
    with pytest.raises(UnknownName, match="unknown skill 'b'"):
        replay_trial(out, 0, good, "b", FakeParams)


def test_a_campaign_in_which_nothing_works_is_given_up_with_the_cause(out):
    with pytest.raises(CampaignError, match=r"no trial ran.*ValueError: nothing works"):
        run(out, always_raises)
    assert run(out)["complete"]


def test_the_summary_counts_what_the_table_holds(out):
    summary = run(out)
    assert summary == read_summary(out)
    rows = [line.split(",") for line in table(out).decode().splitlines()[1:]]
    for label, figures in summary["skills"].items():
        successes = sum(int(row[6]) for row in rows if row[1] == label)
        assert (figures["trials"], figures["successes"], figures["rate"]) == (48, successes, successes / 48)
        assert figures["interval_95"][0] <= figures["rate"] <= figures["interval_95"][1]
        assert figures["method"].startswith("Clopper-Pearson")
        assert sum(figures["failures"].values()) == 48 - successes
    (pair,) = summary["comparisons"]
    assert pair["both"] + pair["only_first"] + pair["only_second"] + pair["neither"] == 48
    assert summary["workers"] == 1
    assert summary["versions"]["numpy"] == np.__version__
    assert set(summary["hashes"]) == {"campaign", "files", "results.csv"}


def test_the_summary_says_which_bodies_nobody_looked_at(campaign, tmp_path):
    assert "unwatched" not in run(start(campaign(trials=4), tmp_path / "watched"))
    for text, said in (("enabled = false", "enabled is false"), ('ignore = [["a", "b"]]', "a with b")):
        path = campaign(trials=4)
        (tmp_path / "robots" / "box" / "robot.toml").write_text(f'urdf = "box.urdf"\n[collisions]\n{text}\n')
        folder = start(path, tmp_path / said)
        run(folder)
        assert said in read_summary(folder)["unwatched"]


def test_traces_are_kept_of_the_first_trials_the_typical_success_and_the_first_failures(out):
    run(out, traces=5)
    rows = [line.split(",") for line in table(out).decode().splitlines()[1:]]
    failed = [int(row[0]) for row in rows if row[1] == "a.skill.json" and row[6] == "0" and int(row[0]) > 1]
    names = sorted(path.name for path in (out / "traces").glob("*a.skill.json.npz"))
    won = {int(row[0]): float(row[8]) for row in rows if row[1] == "a.skill.json" and row[6] == "1"}
    middle = np.median(list(won.values()))
    typical = min(won, key=lambda trial: abs(won[trial] - middle))
    assert typical > 1
    assert names == [f"{trial:05d}_a.skill.json.npz" for trial in sorted([0, 1, typical, *failed[:2]])]


def test_the_bar_is_asked_of_the_skill_it_names(campaign, tmp_path):
    out = start(campaign(trials=48, extra='[expect]\nrate = 0.7\nskill = "replay:demo.npz"'), tmp_path / "out")
    from skillframe.campaign.folder import load

    summary = run(out)
    assert "below the threshold of 0.7" in below_bar(load(out, FakeParams), summary)
    assert below_bar(load(out, FakeParams), {**summary, "complete": False}) == ""


def stopped(folder):
    return read_summary(folder)["stopped_after_trial"]


@pytest.mark.parametrize("chunk", [3, 64])
def test_an_early_stop_ends_in_the_same_table_whatever_the_chunks(campaign, tmp_path, chunk):
    path = campaign(trials=400, extra="[stop]\ninterval_width = 0.35")
    folders = [start(path, tmp_path / name) for name in ("one", "two")]
    run(folders[0], chunk=chunk)
    run(folders[1], chunk=17)
    assert table(folders[0]) == table(folders[1])
    after = stopped(folders[0])
    assert 10 < after < 200
    assert table(folders[0]).splitlines()[-1].startswith(f"{after},replay".encode())
    summary = read_summary(folders[0])
    widths = [f["interval_95"][1] - f["interval_95"][0] for f in summary["skills"].values()]
    assert max(widths) <= 0.35
    assert {f["method"] for f in summary["skills"].values()} == {
        "beta(1/2,1/2)-mixture confidence sequence (two-sided, valid at every look)"
    }


def test_an_unfinished_campaign_shows_an_interval_that_may_be_looked_at(out):
    seen = []

    def stop_half_way(progress):
        seen.append(progress)
        if progress.done >= 48:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(out, notify=stop_half_way, chunk=8)
    status = status_of(out, FakeParams)
    assert (status["rows"], status["planned_rows"], status["complete"]) == (48, 96, False)
    assert "valid at every look" in status["skills"]["a.skill.json"]["method"]
    assert len(table(out).splitlines()) == 49
    assert [p.done for p in seen] == sorted(p.done for p in seen)


def test_status_of_a_running_campaign_names_its_process(out):
    states = []
    run(out, notify=lambda progress: states.append(status_of(out, FakeParams)), chunk=8)
    assert all(state["running"]["pid"] == os.getpid() for state in states)
    assert [state["rows"] for state in states][-1] == 96
    final = status_of(out, FakeParams)
    assert final["running"] is None
    assert final["complete"]
    json.dumps(final, allow_nan=False)


@pytest.mark.parametrize(
    ("trials", "workers", "largest"), [(1, 4, 64), (100, 2, 64), (400, 2, 64), (64, 1, 64), (65, 1, 64)]
)
def test_chunks_are_even_and_not_too_large(trials, workers, largest):
    size = chunk_size(trials, workers, largest)
    assert 1 <= size <= largest
    chunks = [min(size, trials - first) for first in range(0, trials, size)]
    assert len(chunks) <= max(workers, -(-trials // largest) + workers - 1)


def client(folder, function="slow", *workers):
    return subprocess.Popen(
        [sys.executable, str(FAKES), str(folder), function, *workers], stderr=subprocess.DEVNULL, start_new_session=True
    )


def kill_at_a_random_moment(folder, rng, *workers):
    """Kill the client some time after its next row. Returns False once there is nothing left to kill."""
    path = folder / "rows.jsonl"
    size = path.stat().st_size if path.exists() else 0
    process = client(folder, "slow", *workers)
    while process.poll() is None and (path.stat().st_size if path.exists() else 0) <= size:
        time.sleep(0.005)
    time.sleep(rng.uniform(0.0, 0.4))
    ended = process.poll() is not None
    process.kill()
    process.wait()
    return not ended


@pytest.mark.parametrize("rounds", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_kills_of_the_client_at_random_moments_end_in_the_identical_table(out, reference, rounds):
    rng = np.random.default_rng()
    kills = sum(kill_at_a_random_moment(out, rng) for _ in range(rounds))
    run(out)
    assert kills >= rounds / 2
    assert table(out) == reference(48)


@pytest.mark.slow
@pytest.mark.figures
def test_twenty_kills_of_a_client_with_workers_end_in_the_identical_table(campaign, tmp_path, reference):
    out = start(campaign(trials=400), tmp_path / "out")
    rng = np.random.default_rng()
    kills = sum(kill_at_a_random_moment(out, rng, "2") for _ in range(20))
    run(out)
    assert kills >= 10
    assert table(out) == reference(400)


def test_how_far_a_chunk_is_is_told_in_process(out):
    told = []
    run(out, tells_quickly, told.append, chunk=12, traces=0)
    assert {p.under_way for p in told} == {0.0, 6.0}  # half of twelve
    assert all(p.done + p.under_way <= p.total for p in told)
