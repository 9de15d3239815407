"""What is installed works without the checkout, is light to import, and is typed: a user's checker sees its types."""

import json
import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from skillframe_papers import committed

ROOT = Path(__file__).resolve().parents[2]
PLUGINS = sorted(p for p in (ROOT / "plugins").iterdir() if (p / "pyproject.toml").is_file())
PACKAGES = ["skillframe", *(next((plugin / "src").glob("*/__init__.py")).parent.name for plugin in PLUGINS)]
SCRIPT = """
from pathlib import Path
from skillframe import Command, Demonstration, Observation, Pose, Skill
from skillframe.extend.reading import read_demonstration
from skillframe_lmc.settings import Settings

def length(demonstration: Demonstration) -> float:
    return float(demonstration.time[-1])

def kept(skill: Skill, observation: Observation) -> Pose:
    command: Command = skill.step(observation)
    return command.pose

seconds: float = length(read_demonstration(Path("a.npz")))
settings: Settings = Settings()
"""
TEN_LINES = """
from skillframe import Campaign, CampaignResults, LearnedSkill, SingleRun, learn, record, report, run

demonstrations = record("peg_in_hole", "panda", count=2, seed=1)
skill: LearnedSkill = learn(demonstrations, stiffness_n_m=800.0).save("peg.skill.json")
done: SingleRun = run(skill, "peg_in_hole", robot="panda", coc="tip", set={"fixture.tilt_y": "4deg"})
success: bool = done.success
tilted = {"fixture.tilt_y": {"uniform": [-0.1, 0.1]}}
results: CampaignResults = Campaign(world="peg_in_hole", skills=skill, vary=tilted, trials=40).run(workers=2)
report([results, done, "run.npz"], "peg.html")
"""
MISUSE = "\nwrong: str = length(read_demonstration(Path('a.npz')))\n"

pytestmark = [pytest.mark.slow, pytest.mark.needs_plugins]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """A wheel of every distribution of this repository, by package; built without a network."""
    folder = tmp_path_factory.mktemp("wheels")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "-w", folder, ROOT, *PLUGINS], check=True, timeout=300)
    return {path.name.split("-")[0]: path for path in folder.glob("*.whl")}


@pytest.fixture(scope="module")
def installed(wheels, tmp_path_factory):
    """Python of an environment with the wheels unpacked and this one's libraries, without its editable installs."""
    folder = tmp_path_factory.mktemp("user")
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for wheel in wheels.values():
        zipfile.ZipFile(wheel).extractall(site)
    libraries = Path(sysconfig.get_path("purelib"))
    lines = [libraries, libraries / "cmeel.prefix" / site.relative_to(folder)]  # Pinocchio; other .pth are not read
    (site / "libraries.pth").write_text("\n".join(map(str, lines)))
    return folder / "bin" / "python"


def checked(python, folder, text):
    """Exit code and words of `mypy --strict` on a script."""
    script = folder / "script.py"
    script.write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", "", "--python-executable", python]
    run = subprocess.run([*command, script.name], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    return run.returncode, run.stdout + run.stderr


def test_there_is_a_wheel_of_every_distribution_and_it_says_that_it_is_typed(wheels):
    assert sorted(wheels) == sorted(PACKAGES)
    for package, path in wheels.items():
        assert f"{package}/py.typed" in zipfile.ZipFile(path).namelist(), path.name


def test_a_script_that_uses_the_installed_package_passes_a_strict_type_check(installed, tmp_path):
    code, said = checked(installed, tmp_path, SCRIPT)
    assert code == 0, said


def test_ten_lines_of_the_api_pass_a_strict_type_check_and_a_slip_in_them_does_not(installed, tmp_path):
    code, said = checked(installed, tmp_path, TEN_LINES)
    assert code == 0, said
    code, said = checked(installed, tmp_path, TEN_LINES + "run(skill, 3)\nreport(results, outt='x')\n")
    assert code == 1
    assert len(re.findall(r"error: ", said)) == 2, said


def test_the_type_check_of_a_user_sees_the_types_of_the_package(installed, tmp_path):
    code, said = checked(installed, tmp_path, SCRIPT + MISUSE)
    assert code == 1
    assert re.findall(r"error: (.*)", said) == [
        'Incompatible types in assignment (expression has type "float", variable has type "str")  [assignment]'
    ]


def test_a_row_is_computed_from_the_wheels_and_held_against_the_verdict_that_ships(installed, tmp_path):
    said = "from skillframe_papers import committed as c; print(c.__file__, len(c.verdicts(quick=False)))"
    where, count = subprocess.run(
        [installed, "-c", said], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout.split()
    assert Path(where).is_relative_to(installed.parents[1]) and int(count) == len(committed.verdicts(quick=False))
    command = [installed, "-m", "skillframe.cli.main", "reproduce", "21", "--quick", "--json", "--out", tmp_path]
    pinocchio = find_spec("pinocchio")  # found through a .pth of its own
    environment = {**os.environ, "PYTHONPATH": str(Path(pinocchio.origin).parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [row["verdict"] for row in json.loads(done.stdout)] == ["pass"]


@pytest.fixture
def typed(installed, tmp_path, monkeypatch):
    """Type a command in an empty folder, with what is installed only; its exit code, output and messages."""
    for name in ("PYTHONPATH", "SKILLFRAME_PLUGINS", "SKILLFRAME_PATH"):
        monkeypatch.delenv(name, raising=False)

    def run(*words):
        command = [installed, *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
        return done.returncode, done.stdout, done.stderr

    return run


def test_importing_the_installed_package_loads_nothing_but_itself_and_python(typed, installed):
    code = (
        "import sys; before = set(sys.modules); import skillframe as s; print(s.__file__, *set(sys.modules) - before)"
    )
    place, *loaded = typed("-c", code)[1].split()
    assert Path(place).is_relative_to(installed.parents[1])
    assert {name.partition(".")[0] for name in loaded} <= {"skillframe", *sys.stdlib_module_names}


def test_the_demo_works_in_an_empty_folder_from_wheels_alone(typed, tmp_path):
    few = ["--robot", "free_tool", "--trials", "2", "--rate", "0.5", "--workers", "1", "--json"]
    code, said, told = typed("-m", "skillframe.cli.main", "demo", "--out", "demo", *few)
    assert code == 0, told
    assert [p.name for p in tmp_path.iterdir()] == ["demo"]
    assert (tmp_path / json.loads(said)["report"]).stat().st_size > 100_000
    assert "checkout" not in told and "Traceback" not in told


def test_the_installed_package_finds_its_robots_and_its_fmus(typed):
    for words, names in ((["robots"], ["panda", "hiab_xs031"]), (["fmu"], ["hydraulic_cylinder", "electric_servo"])):
        code, said, told = typed("-m", "skillframe.cli.main", *words)  # FMUs, built or not
        assert code == 0, told
        assert all(name in said for name in names)
