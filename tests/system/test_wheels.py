"""What is installed is typed and whole: a user's own checker sees the types, and data that ships is found."""

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

ROOT = Path(__file__).resolve().parents[2]
PLUGINS = sorted(p for p in (ROOT / "plugins").iterdir() if (p / "pyproject.toml").is_file())
PACKAGES = ["skillframe", *(f"skillframe_{plugin.name}" for plugin in PLUGINS)]
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
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib"))  # what stands in its own .pth is not read
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
    assert Path(where).is_relative_to(installed.parents[1]) and count == "23"
    command = [installed, "-m", "skillframe.cli.main", "reproduce", "21", "--quick", "--json", "--out", tmp_path]
    pinocchio = find_spec("pinocchio")  # found through a .pth of its own
    environment = {**os.environ, "PYTHONPATH": str(Path(pinocchio.origin).parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [row["verdict"] for row in json.loads(done.stdout)] == ["pass"]
