"""The container file, as far as it can be tested without an engine: what it names exists, and is enough."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ")
LINES = [line.split(maxsplit=1) for line in TEXT.splitlines() if line and not line.startswith("#")]
PROJECTS = [ROOT, *sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))]
COPIED = [line.split()[:-1] for word, line in LINES if word == "COPY" and not line.startswith("--from")]


LARGE = {"lerobot_policy_skillframe"}
"""Not in the image: what drags gigabytes in, and is of use only beside a program that the image does not have."""


def declared():
    """Extras by distribution."""
    read = [tomllib.loads((p / "pyproject.toml").read_text(encoding="utf-8"))["project"] for p in PROJECTS]
    return {each["name"]: set(each.get("optional-dependencies", {})) for each in read if each["name"] not in LARGE}


def test_every_line_is_an_instruction_and_every_stage_that_is_copied_from_is_there():
    assert {word for word, _ in LINES} == {"FROM", "WORKDIR", "COPY", "RUN", "ENTRYPOINT", "CMD"}
    stages = re.findall(r"^FROM \S+ AS (\w+)$", TEXT, re.MULTILINE)
    assert re.findall(r"--from=(\w+)", TEXT) == stages == ["wheels"]


def test_every_file_that_is_copied_is_there():
    assert COPIED and all((ROOT / name).exists() for names in COPIED for name in names)


def test_every_distribution_is_installed_with_extras_that_it_has():
    (line,) = [line for word, line in LINES if word == "RUN" and line.startswith("pip install")]
    found = re.findall(r"(skillframe[\w-]*)(?:\[([a-z,]+)\])?", line)
    assert sorted(name for name, _ in found) == sorted(declared())
    assert all(set(filter(None, extras.split(","))) <= declared()[name] for name, extras in found)


def test_it_runs_a_command_that_exists():
    from skillframe.cli.main import COMMANDS

    assert dict(LINES)["ENTRYPOINT"] == '["skillframe"]'
    assert dict(LINES)["CMD"] == '["doctor"]' and "doctor" in COMMANDS


@pytest.mark.slow
def test_what_it_copies_is_enough_to_build_every_wheel(tmp_path):
    for names in COPIED:
        for name in names:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, tmp_path / name)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    plugins = [f"./plugins/{project.name}" for project in PROJECTS[1:]]
    subprocess.run([*command, "--wheel-dir", "wheels", ".", *plugins], cwd=tmp_path, check=True, timeout=300)
    assert len(list((tmp_path / "wheels").glob("*.whl"))) == len(PROJECTS)
