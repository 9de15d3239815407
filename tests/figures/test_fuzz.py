"""Twenty thousand damaged inputs over every kind of input file: no internal error, hang, traceback or half a file."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed (pip install rosbags)")

ROOT = Path(__file__).resolve().parents[2]
COUNT = 20_000
CODE = """
import sys, tempfile
from pathlib import Path
from tests.figures import fuzzing
from tests.oracle import fuzz
count, seed, folder = int(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
cases = fuzzing.cases(folder)
fuzzing.stop_long_work()
found = fuzz.fuzz(cases, fuzzing.command, count, seed, folder)
print(f"seed {seed}", *fuzz.table(found), *map(str, found.bad), sep="\\n")
sys.exit(bool(found.bad) or sum(found.counts.values()) != count)
"""


def fuzz(count: int, seed: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """In a process of its own, because it replaces functions and forks."""
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CODE, str(count), seed, str(folder)], cwd=ROOT, capture_output=True,
        text=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.skipif(sys.platform != "linux", reason="forks and /proc are needed")
@pytest.mark.figures
def test_a_few_hundred_damaged_inputs_are_answered_with_0_1_or_2(tmp_path: Path) -> None:
    ended = fuzz(200, "everyday", tmp_path)
    assert ended.returncode == 0, ended.stdout[-6000:] + ended.stderr[-2000:]


@pytest.mark.figures
@pytest.mark.needs_plugins
@pytest.mark.timeout(0)
@pytest.mark.skipif(sys.platform != "linux", reason="forks and /proc are needed")
def test_twenty_thousand_damaged_inputs_of_a_new_seed_are_answered_with_0_1_or_2(tmp_path: Path) -> None:
    """The seed is the date, so that another day tries others. It is printed, and repeats the run."""
    ended = fuzz(COUNT, time.strftime("%Y-%m-%d"), tmp_path)
    print("\n".join(line for line in ended.stdout.splitlines()[-60:]))
    assert ended.returncode == 0, ended.stdout[-6000:] + ended.stderr[-2000:]


@pytest.mark.skipif(sys.platform != "linux", reason="forks and /proc are needed")
@pytest.mark.slow
def test_the_fuzzer_sees_what_it_is_made_to_see(tmp_path: Path) -> None:
    """A command that breaks each promise in turn: each is found and named."""
    from tests.oracle import fuzz as oracle

    def broken(arguments: list[str]) -> int:
        way, place = arguments[0], Path(arguments[1])
        if way == "leave" and place.name != "warm":
            (place / "out" / "half").write_text("half")
            print("error: no", file=sys.stderr)
            return 2
        if place.name == "warm" or way == "fine":
            return 0
        if way == "raise":
            raise ZeroDivisionError
        if way == "exit":
            return 3
        if way == "die":
            import os
            import signal

            os.kill(os.getpid(), signal.SIGKILL)
        if way == "hoard":
            try:
                bytearray(2 * oracle.MEMORY)
            except MemoryError:
                print("error: memory ran out", file=sys.stderr)
            return 2
        return 2  # without a word

    ways = ("fine", "leave", "raise", "exit", "die", "hoard", "silent")
    cases = [oracle.Case(way, {"a.csv": b"1,2\n"}, "a.csv", [[way, "{}"]]) for way in ways]
    found = oracle.fuzz(cases, broken, 60, "seed", tmp_path)
    outcomes = dict(found.counts.keys())
    assert outcomes == {
        "fine": "0", "leave": "output left behind", "raise": "traceback", "exit": "exit 3", "die": "died of 9",
        "hoard": "memory", "silent": "exit 2 without a word",
    }  # fmt: skip
    assert sum(found.counts.values()) == 60
    shutil.rmtree(tmp_path, ignore_errors=True)
