"""Systems that lack what Linux has: everything is imported there, and what cannot work says so in a sentence.

A child process hides the modules and the functions of `os` and `signal` that Windows lacks. That is no test on Windows;
it finds imports and defaults that would stop one there.
"""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from skillframe.campaign import folder
from skillframe.errors import InputError
from skillframe.fmu import child

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = [
    "skillframe",
    *(p.name for p in sorted((ROOT / "plugins").glob("*/src/skillframe_*"))),  # lerobot_policy_... needs LeRobot
]
ELSEWHERE = f"""
import importlib, os, pkgutil, signal, sys
import asyncio, multiprocessing.connection, shutil, socket, subprocess, tempfile, threading  # of Python itself
import casadi, click, distributed, filterpy.kalman, fmpy.fmi2, fmpy.fmi3, matplotlib.figure  # made for all
import mujoco.batch, numpy, pinocchio, pluggy, rich.console, rich.progress, scipy.stats, scipy.optimize
import scipy.sparse, scipy.spatial
for module in ("fcntl", "resource", "pwd", "grp", "termios", "pty"):
    sys.modules[module] = None
for name in (
    "O_NOFOLLOW", "O_CLOEXEC", "O_PATH", "fork", "getuid", "geteuid", "getgid", "killpg", "pread", "pwrite", "setsid",
    "sysconf", "uname", "wait4", "waitid", "P_PID", "WNOHANG",
):
    delattr(os, name)
for name in ("SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGUSR1", "pause", "set_wakeup_fd"):
    delattr(signal, name)
count = 0
for package in {PACKAGES!r}:
    package = importlib.import_module(package)
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if ".plugin_template" not in found.name and "._data" not in found.name:
            importlib.import_module(found.name)
            count += 1
assert count > 250, count
"""
WORK = """
import os
from pathlib import Path
os.environ["CC"] = "/nonexistent"  # building starts a process, as below; so this is a machine without a compiler
from skillframe.cli.main import run
from skillframe_reports import opengl
opengl.backend = lambda: None  # it starts a process, for which Python itself needs on Linux what is hidden here
assert run(["doctor", "--json"]) == 0
where = ["--world", "valley", "--robot", "free_tool"]
assert run(["record", *where, "--count", "2", "--seed", "1", "--out", "demo.npz"]) == 0
assert run(["learn", "demo1.npz", "demo2.npz", "--out", "slide.skill.json"]) == 0
assert run(["run", "slide.skill.json", *where, "--out", "run.npz"]) == 0
Path("plan.toml").write_text(
    'name = "a"\\nseed = 1\\ntrials = 4\\nrobot = "free_tool"\\nworld = "valley"\\nskills = ["slide.skill.json"]\\n'
    '[vary]\\n"world.friction" = { uniform = [0.1, 0.3] }\\n'
)
assert run(["campaign", "run", "plan.toml", "--out", "results", "-q"]) == 0
assert not Path("results/lock").exists() and len(Path("results/results.csv").read_text().splitlines()) == 5
assert run(["fmu", "any.fmu"]) == 2
"""


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_every_module_is_imported_and_lmc_learns_and_runs_where_linux_s_own_calls_are_missing(tmp_path):
    with zipfile.ZipFile(tmp_path / "any.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='2.0'/>")
    command = [sys.executable, "-W", "ignore", "-c", ELSEWHERE + WORK]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-4000:]
    assert "any.fmu: cannot be run: an FMU runs under limits that this system lacks; use Linux" in run.stderr


@pytest.fixture
def by_name(monkeypatch):
    monkeypatch.setattr(folder, "ADVISORY", False)


def test_without_advisory_locks_the_file_itself_is_the_lock(tmp_path, by_name):
    with folder.FolderLock(tmp_path):
        pid, host = folder.holder(tmp_path)
        with pytest.raises(
            InputError, match=rf"process {pid} on {host} may be writing .* has ended there, then delete"
        ):
            folder.FolderLock(tmp_path).__enter__()
        assert (tmp_path / "lock").is_file()  # the one that was refused removes nothing
    assert folder.holder(tmp_path) is None


def test_without_advisory_locks_that_of_a_killed_writer_is_named_and_deleted_by_hand(tmp_path, by_name):
    (tmp_path / "lock").write_text('{"pid": 12, "host": "there"}')
    with pytest.raises(InputError, match="process 12 on there may be writing"):
        folder.FolderLock(tmp_path).__enter__()
    (tmp_path / "lock").unlink()
    with folder.FolderLock(tmp_path):
        pass


def test_where_a_process_cannot_be_limited_a_foreign_fmu_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(child, "CONFINES", False)
    monkeypatch.setattr(child.subprocess, "Popen", None)
    with pytest.raises(InputError, match="runs under limits that this system lacks; use Linux"):
        child.Child(tmp_path / "a.fmu", "a", child.SandboxLimits())
