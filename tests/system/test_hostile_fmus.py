"""FMUs that attack: one sentence within the time limit, nothing left running, nothing written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from skillframe.actuation.toolchain import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401
from tests.oracle import fmus
from tests.oracle.attacks import ATTACKS, SECRET, processes, written

pytestmark = [pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
LIMIT_S = 3.0
PATIENCE_S = 90.0  # far above any time limit here: what is not done by then hangs
COMMANDS = {
    "check": "import sys; from skillframe.actuation import check as c; from skillframe.cli.main import run;"
    f"c.LIMITS = type(c.LIMITS)(start_s={LIMIT_S}); sys.exit(run(['fmu', 'check', *sys.argv[1:]]))",
    "simulate": "import sys; from skillframe.cli.main import run;"
    f"sys.exit(run(['fmu', 'simulate', *sys.argv[1:], '--stop', '0.02', '--step', '0.001', '--timeout', '{LIMIT_S}',"
    "'--out', sys.argv[1] + '.csv']))",
}
EVERY_DAY = ("stray bytes to every descriptor", "a grandchild that outlives it", "writes files", "a forged row")
SLOW = [pytest.param(name, marks=() if name in EVERY_DAY else pytest.mark.slow) for name in ATTACKS]


def ended_in(mark, code, *arguments):
    """(exit code, stdout, stderr, seconds) of Python code in a session of its own, which is ended in any case."""
    (mark / "home").mkdir(exist_ok=True)
    more = {"HOME": str(mark / "home"), "SKILLFRAME_TEST_SECRET": SECRET, "SKILLFRAME_TEST_MARK": str(mark)}
    begin = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, errors="replace", cwd=mark, start_new_session=True, env={**os.environ, **more},
    )  # fmt: skip
    try:
        out, err = process.communicate(timeout=PATIENCE_S)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    return process.returncode, out, err, time.monotonic() - begin


@pytest.fixture
def mark(tmp_path):
    """A folder that everything started here names; nothing is left of it in the end."""
    yield tmp_path
    for pid in processes(tmp_path):
        os.kill(pid, signal.SIGKILL)


def hostile(mark, name, command):
    attack = ATTACKS[name]
    prelude = f"#define CHECK {int(command == 'check')}\n" + attack.source(mark)
    library = fmus.library(mark / "c", prelude=prelude, **attack.hooks)
    return fmus.pack(mark / "hostile.fmu", fmus.describe(), library)


def nothing_is_left(mark):
    """No process and no file; the last process may take a moment to go."""
    patience = time.monotonic() + 5.0
    while (left := processes(mark)) and time.monotonic() < patience:
        time.sleep(0.02)
    assert not left
    assert not written(mark, Path(tempfile.gettempdir())) and not list(Path("/var/tmp").glob("stolen.txt"))


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", SLOW)
def test_an_fmu_that_attacks_ends_in_a_sentence_and_leaves_nothing(mark, name, command, record_property):
    words = getattr(ATTACKS[name], command)
    path = hostile(mark, name, command)
    code, out, err, seconds = ended_in(mark, COMMANDS[command], path)
    record_property("seconds", round(seconds, 1))
    print(f"{name} | {command} | {seconds:.1f} s | exit {code} | {err.strip() or out.strip()[-300:]}")
    assert SECRET not in out + err and "Traceback" not in err
    nothing_is_left(mark)
    assert code == (1 if words else 0), (out, err)
    assert re.search(words, out + err), (out, err)
    assert len(err.strip().splitlines()) <= 1
    if command == "simulate":
        rows = (mark / "hostile.fmu.csv").read_text().splitlines()
        assert len(rows) == 22 if not words else 1 <= len(rows) <= 8
