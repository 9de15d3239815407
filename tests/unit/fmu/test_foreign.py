"""FMUs that misbehave: their crash, hang, NaN or leak ends one trial with a sentence, and nothing else."""

import re
import subprocess
import sys
import time
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fmu_fakes import make, repacked

from skillframe.errors import InputError, UnknownName
from skillframe.fmu.actuator import LOST, ActuatorSpec
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.check import check_fmu
from skillframe.fmu.child import SandboxLimits
from skillframe.fmu.driver import FmuBank
from skillframe.fmu.extract import allow, is_allowed, unpack
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.opening import MixedBank, open_actuators
from skillframe.fmu.sandbox import SandboxBank

pytestmark = pytest.mark.usefixtures("compiler")
LIMITS = SandboxLimits(memory_bytes=1500 * 1024**2, start_s=60.0, step_s=1.0)
PATIENT = SandboxLimits(memory_bytes=1500 * 1024**2, start_s=60.0, step_s=20.0)  # a busy machine is no hang


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign")
    return cache(lambda kind, version=2: make(folder, kind, version))


def pair(built, bad):
    """A bank of a well-behaved trial and one with a misbehaving actuator, started at command 1."""
    paths = [built("good"), built(bad)]
    outputs = {"force": "force", "lag": "lag"}
    specs = [ActuatorSpec(fmu=str(p), name=p.stem, outputs=outputs) for p in paths]
    limits = LIMITS if bad == "hang" else PATIENT
    bank = SandboxBank(specs, [inspect_fmu(p) for p in paths], limits=limits)
    bank.u[:, 0] = 1.0
    bank.start()
    return bank


def run(bank, steps=10):
    """Steps, without trying again what was refused."""
    for k in range(steps):
        bank.step(k * 1e-3, 1e-3)
        bank.active[bank.status != 0] = 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (
            "crash",
            r"crash2 \(crash2.fmu\) crashed \(SIGSEGV\) while stepping from 0.005 s",
        ),
        ("hang", r"did not answer within 1 s while stepping from 0.005 s; it was stopped"),
        ("nan", r"an output is not a finite number at 0.005 s"),
        ("refuse", r"the step was refused at 0.005 s \(the seal is worn\)"),
        ("leave", r"left with code 7 while stepping from 0.005 s"),
    ],
)
def test_mischief_ends_its_own_trial_with_a_sentence(built, kind, words):
    bank = pair(built, kind)
    run(bank)
    assert re.search(words, bank.problem(1)), bank.problem(1)
    assert bank.problem(0) == "" and bank.active[0] == 1
    lag = bank.y[0, bank.outputs.index("lag")]  # lag' = u - lag in ten explicit steps of 1 ms
    assert bank.y[0, 0] == 2.0 and lag == pytest.approx(1 - 0.999**10, rel=1e-12)
    bank.close()


@pytest.mark.slow
def test_a_crash_has_the_same_words_beside_a_parent_that_holds_much_memory(built):
    """Linux counts the parent's peak, up to the child's exec, as the child's. 400 MB are above a quarter of 1500 MB."""
    held = np.ones(50_000_000)
    bank = pair(built, "crash")
    run(bank)
    words = bank.problem(1)
    bank.close()
    assert held[-1] == 1.0
    assert words == "crash2 (crash2.fmu) crashed (SIGSEGV) while stepping from 0.005 s"


@pytest.mark.slow
def test_a_leak_says_how_much_memory_it_used(built):
    """Below the shell the parent is a new process: this one's peak may be above the leak's, which then has no words."""
    paths = {kind: str(built(kind)) for kind in ("good", "leak")}
    code = (
        f"from pathlib import Path; from test_foreign import pair, run; paths = {paths}\n"
        "bank = pair(lambda kind: Path(paths[kind]), 'leak'); run(bank)\n"
        "print(bank.problem(0), bank.active[0], bank.problem(1)); bank.close()"
    )
    shell = ["sh", "-c", '"$0" -c "$1"; exit $?', sys.executable, code]
    done = subprocess.run(shell, capture_output=True, text=True, cwd=Path(__file__).parent)
    words = r" 1 leak2 .* crashed \(SIG(SEGV|KILL|ABRT), having used \d{3,4} MB of 1500 MB\)"
    assert re.match(words, done.stdout), done


