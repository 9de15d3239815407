"""FMUs that attack: one sentence within the time limit, nothing left running, nothing written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from skillframe.execution.trace import Trace
from skillframe.files import cache_dir
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import build_fmu, find_compiler
from skillframe.fmu.child import Child, SandboxLimits
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.sandbox import SandboxBank
from tests.fmu_cache import own_cache  # noqa: F401
from tests.oracle import fmus
from tests.oracle.attacks import ATTACKS, SECRET, processes, written
from tests.system.crane_fakes import CRANE, OWN, SOURCE, TABLE, crane, driven_by, skill

pytestmark = [pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
LIMIT_S = 3.0
PATIENCE_S = 90.0  # far above any time limit here: what is not done by then hangs
COMMANDS = {
    "check": "import sys; from skillframe.fmu import check as c; from skillframe.cli.main import run;"
    f"c.LIMITS = type(c.LIMITS)(start_s={LIMIT_S}); sys.exit(run(['fmu', *sys.argv[1:]]))",
    "simulate": "import sys; from skillframe.cli.main import run;"
    f"sys.exit(run(['fmu', 'simulate', *sys.argv[1:], '--stop', '0.02', '--step', '0.001', '--timeout', '{LIMIT_S}',"
    "'--out', sys.argv[1] + '.csv']))",
}
LISTENING = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
"""As on a terminal: a shell starts what it runs in the background deaf to Ctrl-C."""
EVERY_DAY = ("stray bytes to every descriptor", "a grandchild that outlives it", "writes files", "a forged end")
BOTH = [
    pytest.param(name, command, marks=() if name in EVERY_DAY and command == "simulate" else pytest.mark.slow)
    for name in ATTACKS for command in COMMANDS
]  # fmt: skip


def started(mark, code, *arguments):
    """Python code in a session of its own, with a secret in its environment."""
    (mark / "home").mkdir(exist_ok=True)
    (mark / "tmp").mkdir(exist_ok=True)
    more = {
        "HOME": str(mark / "home"),
        "TMPDIR": str(mark / "tmp"),
        "SKILLFRAME_TEST_SECRET": SECRET,
        "SKILLFRAME_TEST_MARK": str(mark),
    }
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, errors="replace", cwd=mark, start_new_session=True, env={**os.environ, **more},
    )  # fmt: skip


def ended_in(mark, code, *arguments):
    """(exit code, stdout, stderr, seconds) of Python code. It is ended in any case."""
    begin = time.monotonic()
    process = started(mark, code, *arguments)
    try:
        out, err = process.communicate(timeout=PATIENCE_S)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    return process.returncode, out, err, time.monotonic() - begin


@pytest.fixture
def mark(tmp_path):
    """A folder that everything started here names. Nothing is left of it in the end."""
    yield tmp_path
    for pid in processes(tmp_path):
        with suppress(ProcessLookupError):  # gone meanwhile
            os.kill(pid, signal.SIGKILL)


def hostile(mark, name, command):
    attack = ATTACKS[name]
    prelude = f"#define CHECK {int(command == 'check')}\n" + attack.source(mark)
    library = fmus.library(mark / "c", prelude=prelude, **attack.hooks)
    return fmus.pack(mark / "hostile.fmu", fmus.describe(), library)


@pytest.fixture(scope="module")
def confined():
    """What of the system's confinement holds here."""
    child = Child(Path("none.fmu"), "none", SandboxLimits())
    found = child.ask(b"h", None, 60.0, "being started")
    child.close()
    return found


def nothing_is_left(mark, landlock=True):
    """No process and, where the kernel confines writing, no file. The last process may take a moment to go."""
    patience = time.monotonic() + 5.0
    while (left := processes(mark)) and time.monotonic() < patience:
        time.sleep(0.02)
    assert not left
    assert not list(mark.rglob("skillframe-fmu-*"))
    if landlock:
        assert not written(mark)


@pytest.mark.parametrize(("name", "command"), BOTH)
@pytest.mark.slow
def test_an_fmu_that_attacks_ends_in_a_sentence_and_leaves_nothing(mark, confined, name, command):
    if "kills" in name and not confined["namespace"]:
        pytest.skip("this system gives no process namespace: an FMU can end what belongs to the same user")
    if "writes files" in name and not confined["landlock"]:
        pytest.skip("this kernel has no Landlock: an FMU can write what its user can write")
    words = getattr(ATTACKS[name], command)
    path = hostile(mark, name, command)
    code, out, err, seconds = ended_in(mark, COMMANDS[command], path)
    print(f"{name} | {command} | {seconds:.1f} s | exit {code} | {err.strip() or out.strip()[-300:]}")
    assert SECRET not in out + err and "Traceback" not in err
    nothing_is_left(mark, confined["landlock"])
    assert code == (1 if words else 0), (out, err)
    assert re.search(words, out + err), (out, err)
    assert len(err.strip().splitlines()) <= 1
    if command == "simulate":
        rows = (mark / "hostile.fmu.csv").read_text().splitlines()
        assert len(rows) == 22 if not words else 1 <= len(rows) <= 8


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_however_skillframe_itself_is_ended_nothing_of_an_fmu_goes_on(mark, how):
    path = hostile(mark, "a hundred children, and never answers", "simulate")
    process = started(mark, LISTENING + COMMANDS["simulate"].replace(f"'{LIMIT_S}'", "'80'"), path)
    patience = time.monotonic() + 60.0
    while len(processes(mark)) < 100:  # the FMU is in its step
        assert time.monotonic() < patience and process.poll() is None
        time.sleep(0.05)
    process.send_signal(how)
    process.communicate(timeout=60)
    assert process.returncode != 0
    nothing_is_left(mark)


