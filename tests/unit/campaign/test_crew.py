"""Who may work: workers are compared with the client, now and when they join."""

import os
import subprocess
import sys
from concurrent.futures import Future
from pathlib import Path

import campaign_fakes as fakes
import pytest

import skillframe
from skillframe.campaign.crew import Crew, SchedulerError
from skillframe.campaign.provenance import Identity, compared, identity, needed_plugins
from skillframe.campaign.spec import CampaignSpec
from tests.unit.campaign.test_cluster import free_port

OURS = Identity(
    {"python": "3.11.7", "numpy": "2.4.6", "mujoco": "4.0.0", "pin": "4.1.0", "skillframe": "0.1.0", "processor": "A"},
    "x86_64", {"skillframe-lmc": "0.1.0", "skillframe-search": "0.1.0"},
    {"skillframe-lmc": ("skill:lmc",), "skillframe-search": ("skill:spiral",)},
)  # fmt: skip
NEEDED = {"skillframe-lmc"}


def test_a_worker_that_is_the_same_is_taken_and_so_is_this_process():
    assert compared(OURS, OURS, NEEDED) == ([], [])
    assert compared(identity(), identity(), {"skillframe"}) == ([], [])


@pytest.mark.parametrize("name", ["python", "numpy", "mujoco", "pin", "skillframe"])
def test_another_version_is_refused_by_name(name):
    theirs = OURS._replace(environment={**OURS.environment, name: "0.0"})
    assert compared(OURS, theirs, NEEDED) == ([f"{name} 0.0 there, {OURS.environment[name]} here"], [])


def test_another_architecture_is_refused_and_another_model_of_processor_is_not():
    assert compared(OURS, OURS._replace(architecture="aarch64"), NEEDED).refused == [
        "a aarch64 processor there, x86_64 here"
    ]
    assert compared(OURS, OURS._replace(environment={**OURS.environment, "processor": "B"}), NEEDED) == ([], [])


@pytest.mark.parametrize(
    ("change", "words"),
    [(None, "absent"), ("0.2.0", "0.2.0"), ("0.1.0 (ImportError: x)", r"0.1.0 (ImportError: x)")],
)
def test_a_plugin_that_is_needed_must_be_the_same_and_another_is_only_said(change, words):
    for name, which in (("skillframe-lmc", "refused"), ("skillframe-search", "noted")):
        plugins = {**OURS.plugins, name: change} if change else {k: v for k, v in OURS.plugins.items() if k != name}
        found = compared(OURS, OURS._replace(plugins=plugins), NEEDED)
        assert getattr(found, which) == [f"plug-in {name} {words} there, 0.1.0 here"]
        assert sum(map(len, found)) == 1


def test_the_plugins_that_a_campaign_needs_are_those_its_skills_and_world_name(campaign):
    path = campaign()
    (path.parent / "a.skill.json").write_text('{"type": "policy", "phases": [{"type": "spiral"}]}')
    spec = CampaignSpec.from_toml(path, fakes.FakeParams)
    provides = {
        "one": ("skill:policy",), "two": ("skill:spiral",), "three": ("skill:lmc",), "four": ("world:fake",),
        "five": ("skill:replay",), "six": ("reader:bag",), "seven": ("segmenter:hmm",),
    }  # fmt: skip
    ours = OURS._replace(provides=provides)
    assert needed_plugins(spec, ours) == {"one", "two", "four", "five", "six"}


class FakeClient:
    """Stands for Dask's: who is there, and what each says of itself."""

    def __init__(self, **identities):
        self.identities, self.threads = identities, {}


def crew_of(client, told):
    crew = Crew(client, OURS, NEEDED, told.append, own=False)
    client.scheduler = client
    client.ncores = lambda: ("ncores", None)
    client.run = lambda function, workers, **options: ("run", workers[0])

    def ask(request):
        kind, address = request
        future = Future()
        future.set_result({a: client.threads.get(a, 1) for a in client.identities} if kind == "ncores" else {
            address: client.identities[address]
        })  # fmt: skip
        return future

    crew._ask = ask
    return crew


def look(crew):
    for _ in range(3):
        crew._due = 0.0
        crew.look()


def test_a_worker_that_joins_late_is_compared_too_and_one_that_left_gets_no_work():
    told, client = [], FakeClient(a=tuple(OURS))
    crew = crew_of(client, told)
    look(crew)
    assert set(crew.usable) == {"a"}
    client.identities |= {"b": tuple(OURS._replace(plugins={})), "c": ImportError("no skillframe"), "d": tuple(OURS)}
    look(crew)
    assert set(crew.usable) == {"a", "d"}
    assert sorted(told) == [
        "worker b gets no work: plug-in skillframe-lmc absent there, 0.1.0 here; install the same there and start it "
        "again",
        "worker c gets no work: it cannot say which versions it runs (ImportError: no skillframe); install skillframe "
        "there",
    ]
    del client.identities["a"]
    look(crew)
    assert set(crew.usable) == {"d"}


def test_a_worker_of_several_threads_gets_no_work_also_if_it_joins_late():
    told, client = [], FakeClient(a=tuple(OURS))
    crew = crew_of(client, told)
    look(crew)
    client.identities["b"], client.threads["b"] = tuple(OURS), 4
    look(crew)
    assert set(crew.usable) == {"a"}
    assert told == ["worker b gets no work: it runs 4 threads; start it with --nthreads 1"]


def test_a_worker_that_died_works_again_once_it_is_there_a_little_later(monkeypatch):
    crew = crew_of(FakeClient(a=tuple(OURS), b=tuple(OURS)), [])
    look(crew)
    crew.lost("a")
    look(crew)
    assert set(crew.usable) == {"b"}
    monkeypatch.setattr("skillframe.campaign.crew.BACK_S", 0.0)
    crew.lost("a")
    look(crew)
    assert set(crew.usable) == {"a", "b"}


def test_where_no_worker_may_work_the_campaign_stops_and_says_why():
    crew = crew_of(FakeClient(a=tuple(OURS._replace(architecture="aarch64"))), [])
    with pytest.raises(SchedulerError, match=r"no worker may work, of 1; a: a aarch64 processor there"):
        look(crew)


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_of_two_workers_the_one_without_the_plugin_gets_no_work(campaign, tmp_path):
    path = campaign(trials=64)
    (path.parent / "a.skill.json").write_text('{"type": "lmc"}')
    out, same = fakes.start(path, tmp_path / "out"), fakes.start(path, tmp_path / "same")
    fakes.run(same, traces=0)
    address, told = f"tcp://127.0.0.1:{free_port()}", []
    base = {**os.environ, "PYTHONPATH": str(Path(fakes.__file__).parent)}
    dask = [sys.executable, "-m"]
    worker = [*dask, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory"]
    lacking = {**base, "SKILLFRAME_PLUGINS": ""}
    processes = []

    def begin(command, environment):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        processes.append(subprocess.Popen(command, env=environment, **quiet))

    def join(progress):
        if len(processes) == 2 and progress.done:  # it joins while the other works, however slowly that one began
            begin([*worker, str(tmp_path / "b")], lacking)
        told.append(progress.note)

    try:
        begin([*dask, "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard", "--no-show"], base)
        begin([*worker, str(tmp_path / "a")], base)
        fakes.run(out, fakes.crawls, join, scheduler=address, chunk=4, traces=0)
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(timeout=20)
    assert (out / "results.csv").read_bytes() == (same / "results.csv").read_bytes()
    notes = [note for note in told if note]
    words = ("gets no work", f"plug-in skillframe-lmc absent there, {skillframe.__version__} here")
    assert any(all(part in note for part in words) for note in notes), notes