@pytest.mark.slow
def test_a_lost_instance_is_back_at_the_next_start(built):
    bank = pair(built, "crash")
    run(bank)
    assert bank.status[1] == LOST and not bank.active[1]
    bank.start()
    assert bank.active.all()
    run(bank, 4)
    assert bank.problem(1) == ""
    bank.close()


@pytest.mark.slow
def test_a_child_process_gives_the_same_numbers_as_this_one(built):
    path = built("good", 3)
    spec = ActuatorSpec(
        fmu=str(path), parameters={"gain": 3, "sign": False}, inputs={"command": "command", "velocity": "velocity"},
        outputs={"force": "force", "lag": "lag"},
    )  # fmt: skip
    rows = []
    for kind in (FmuBank, SandboxBank):
        bank = kind([spec], [inspect_fmu(path)])
        bank.u[0, :3] = 0.5, 0.0, 0.25
        bank.start()
        bank.step(0.0, 1e-3)
        bank.save()
        bank.step(1e-3, 1e-3)
        first = bank.y.copy()
        bank.restore()
        bank.step(1e-3, 1e-3)
        np.testing.assert_array_equal(bank.y, first)
        rows.append(bank.y.copy())
        assert bank.capabilities(0).rollback and not bank.capabilities(0).acceleration
        bank.close()
    np.testing.assert_array_equal(rows[0], rows[1])
    assert rows[0][0, 0] == -3 * 0.5 - 0.25


def test_a_foreign_fmu_gets_a_child_and_an_allowed_one_does_not(built, tmp_path):
    path = repacked(built("good"), tmp_path / "mine.fmu", add=[("resources/note.txt", b"mine")])
    spec = ActuatorSpec(fmu=str(path))
    bank = open_actuators([spec])
    assert isinstance(bank, SandboxBank) and "child processes" in bank.notes[0]
    bank.close()
    allow(path)
    assert is_allowed(path)
    bank = open_actuators([spec])
    assert isinstance(bank, FmuBank) and bank.notes == ()
    bank.close()
    assert not is_allowed(built("good"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../../evil.txt", "would be written outside its folder"),
        ("/etc/evil", "would be written outside its folder"),
        ("binaries\\..\\evil.dll", "would be written outside its folder"),
        ("c:evil.dll", "would be written outside its folder"),
    ],
)
def test_a_zip_that_would_leave_its_folder_is_refused(built, tmp_path, name, words):
    bad = repacked(built("good"), tmp_path / "bad.fmu", add=[(name, b"x")])
    with pytest.raises(InputError, match=words):
        unpack(bad)
    with pytest.raises(InputError, match=words):
        check_fmu(bad)
    assert not (tmp_path / "evil.txt").exists()


def test_a_zip_with_a_link_or_a_bomb_is_refused(built, tmp_path, monkeypatch):
    bad = repacked(built("good"), tmp_path / "link.fmu")
    with zipfile.ZipFile(bad, "a") as archive:
        entry = zipfile.ZipInfo("resources/link")
        entry.external_attr = 0o120777 << 16
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(InputError, match="holds a link"):
        unpack(bad)
    monkeypatch.setattr("skillframe.fmu.extract.LARGEST", 1000)
    bomb = repacked(built("good"), tmp_path / "bomb.fmu", add=[("resources/0", b"0" * 5000)])
    with pytest.raises(InputError, match="do not trust"):
        unpack(bomb)


@pytest.mark.parametrize(
    ("find", "offset", "byte", "words"),
    [(b"PK\x01\x02", 6, 133, "zip file version 13.3"), ("\xe9".encode(), 1, 0xFF, "can't decode byte")],
)
def test_a_zip_whose_table_of_contents_is_damaged_is_refused(tmp_path, find, offset, byte, words):
    """A version that nobody has, and a name that is no UTF-8: `zipfile` raises other errors for each."""
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "")
        archive.writestr("resources/\xe9", "")
    content = bytearray(path.read_bytes())
    content[content.rindex(find) + offset] = byte
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"is not an FMU: .*{words}"):
        unpack(path)


@pytest.mark.parametrize("content", [b"", b"no zip at all", b"PK\x03\x04 cut off"])
def test_what_is_no_fmu_gets_one_sentence(tmp_path, content):
    path = tmp_path / "x.fmu"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not an FMU"):
        inspect_fmu(path)


