"""FMUs of other makers through `fmu FILE` and `fmu simulate`: equal to fmpy's, and their faults are theirs alone."""

import csv
import json
import re

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.cosim import CosimSettings, Master, Motion
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import find_compiler, find_fmu
from skillframe.fmu.child import SandboxLimits
from skillframe.fmu.opening import open_actuators
from skillframe.fmu.sandbox import SandboxBank
from tests.fmu_cache import own_cache  # noqa: F401
from tests.system.foreign_fmus import by_fmpy, container, shipped, winch
from tests.unit.fmu.fmu_fakes import make, repacked

pytestmark = pytest.mark.slow
SHIPPED = [
    (2, "pythonslave"), (2, "slavewithdep"), (2, "pythonslave_default_ex"),
    (3, "pythonslave"), (3, "slavewithdep"), (3, "pythonslave_arraytypes"), (3, "pythonslaveMXCS"),
]  # fmt: skip


@pytest.fixture(scope="module")
def makers():
    for package in ("pythonfmu", "pythonfmu3", "fmu_manipulation_toolbox"):
        pytest.importorskip(package, reason=f"{package} is a dependency of development")


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mischief")
    if find_compiler() is None:
        pytest.skip("no C compiler")
    return lambda kind, version=2: make(folder, kind, version)


def said(capfd, *arguments):
    """(exit code, stdout, stderr)."""
    code = run(["fmu", *map(str, arguments)])
    return (code, *capfd.readouterr())


def columns(path):
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return {name: [row[i] for row in rows] for i, name in enumerate(head)}


def same(ours, theirs):
    """Every column of fmpy's, arrays taken apart, is in ours to the bit (repr round-trips)."""
    compared = 0
    for name, values in theirs.items():
        wide = np.array(values)
        parts = {name: wide} if wide.ndim == 1 else {f"{name}[{k + 1}]": wide[:, k] for k in range(wide.shape[1])}
        for part, expected in parts.items():
            text = {"True": "1", "False": "0"}
            got = [float(text.get(x, x)) for x in ours[part]]
            np.testing.assert_array_equal(got, np.array(expected, dtype=float), err_msg=part)
            compared += 1
    assert compared == len(ours)


@pytest.mark.parametrize(("version", "name"), SHIPPED)
def test_a_makers_own_model_simulates_as_by_fmpy_and_check_says_what_fmpys_validation_says(
    makers, capfd, tmp_path, version, name
):
    from fmpy.validation import validate_fmu

    path, out = shipped(version, name, tmp_path), tmp_path / "o.csv"
    code, text, _ = said(capfd, path, "--json")
    found = json.loads(text)
    flaws = [" ".join(str(p).split()) for p in validate_fmu(str(path))]
    told = [*found["problems"], *found["notes"]]  # notes: what no run depends on
    assert sorted(told) == sorted(flaws) and code == (1 if found["problems"] else 0)
    assert found["fmi_version"] == f"{version}.0" and "co_simulation" in found["kinds"]
    code, _, err = said(capfd, "simulate", path, "--stop", 0.1, "--step", 0.01, "--out", out)
    assert code == 0, err
    same(columns(out), by_fmpy(path))


