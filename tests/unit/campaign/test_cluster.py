import asyncio
import os
import select
import socket
import ssl
import subprocess
import sys
import time
import warnings
from contextlib import ExitStack, suppress
from pathlib import Path

import campaign_fakes as fakes
import distributed
import psutil
import pytest
from distributed.security import Security

from skillframe.campaign.cluster import SchedulerError

LIMITS = {"workers": 2, "chunk": 16, "time_limit_s": 3.0, "memory_bytes": 400_000_000, "traces": 0}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reference")
    out = fakes.start(fakes.write_campaign(folder), folder / "out")
    fakes.run(out, traces=0)
    return (out / "results.csv").read_bytes()


@pytest.fixture
def out(campaign, tmp_path):
    return fakes.start(campaign(), tmp_path / "out")


def workers_of_this_process():
    return [c for c in psutil.Process().children(recursive=True) if "spawn_main" in " ".join(command_of(c))]


def command_of(process):
    """Its command line, or none of one that has just been killed, which may be gone or a zombie by now."""
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:  # a zombie is one of these, too
        return []


def changed(out, reference):
    mine = (out / "results.csv").read_bytes()
    return [a for a, b in zip(mine.splitlines(), reference.splitlines(), strict=True) if a != b]


@pytest.mark.slow
def test_workers_give_the_table_of_one_process_listen_on_the_local_host_only_and_end(campaign, tmp_path):
    out, alone = (fakes.start(campaign(trials=48), tmp_path / name) for name in ("out", "alone"))
    fakes.run(alone, traces=0)
    listening = set()

    def look(progress):
        for process in [psutil.Process(), *psutil.Process().children(recursive=True)]:
            with suppress(psutil.NoSuchProcess):  # what a worker starts while it imports may be gone by now
                listening.update(c.laddr for c in process.net_connections() if c.status == psutil.CONN_LISTEN)

    with socket.socket() as someone:  # who has Dask's usual port already: no warning, which would be an error here
        with suppress(OSError):
            someone.bind(("127.0.0.1", 8787))
            someone.listen()
        summary = fakes.run(out, fakes.slow, look, **LIMITS)
    assert fakes.table(out) == fakes.table(alone)
    assert summary["workers"] == 2
    assert {address for address, _ in listening} == {"127.0.0.1"}
    assert workers_of_this_process() == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("misbehave", "cause"),
    [
        (fakes.kills, b"worker died (killed)"),
        (fakes.hoards, b"worker died (memory)"),
        (fakes.raises, b"error: ValueError: the skill tripped"),
        (fakes.hangs, b"worker died (time limit)"),
        (fakes.hangs_holding_the_lock, b"worker died (time limit)"),
    ],
)
def test_exactly_the_guilty_trial_is_named(out, reference, misbehave, cause):
    patient = {"time_limit_s": 120.0} if misbehave is fakes.hoards else {}  # on a busy machine memory grows slowly
    summary = fakes.run(out, misbehave, **{**LIMITS, **patient})
    (line,) = changed(out, reference)
    assert line.startswith(b"37,a.skill.json,")
    assert line.endswith(b",0," + cause + b",nan,nan,nan,nan,nan,nan,nan,lost,nan,nan,,,,0,0,nan")
    assert summary["complete"]


@pytest.mark.slow
def test_a_slow_trial_that_advances_is_let_go_on_far_beyond_the_time_without_progress(out, reference):
    told = []
    fakes.run(out, fakes.creeps, told.append, workers=1, chunk=64, time_limit_s=1.0, traces=0)  # it takes three seconds
    assert changed(out, reference) == []
    assert [p.note for p in told if p.note] == []


@pytest.mark.slow
def test_a_trial_that_says_the_same_again_and_again_is_hung_and_the_replacement_is_told(out, reference):
    told = []
    fakes.run(out, fakes.stalls, told.append, **{**LIMITS, "chunk": 2, "time_limit_s": 1.0})
    (line,) = changed(out, reference)
    assert line.startswith(b"37,a.skill.json,")
    assert b"worker died (time limit)" in line
    notes = [p.note for p in told if p.note]
    where = "while on trials 36 to 37 of a.skill.json; they run again, in halves"
    assert f"a worker was replaced: it made no progress for too long {where}" in notes
    assert notes[-1].startswith("trial 37 of a.skill.json ran again alone, and this is its row now: worker died (time")


@pytest.mark.slow
def test_progress_never_runs_backwards_when_chunks_are_lost(campaign, tmp_path, monkeypatch):
    out, told = fakes.start(campaign(trials=38), tmp_path / "out"), []
    monkeypatch.setattr("skillframe.campaign.cluster.TELL_S", 0.1)
    fakes.run(out, fakes.tells_and_kills, told.append, workers=2, chunk=2, traces=0)
    assert any(p.under_way >= 1.0 for p in told)  # half of the two that are lost then
    shares = [p.done + p.under_way for p in told]
    assert shares == sorted(shares)
    assert shares[-1] == told[-1].total
    assert any("a worker was replaced: it was killed while on trials 36 to 37" in p.note for p in told)


