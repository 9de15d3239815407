"""A fake robot in a process of its own, and the runner in another: as a user has them in two terminals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

COMMAND = [sys.executable, "-c", "from skillframe.cli.main import main; main()"]
PATIENT = "import skillframe_drive.link as link; link.SILENT_S = 5.0; "
"""In lockstep the robot's clock stands while a busy machine lets neither process run, for 100 ms and more."""
ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}


class Ended(NamedTuple):
    """What a runner and its fake printed, the runner's exit code, and the time from its verdict to its end [s]."""

    said: str
    fake: str
    code: int
    late_s: float


def host() -> str:
    """A loopback address of this process's own: the makers' ports are fixed."""
    return f"127.0.{os.getpid() // 250 % 250}.{os.getpid() % 250 + 1}"


def cell(folder: Path, robot: str, link: str, **more: str) -> Path:
    """A cell.toml."""
    keys = {"robot": robot, "link": link, "host": host(), "world": "valley", "witness": "pose", **more}
    written = folder / "cell.toml"
    written.write_text("".join(f'{key} = "{value}"\n' for key, value in keys.items()))
    return written


def start_fake(link: str, *words: str) -> subprocess.Popen[str]:
    """A fake robot in lockstep that is ready."""
    line = [*COMMAND, "drive", "fake", link, "--world", "valley", "--host", host(), "--lockstep", "--once", *words]
    process = subprocess.Popen(line, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    first = process.stdout.readline()
    assert first.startswith("ready"), first + process.stdout.read()
    return process


def rehearse(link: str, words: list[str], *fake_words: str, kill: bool = False) -> Ended:
    """Run `skillframe drive WORDS` against a fake. `kill` kills the runner after its first command."""
    *python, program = COMMAND
    runner_line = [*python, program if kill or fake_words else PATIENT + program, "drive", *words]
    with (
        start_fake(link, *fake_words) as fake,
        subprocess.Popen(
            runner_line, env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True,
        ) as runner,
    ):  # fmt: skip
        assert runner.stdin is not None and runner.stdout is not None
        try:
            runner.stdin.write("move\n")
            runner.stdin.flush()
            said, verdict = "", time.monotonic()
            for line in runner.stdout:
                said += line
                if "force sensor reads" in line and kill:
                    assert fake.stdout is not None
                    while "the first command" not in (printed := fake.stdout.readline()) and printed:
                        pass
                    runner.send_signal(signal.SIGKILL)
                if "failure" in line or "success" in line:
                    verdict = time.monotonic()
            code = runner.wait(30)
            late = time.monotonic() - verdict
            printed, _ = fake.communicate(timeout=60)
            return Ended(said, printed, code, late)
        finally:
            for process in (fake, runner):
                process.kill()