@pytest.mark.parametrize("version", [2, 3])
def test_inputs_and_parameters_reach_a_foreign_fmu_as_by_fmpy(makers, capfd, tmp_path, version):
    path, out, table = winch(version, tmp_path), tmp_path / "o.csv", tmp_path / "in.csv"
    table.write_text("time,u,v\n0,0.5,0\n0.05,-1,0.25\n")
    arguments = ("--stop", 0.1, "--step", 0.01, "--input", table, "--set", "stall=1500", "--out", out)
    code, _, err = said(capfd, "simulate", path, *arguments)
    assert code == 0, err
    # fmpy goes linearly between rows: two rows at one time make the jump that ours has by holding
    signals = [["time", "u", "v"], [[0, 0.5, 0], [0.05, 0.5, 0], [0.05, -1, 0.25], [1, -1, 0.25]]]
    theirs = by_fmpy(path, {"stall": 1500.0, "u": 0.5}, signals)
    keep = np.unique(np.round(theirs["time"], 6), return_index=True)[1]
    ours = columns(out)
    # fmpy adds up its time, ours is k x step: the lag is the same to rounding
    np.testing.assert_allclose([float(x) for x in ours["F"]], np.array(theirs["F"])[keep], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("version", [2, 3])
def test_a_foreign_fmu_is_an_actuator_by_name_mapping(makers, tmp_path, version):
    spec = ActuatorSpec(
        fmu=str(winch(version, tmp_path)), inputs={"command": "u", "velocity": "v"}, outputs={"force": "F"},
        parameters={"stall": 1000.0}, name="rope",
    )  # fmt: skip
    bank = open_actuators([spec])
    assert isinstance(bank, SandboxBank)
    bank.u[0, [0, 2]] = 1.0, 0.5
    bank.start()
    assert bank.step(0.0, 0.01), bank.problem(0)
    assert bank.y[0, 0] == pytest.approx(1000.0 * 0.1 - 250.0, rel=1e-12)
    assert not bank.capabilities(0).rollback and not bank.capabilities(0).acceleration
    bank.close()


@pytest.mark.parametrize("version", [2, 3])
def test_a_container_of_another_makers_compiled_master_simulates_as_by_fmpy(makers, capfd, tmp_path, version):
    path, out = container(version, find_fmu("hydraulic_cylinder"), tmp_path), tmp_path / "o.csv"
    code, text, err = said(capfd, path, "--json")
    found = json.loads(text)
    assert code == 0 and found["problems"] == [] and found["fmi_version"] == f"{version}.0", text + err
    assert said(capfd, "simulate", path, "--stop", 0.05, "--step", 1e-3, "--set", "u=0.2", "--out", out)[0] == 0
    same(columns(out), by_fmpy(path, {"u": 0.2}, stop=0.05, step=1e-3))


def test_a_foreign_actuator_moves_a_mass_as_the_cylinder_inside_it_does(makers, tmp_path):
    """No state to restore and no outputs without a step: the master falls back on what is there."""
    names = {"command": "u", "position": "x", "velocity": "v", "acceleration": "a"}
    path = container(2, find_fmu("hydraulic_cylinder"), tmp_path)
    foreign = ActuatorSpec(fmu=str(path), inputs=names, outputs={"force": "F", "work": "W", "pressure_a": "pa"})
    ends = []
    for spec in (ActuatorSpec(fmu="hydraulic_cylinder"), foreign):
        bank = open_actuators([spec])
        master = Master(Mass(2000.0), bank, CosimSettings(step=1e-3))
        master.start()
        for _ in range(300):
            assert master.step(0.1), master.trouble()
        assert master.trouble() == {} and master.residual[0] < 1e-3
        ends.append((master.plant.x, master.plant.v, bank.y[0, bank.outputs.index("pressure_a")]))
        bank.close()
    (x, v, p), other = ends
    assert x > 0.31
    # friction one step late, at a mass of 2 t: a part in a thousand
    np.testing.assert_allclose(other, (x, v, p), rtol=1e-3)


class Mass:
    """A mass on one piston, force linear over a step."""

    count = 1

    def __init__(self, mass):
        self.mass, self.x, self.v = mass, 0.3, 0.0

    def motion(self, force):
        return Motion(np.array([self.x]), np.array([self.v]), force / self.mass)

    def advance(self, begin, end, step):
        a0, a1 = begin[0] / self.mass, end[0] / self.mass
        self.x += step * self.v + step**2 / 6 * (2 * a0 + a1)
        self.v += step / 2 * (a0 + a1)

    def effective_mass(self):
        return np.array([self.mass])


@pytest.mark.parametrize("version", [2, 3])
def test_a_foreign_model_that_raises_ends_with_one_line_and_exit_1(makers, capfd, tmp_path, version):
    path, out = shipped(version, "PythonSlaveWithException", tmp_path), tmp_path / "o.csv"
    assert isinstance(by_fmpy(path), str)  # fmpy raises
    code, _, err = said(capfd, "simulate", path, "--stop", 0.1, "--step", 0.01, "--out", out)
    assert code == 1 and len(err.strip().splitlines()) == 1
    assert re.search(r"failed at 0 s: fmi\dDoStep failed with status 4", err)
    assert len(out.read_text().splitlines()) == 2  # header and start are kept
    assert said(capfd, path)[0] == 1


def test_model_exchange_alone_is_refused_in_words(makers, capfd, tmp_path):
    path, out = shipped(3, "pythonslaveMX", tmp_path), tmp_path / "o.csv"
    code, _, err = said(capfd, "simulate", path, "--stop", 0.1, "--step", 0.01, "--out", out)
    assert code == 2 and "holds model_exchange only; export it as co-simulation" in err and not out.exists()


ENDINGS = {
    "crash": (r"crashed \(SIGSEGV\) while simulating; 6 rows", 7),
    "hang": (r"did not answer within 2 s while simulating; it was stopped; 6 rows", 7),
    "nan": (r"output lag is nan at 0.006 s; 6 rows", 7),
    "refuse": (r"failed at 0.005 s: .*\(the seal is worn\); 6 rows", 7),
    "leave": (r"left with code 7 while simulating; 6 rows", 7),
    "leak": (r"crashed \(SIG(SEGV|KILL|ABRT), having used \d{3,4} MB of 2048 MB\) while simulating", None),
}


@pytest.mark.parametrize(
    ("kind", "version"), [*((kind, 2) for kind in ENDINGS), *((kind, 3) for kind in ("crash", "nan", "refuse"))]
)
def test_an_fmu_that_misbehaves_ends_simulate_with_one_sentence_and_keeps_what_was_reached(
    built, capfd, tmp_path, kind, version
):
    path, out, (words, rows) = built(kind, version), tmp_path / "o.csv", ENDINGS[kind]
    arguments = ("--stop", 0.02, "--step", 0.001, "--out", out, "--timeout", 2)
    code, _, err = said(capfd, "simulate", path, *arguments)
    assert code == 1 and re.search(words, err), err
    assert len(err.strip().splitlines()) == 1
    lines = len(out.read_text().splitlines())
    assert lines == rows if rows else 5 < lines <= 12  # 200 MB a step of 2 GiB: ten steps at most


@pytest.mark.parametrize("kind", ["crash", "hang", "nan", "refuse", "leave", "leak"])
def test_check_finds_every_kind_of_misbehaviour_and_survives_it(built, capfd, monkeypatch, kind):
    monkeypatch.setattr("skillframe.fmu.check.LIMITS", SandboxLimits(start_s=4.0))
    code, text, _ = said(capfd, built(kind), "--json")
    problems = json.loads(text)["problems"]
    assert code == 1 and len(problems) == 1 and "\n" not in problems[0], problems


def test_a_zip_that_would_escape_is_refused_by_every_command_and_writes_nothing(built, capfd, tmp_path):
    bad = repacked(built("good"), tmp_path / "bad.fmu", add=[("../../evil.txt", b"x")])
    for arguments in ((bad,), ("simulate", bad, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv")):
        code, _, err = said(capfd, *arguments)
        assert code == 2 and "would be written outside its folder" in err and len(err.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["bad.fmu"]
    assert not (tmp_path.parent / "evil.txt").exists() and not (tmp_path.parent.parent / "evil.txt").exists()


@pytest.mark.parametrize("sources", [True, False])
def test_an_fmu_for_another_platform_is_refused_with_what_is_inside_and_what_to_do(built, capfd, tmp_path, sources):
    drop = (lambda name: False) if sources else (lambda name: name.startswith("sources/"))
    path = repacked(
        built("good"), tmp_path / "other.fmu", drop=drop,
        rename=lambda name: name.replace("binaries/linux64/", "binaries/win64/").replace(".so", ".dll"),
    )  # fmt: skip
    code, _, err = said(capfd, "simulate", path, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv")
    assert code == 2 and "holds binaries for win64, this machine is linux64" in err
    assert ("type skillframe fmu build" if sources else "ask its maker for linux64 or for sources") in err
    code, text, err = said(capfd, "build", path, "--json")
    if not sources:
        assert code == 2 and "carries no C sources" in err
        return
    out = tmp_path / "o.csv"
    assert code == 0
    made = json.loads(text)[0]["path"]
    assert said(capfd, "simulate", made, "--stop", 0.01, "--step", 0.001, "--out", out)[0] == 0
    same(columns(out), by_fmpy(made, stop=0.01, step=0.001))


def test_wrong_names_are_refused_with_the_nearest_before_anything_is_written(built, capfd, tmp_path):
    out, table = tmp_path / "o.csv", tmp_path / "in.csv"
    table.write_text("time,velocty\n0,0\n")
    base = ("simulate", built("good"), "--stop", 1, "--step", 0.1, "--out", out)
    for extra, words in ((("--set", "gian=1"), "'gain'"), (("--input", table), "'velocity'")):
        code, _, err = said(capfd, *base, *extra)
        assert code == 2 and f"did you mean {words}" in err and len(err.strip().splitlines()) == 1
        assert not out.exists()
