"""What docs/how-to/own-fmu.md shows is built, checked and run."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from skillframe.fmu.toolchain import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-fmu.md").read_text(encoding="utf-8")


def block(language, word=""):
    return next(b for b in re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL) if word in b)


@pytest.mark.parametrize("remembers", [False, True])
def test_the_fmu_of_the_page_builds_and_checks(tmp_path, remembers):
    folder = tmp_path / "fmus" / "winch"
    folder.mkdir(parents=True)
    (folder / "fmu.toml").write_text(block("toml", "winch"))
    (folder / "winch.c").write_text(block("c"))
    if remembers:
        (folder / "own.h").write_text(re.search(r"`(typedef struct .*? Own;)`", PAGE).group(1))
    env = {**os.environ, "SKILLFRAME_PATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    for command in (["build", "winch"], ["check", "winch"]):
        program = [sys.executable, "-m", "skillframe.cli.main", "fmu", *command]
        result = subprocess.run(program, env=env, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr + result.stdout


def test_the_python_of_the_page_runs():
    names = {}
    exec(compile(block("python"), "own-fmu.md", "exec"), names)
    assert names["force"].shape == (32,)
    assert (names["force"] > 5e4).all()  # a command that extends adds to the force that is held