@pytest.mark.slow
def test_nobody_without_the_key_can_connect_to_the_local_scheduler(campaign, tmp_path):
    out, ports = fakes.start(campaign(trials=8), tmp_path / "out"), []

    def knock(progress):
        if not ports and progress.done:
            listening = (c for c in psutil.Process().net_connections() if c.status == psutil.CONN_LISTEN)
            ports.extend(c.laddr.port for c in listening)
            assert not talks_in_plain(ports)
            assert not any(talks_to_a_stranger(port) for port in ports)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Dask's, of connections that were refused
        fakes.run(out, fakes.good, knock, workers=1, chunk=4, traces=0)
    assert len(ports) >= 2  # the scheduler and the nanny, at least


def talks_in_plain(ports):
    """Whether who listens at one of some ports begins to talk, as a Dask server without TLS does, and so takes code."""
    with ExitStack() as stack:
        knocked = [stack.enter_context(socket.create_connection(("127.0.0.1", port))) for port in ports]
        return bool(select.select(knocked, [], [], 1.0)[0])


def talks_to_a_stranger(port):
    """Whether who listens at a port talks to one with a key of its own."""
    stranger = Security.temporary().get_connection_args("client")["ssl_context"]
    stranger.verify_mode = ssl.CERT_NONE
    try:
        with stranger.wrap_socket(socket.create_connection(("127.0.0.1", port), timeout=1)) as encrypted:
            return bool(encrypted.recv(1))
    except OSError:  # silence, or that the key is refused
        return False


@pytest.mark.slow
def test_rows_that_die_with_their_worker_before_they_are_fetched_are_made_again(out, reference, monkeypatch):
    gather, gathers = distributed.Client._gather, []

    async def too_late(*args, **options):
        gathers.append(args)
        if len(gathers) == 2:
            for worker in workers_of_this_process():
                os.kill(worker.pid, 9)
            await asyncio.sleep(1.0)
        return await gather(*args, **options)

    monkeypatch.setattr(distributed.Client, "_gather", too_late)
    monkeypatch.setattr("skillframe.campaign.cluster.GONE_S", 1.0)
    fakes.run(out, fakes.good, **LIMITS)
    assert len(gathers) > 2
    assert changed(out, reference) == []


KILLED_AT_START = """
import os, sys
if "--multiprocessing-fork" in sys.argv:
    os.kill(os.getpid(), 9)
"""


@pytest.mark.slow
def test_workers_that_are_killed_at_their_start_end_in_one_sentence(out, tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(KILLED_AT_START)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(SchedulerError, match="the 2 workers could not be started"):
        fakes.run(out, fakes.good, workers=2)
    monkeypatch.delenv("PYTHONPATH")
    assert fakes.run(out)["complete"]


@pytest.mark.slow
def test_a_hang_in_a_small_chunk_is_ended_and_named(out, reference):
    fakes.run(out, fakes.hangs_holding_the_lock, **{**LIMITS, "chunk": 2, "time_limit_s": 1.0})
    (line,) = changed(out, reference)
    assert line.startswith(b"37,a.skill.json,")
    assert b"worker died (time limit)" in line


@pytest.mark.slow
def test_how_far_chunks_are_is_told_while_they_run_and_what_a_killed_session_left_is_swept(campaign, tmp_path):
    out = fakes.start(campaign(trials=4), tmp_path / "out")
    (out / "watch").mkdir()
    (out / "watch" / "job-99.txt").touch()
    told = []
    fakes.run(out, fakes.tells, told.append, workers=2, chunk=2, traces=0)
    assert {p.under_way for p in told if not p.done} >= {2.0}  # two chunks of two runs, both half done
    assert not (out / "watch").exists()


@pytest.mark.slow
def test_a_trial_whose_worker_was_killed_once_is_not_blamed(out, reference):
    fakes.run(out, fakes.dies_once, **LIMITS)
    assert (out / "died").exists()
    assert changed(out, reference) == []


@pytest.mark.slow
def test_workers_killed_from_outside_cost_time_only(out, reference):
    victims = []

    def kill_one(progress):
        workers = workers_of_this_process()
        if progress.done and len(victims) < 3 and workers:
            victims.append(workers[0].pid)
            os.kill(workers[0].pid, 9)

    fakes.run(out, fakes.slow, kill_one, **LIMITS)
    assert len(victims) == 3
    assert changed(out, reference) == []


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@pytest.mark.slow
def test_a_campaign_runs_on_a_scheduler_that_is_there_already(out, reference, tmp_path):
    address = f"tcp://127.0.0.1:{free_port()}"
    environment = {**os.environ, "PYTHONPATH": str(Path(fakes.__file__).parent)}
    dask = [sys.executable, "-m", "distributed.cli"]
    commands = [
        [*dask[:2], "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard", "--no-show"],
        [*dask[:2], "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard",
         "--local-directory", str(tmp_path)],
    ]  # fmt: skip
    processes = [
        subprocess.Popen(c, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for c in commands
    ]
    try:
        fakes.run(out, fakes.good, scheduler=address, chunk=16, traces=0)
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(timeout=20)
    assert changed(out, reference) == []


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_refused_and_the_folder_stays_usable(out, monkeypatch):
    monkeypatch.setattr("skillframe.campaign.cluster.CONNECT_S", 1.0)
    begin = time.monotonic()
    with pytest.raises(SchedulerError, match="cannot be used"):
        fakes.run(out, fakes.good, scheduler=f"tcp://127.0.0.1:{free_port()}")
    assert time.monotonic() - begin < 20.0
    assert fakes.run(out)["complete"]
