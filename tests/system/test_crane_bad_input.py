"""Machines that cannot work, through `skillframe run`: a sentence, exit 2 before a run and 1 in it, nothing lost."""

import re

import pytest

from skillframe.cli.main import run
from skillframe.execution.trace import Trace
from skillframe.fmu.build import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401
from tests.system.crane_fakes import MISCHIEF, crane, driven_by, fake_cylinder, skill
from tests.unit.fmu.fmu_fakes import repacked

pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs_plugins,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]


@pytest.fixture(scope="module")
def push(tmp_path_factory):
    return skill(tmp_path_factory.mktemp("skill"))


@pytest.fixture(scope="module")
def fake(tmp_path_factory):
    """A fake cylinder of a kind, built once."""
    folder, built = tmp_path_factory.mktemp("fakes"), {}

    def make(kind):
        if kind not in built:
            built[kind] = fake_cylinder(folder, kind)
        return built[kind]

    return make


@pytest.fixture
def said(push, tmp_path, capfd):
    """(exit code, stderr, trace file) of `run` with a robot."""

    def say(robot, *more, world="free"):
        out = tmp_path / "run.npz"
        where = ["--world", world, "--robot", robot, "--coc", "0,0,0", "--duration", "0.2", "--out", out]
        code = run([*map(str, ["run", push, *where, *more])])
        said = capfd.readouterr()
        return code, said.out + said.err, out

    return say


def refused(answer, *words):
    """Exit 2, one sentence with these words, no trace."""
    code, text, out = answer
    assert code == 2, text
    assert len(text.strip().splitlines()) == 1, text
    for word in words:
        assert re.search(word, text), text
    assert not out.exists()


def changed(old, new):
    def change(text):
        assert re.search(old, text)
        return re.sub(old, new, text)

    return change


def test_a_start_that_the_supply_pressure_cannot_hold_is_refused_with_forces_and_pressure(said, tmp_path):
    robot = crane(tmp_path / "weak", changed("supply_pressure = 190e5", "supply_pressure = 100e5"))
    refused(said(robot), r"lift_piston would have to push 5\d\.\d kN, more than the \d+\.\d kN that 100 bar can give")


def test_a_supply_pressure_of_one_run_that_cannot_hold_the_start_is_refused_too(said):
    refused(said("hiab_xs031", "--set", "actuator.supply_pressure=100e5"), "lift_piston would have to push", "100 bar")


def test_a_start_that_the_cylinders_cannot_reach_is_refused(said):
    refused(said("hiab_xs031", "--set", "start.offset_x=2.9m"), "reach")


def test_a_machine_whose_fmu_is_for_another_platform_is_refused_with_what_is_inside(said, fake, tmp_path):
    turned = {"rename": lambda name: name.replace("binaries/linux64/", "binaries/win64/").replace(".so", ".dll")}
    with_sources = repacked(fake("good"), tmp_path / "sources.fmu", **turned)
    without = repacked(
        fake("good"), tmp_path / "bare.fmu", drop=lambda name: name.startswith("sources/"), **turned
    )  # fmt: skip
    inside = "holds binaries for win64, this machine is linux64"
    refused(said(crane(tmp_path / "a", driven_by(with_sources))), inside, "type skillframe fmu build")
    refused(said(crane(tmp_path / "b", driven_by(without))), inside, "ask its maker for linux64 or for sources")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('command = "command"', 'command = "comand"', "did you mean 'command'"),
        ('force = "force"', 'force = "forse"', "did you mean 'force'"),
        ("bore = 0.080", "bore = 0.080, boar = 1", "did you mean 'bore'"),
    ],
)
def test_a_wrong_name_in_a_machines_wiring_is_answered_with_the_nearest(said, fake, tmp_path, old, new, words):
    drive = driven_by(fake("good"))
    refused(said(crane(tmp_path / "wired", lambda text: changed(old, new)(drive(text)))), words)


def test_a_machine_without_an_output_that_its_law_needs_says_which(said, fake, tmp_path):
    drive = driven_by(fake("good"))
    cut = changed(', pressure_a = "pressure_a"', "")
    refused(said(crane(tmp_path / "blind", lambda text: cut(drive(text)))), "its FMU gives no pressure_a", "outputs")


def test_a_machines_fmu_that_would_leave_its_folder_when_unpacked_is_refused(said, fake, tmp_path):
    bad = repacked(fake("good"), tmp_path / "bad.fmu", add=[("../../evil.txt", b"x")])
    refused(said(crane(tmp_path / "escape", driven_by(bad))), "would be written outside its folder")
    assert not any(tmp_path.parent.rglob("evil.txt"))


def test_a_control_rate_too_low_for_the_load_is_refused_with_its_number_and_one_that_would_do(said, tmp_path):
    robot = crane(tmp_path / "slow", changed("rate_hz = 1000", "rate_hz = 100"))
    refused(said(robot), r"with a step of 10 ms omega_h H = \d", r"take \d+(\.\d+)? ms or less")


ENDINGS = {
    "crash": r"crashed \(SIGSEGV",
    "hang": r"did not answer within \d+ s",
    "nan": r"an output is not a finite number at 0\.0[45]\d* s",
    "leak": r"crashed \(SIG(SEGV|KILL|ABRT), having used \d{3,4} MB|did not answer within",  # on a busy machine
    "lie": r"bond residual 0?\.?\d+.* is above 0\.01; take a smaller step",
}


@pytest.mark.parametrize("kind", ENDINGS)
def test_a_machine_with_an_fmu_that_misbehaves_ends_with_a_sentence_and_a_trace(said, fake, tmp_path, kind):
    assert kind in MISCHIEF
    code, text, out = said(crane(tmp_path / "bad", driven_by(fake("good"), lift=fake(kind))))
    assert code == 1, text
    assert re.search(ENDINGS[kind], text), text
    assert "Traceback" not in text
    assert re.search(ENDINGS[kind], Trace.load(out).meta["failure"])