@pytest.mark.slow
def test_among_many_open_files_an_fmu_that_closes_its_socket_gets_the_same_sentence(mark):
    """As in a large campaign: the number of its socket is above 200, and nothing else may hold that open."""
    name = "closes every descriptor, and goes on"
    full = "import os; held = [os.open(os.devnull, os.O_RDONLY) for _ in range(200)];"
    code, out, err, _ = ended_in(mark, full + COMMANDS["simulate"], hostile(mark, name, "simulate"))
    assert code == 1 and ATTACKS[name].simulate in err, (out, err)
    nothing_is_left(mark)


LESS = {"no namespace": ("landlock", "subreaper"), "no Landlock": ("namespace",), "neither": ("subreaper",)}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a grandchild that outlives it", "a hundred children", "stops itself", "aborts"])
@pytest.mark.parametrize("less", LESS)
def test_where_the_system_confines_less_nothing_is_left_running(mark, confined, less, name):
    code = COMMANDS["check"].replace(f"start_s={LIMIT_S}", f"start_s={LIMIT_S}, use={LESS[less]!r}")
    code, out, err, _ = ended_in(mark, code, hostile(mark, name, "check"))
    assert code == (1 if ATTACKS[name].check else 0) and re.search(ATTACKS[name].check, out + err), out + err
    lacks = "this system has no Landlock: it can write whatever you can write"
    assert (lacks in out) == ("landlock" not in LESS[less] or not confined["landlock"]) or "did not answer" in out
    nothing_is_left(mark, landlock="landlock" in LESS[less] and confined["landlock"])


MISSED = """
import os, sys, time
from skillframe.fmu import confine, keeper
if not confine.adopt_orphans(): sys.exit("no subreaper")
told, tell = os.pipe()
worker = os.fork()
if worker == 0:
    if os.fork() == 0:
        os.setsid()
        os.write(tell, b"1")
        time.sleep(60)
    os._exit(0)
os.read(told, 1)
listed, lists = confine.descendants, []
confine.descendants = lambda root: lists.append(1) or (listed(root) if len(lists) > 1 else [])
keeper._end_all(0, worker)
print(len(lists), listed(os.getpid()))
"""


def test_a_process_that_a_list_of_processes_misses_is_ended_all_the_same(tmp_path):
    """One whose parent has gone between the list of names and the reading of each is not below us in that list."""
    code, out, err, _ = ended_in(tmp_path, MISSED)
    if "no subreaper" in err:
        pytest.skip("this system hands no orphans to a process of ours")
    assert code == 0 and int(out.split()[0]) > 1 and out.split(maxsplit=1)[1].strip() == "[]", out + err


@pytest.mark.slow
def test_a_forged_number_in_the_loop_ends_its_own_instance_with_a_sentence(mark):
    """Two actuators: the second one writes an answer of its own with a force that is no number."""
    banks = [fmus.pack(mark / "good.fmu", fmus.describe(), fmus.library(mark / "good"))]
    source = ATTACKS["a forged row"].source(mark).split("static void attack(double t) {")[0]
    source += """static void attack(double t) {
        char r[17] = "."; double none = 0.0; none /= none; memcpy(r + 9, &none, 8); forge(steps + 2, 17, r, 17);
    }\n"""
    library = fmus.library(mark / "bad", prelude="#define CHECK 0\n" + source, **ATTACKS["a forged row"].hooks)
    banks.append(fmus.pack(mark / "bad.fmu", fmus.describe(), library))
    specs = [ActuatorSpec(fmu=str(p), name=p.stem, inputs={"command": "u"}, outputs={"force": "y"}) for p in banks]
    bank = SandboxBank(specs, [inspect_fmu(p) for p in banks])
    bank.u[:, 0] = 1.0
    bank.start()
    for k in range(10):
        bank.step(k * 1e-3, 1e-3)
    words = r"bad \(bad.fmu\) sent outputs that are no finite numbers instead of an answer while stepping from 0.005 s"
    assert re.match(words, bank.problem(1)), bank.problem(1)
    assert bank.active.tolist() == [1, 0] and bank.problem(0) == "" and np.isfinite(bank.y[0, 0])
    bank.close()


IN_A_RUN = (
    "stray bytes to every descriptor", "leaves in a step", "kills its parent", "a grandchild that outlives it",
    "writes files", "stops itself", "a message of 4 GB announced",
)  # fmt: skip
RUN = "import sys; from skillframe.cli.main import run; sys.exit(run(['run', *sys.argv[1:]]))"