def test_an_fmu_for_another_platform_says_what_is_inside_and_what_to_do(built, tmp_path):
    path = repacked(
        built("good"), tmp_path / "other.fmu", drop=lambda name: name.startswith("sources/"),
        rename=lambda name: name.replace("binaries/linux64/", "binaries/win64/").replace(".so", ".dll"),
    )  # fmt: skip
    problems = check_fmu(path)["problems"]
    assert any("holds binaries for win64, this machine is linux64; and no sources" in p for p in problems)
    with pytest.raises(InputError, match="no sources; ask its maker for linux64 or for sources"):
        open_actuators([ActuatorSpec(fmu=str(path))])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"inputs": {"command": "comand"}}, "did you mean 'command'"),
        ({"outputs": {"force": "forse"}}, "did you mean 'force'"),
        ({"outputs": {"pressure_a": "lag"}}, r"no output is mapped to force \(it has: force, lag\)"),
        ({"parameters": {"gian": 1.0}}, "did you mean 'gain'"),
        ({"inputs": {"command": "force"}}, "'force' is there as output"),
    ],
)
def test_wrong_variable_names_are_answered_with_the_nearest(built, changes, words):
    path = built("good")
    with pytest.raises((UnknownName, InputError), match=words):
        open_actuators([ActuatorSpec(fmu=str(path), **changes)])


def test_a_parameter_of_the_wrong_type_is_refused(built):
    path = built("good")
    with pytest.raises(InputError, match="gain: is of type Real, got 'much'"):
        FmuBank([ActuatorSpec(fmu=str(path), parameters={"gain": "much"})], [inspect_fmu(path)])


def test_a_wrong_token_says_so(built, tmp_path):
    path = built("good")
    with zipfile.ZipFile(path) as archive:
        text = archive.read("modelDescription.xml").decode()
    guid = text.split('guid="')[1].split('"')[0]
    bad = repacked(path, tmp_path / "token.fmu", drop=lambda name: name == "modelDescription.xml",
                   add=[("modelDescription.xml", text.replace(guid, "{0}"))])  # fmt: skip
    with pytest.raises(InstanceFailed, match="GUID"):
        FmuBank([ActuatorSpec(fmu=str(bad))], [inspect_fmu(bad)])


@pytest.mark.slow
def test_all_children_of_a_bank_step_at_the_same_time(built):
    """Four hanging children cost one time limit, not four."""
    path = built("hang")
    bank = SandboxBank([ActuatorSpec(fmu=str(path))], [inspect_fmu(path)], trials=4, limits=LIMITS)
    bank.start()
    run(bank, 5)
    begin = time.monotonic()
    run_from = bank.step(0.005, 1e-3)
    assert not run_from and not bank.active.any()
    # each is given its limit from when it is asked for; four in a row would be 4 s
    assert time.monotonic() - begin < 4 * LIMITS.step_s
    bank.close()


@pytest.mark.slow
def test_only_what_is_foreign_runs_in_children_and_its_end_leaves_the_others(built):
    """One actuator of a trial is allowed, its neighbour crashes. Both have their columns in one table."""
    allow(built("trusted"))
    outputs = {"force": "force", "lag": "lag"}
    specs = [ActuatorSpec(fmu=str(built(k)), name=k, outputs=outputs) for k in ("trusted", "crash")]
    bank = open_actuators(specs, trials=2)
    assert isinstance(bank, MixedBank)
    assert bank.notes == ("crash2.fmu: in child processes (skillframe fmu FILE --allow lets a file run inside)",)
    bank.u[:, bank.inputs.index("command")] = [1.0, 1.0, 3.0, 3.0]
    bank.start()
    run(bank)
    assert bank.active.tolist() == [1, 0, 1, 0]
    assert [bank.problem(i)[:16] for i in range(4)] == ["", "crash (crash2.fm", "", "crash (crash2.fm"]
    lag = bank.y[[0, 2], bank.outputs.index("lag")]
    assert lag == pytest.approx((1 - 0.999**10) * np.array([1.0, 3.0]), rel=1e-12)
    bank.start()
    assert bank.step(0.0, 1e-3)
    assert bank.active.all()
    bank.close()