@pytest.fixture(scope="module")
def push(tmp_path_factory):
    return skill(tmp_path_factory.mktemp("skill"))


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.parametrize("name", IN_A_RUN)
def test_a_crane_whose_cylinder_attacks_ends_its_run_in_a_sentence_and_leaves_nothing(mark, push, confined, name):
    attack = ATTACKS[name]
    step = "steps++; if (m->time > 0.0495) attack(m->time);"
    if not attack.simulate:
        step += "if (m->time > 0.0595) abort();"  # an attack that goes unnoticed ends here, not after the whole run
    good = cylinder(mark / "good", "good", "", "")
    bad = cylinder(mark / "bad", "bad", "#define CHECK 0\n" + attack.source(mark), step)
    robot = crane(mark / "crane", driven_by(good, lift=bad))
    arguments = ["--world", "free", "--robot", robot, "--coc", "0,0,0", "--duration", "0.2", "--out", mark / "run.npz"]
    code, out, err, seconds = ended_in(mark, RUN, push, *arguments)
    print(f"{name} | run | {seconds:.1f} s | exit {code} | {err.strip()} | {out.strip()[-300:]}")
    nothing_is_left(mark, confined["landlock"])
    words = attack.simulate.replace("within 3 s", "within 5 s") or r"crashed \(SIGABRT\) while stepping from 0.0(59|60)"
    assert "Traceback" not in err and code == 1, (out, err)
    assert re.search(words, Trace.load(mark / "run.npz").meta["failure"])


ROBOT = (CRANE / "robot.toml").read_text()


def cylinder(folder, name, prelude, step):
    """A cylinder of `crane_fakes` that does something of its own in every step."""
    source = folder / name
    source.mkdir(parents=True)
    names = sorted(set(re.findall(r"(\w+) = ", "".join(re.findall(r"parameters = \{(.*)\}", ROBOT)))))
    rows = "\n".join(f"{n} = {{ {'boolean = true, start = 1' if 'per_edge' in n else 'start = 1'} }}" for n in names)
    (source / "fmu.toml").write_text(TABLE.format(name=name, parameters=rows))
    (source / "own.h").write_text(OWN)
    (source / f"{name}.c").write_text(prelude + SOURCE.format(step=step, share=1.0))
    return build_fmu(source, 2, out=folder / f"{name}.fmu")


HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="big" guid="x">'
    '<CoSimulation modelIdentifier="big"/><ModelVariables>'
)
TAIL = "</ModelVariables><ModelStructure/></fmiModelDescription>"
VARIABLE = '<ScalarVariable name="v%d" valueReference="%d"><Real/></ScalarVariable>'


def zipped(path, description, resources=()):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        for name, megabytes in resources:
            with archive.open(name, "w") as file:
                for _ in range(megabytes):
                    file.write(bytes(1_000_000))
    return path


WEIGHED = (
    "import re, sys; from skillframe.cli.main import run; code = run(['fmu', *sys.argv[1:]]);"
    "status = open('/proc/self/status').read();"  # its ru_maxrss would begin with that of the process that started it
    "print('MB', int(re.search(r'VmHWM:\\s*(\\d+)', status)[1]) // 1024); sys.exit(code)"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "more"),
    [((), ()), (("simulate",), ("--stop", "1", "--step", "0.1", "--out", "o.csv")), (("build",), ())],
)
def test_a_description_of_600_000_variables_costs_this_process_neither_time_nor_memory(mark, command, more):
    """Read here it took two minutes and 2 GB. Importing and asking a child takes some 100 MB and a second."""
    path = zipped(mark / "big.fmu", HEAD + "".join(VARIABLE % (i, i) for i in range(600_000)) + TAIL)
    code, out, err, seconds = ended_in(mark, WEIGHED, *command, path, *more)
    assert code == 2 and "describes 600000 variables, where 100000 are the most" in err
    # below a fifth of what it took; this machine may be busy
    assert int(out.rpartition("MB ")[2]) < 400 and seconds < 24.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("resources", "words"),
    [
        ([("resources/zeros", 1900)], "unpacks to 2 files of 19000"),
        ([(f"resources/{i}", 9) for i in range(100)], "more than 200 times what it packs them to"),
        ([("resources/zeros", 200)], "bytes that unpack to 200000000"),
    ],
)
def test_a_zip_of_zeros_is_refused_and_nothing_of_it_reaches_the_cache(mark, monkeypatch, resources, words):
    """1.9 GB in one file, 900 MB in files that are each small, and 200 MB."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(mark / "cache"))  # other tests fill the one that all share
    path = zipped(mark / "zeros.fmu", HEAD + VARIABLE % (0, 0) + TAIL, resources)
    before = set(cache_dir("fmus-unpacked").iterdir())
    code, _, err, _ = ended_in(mark, WEIGHED, path)
    assert code == 2 and words in err
    assert set(cache_dir("fmus-unpacked").iterdir()) == before
    assert path.stat().st_size < 3_000_000
