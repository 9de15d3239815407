"""A campaign's command line in a process of its own, interrupted, ended or out of room: what is finished is kept."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import campaign_fakes as fakes
import pytest
from skillframe_worlds.peg_in_hole import PegParams

from skillframe.campaign.folder import prepare
from skillframe.campaign.runner import run_campaign
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.summary import read_summary

CLIENT = f"""
import sys
sys.path.insert(0, {str(Path(fakes.__file__).parent)!r})
import campaign_fakes, skillframe.campaign.evaluate as real
from skillframe.cli.main import main
real.evaluate = campaign_fakes.slow
if __name__ == "__main__":
    main(sys.argv[1:])
"""


def client(tmp_path, options, prelude=""):
    """A process that runs a campaign of 800 rows, and that campaign's folder."""
    text = fakes.TEXT.replace('"fake"\nskills', '"peg_in_hole"\nskills')
    out, script = tmp_path / "out", tmp_path / "client.py"
    spec = CampaignSpec.from_toml(fakes.write_campaign(tmp_path, trials=400, text=text))
    prepare(spec, out, lambda spec: {}, PegParams)
    script.write_text(prelude + CLIENT)
    process = subprocess.Popen(
        [sys.executable, str(script), "campaign", "resume", str(out), "--chunk", "8", *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    return process, out


def stored_rows(out):
    path = out / "rows.jsonl"
    return path.read_bytes().count(b'"trial"') if path.exists() else 0


def check_ended(process, out, code):
    """The exit code, one sentence, and every finished row kept: how many those are."""
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code
    assert f"skillframe campaign resume {out}" in errors
    assert "Traceback" not in errors
    stored = stored_rows(out)
    assert len(fakes.table(out).splitlines()) == stored + 1
    assert not read_summary(out)["complete"]
    return stored


ALONE, CREW = [], ["--workers", "1"]
CTRL_C, TERM = (os.killpg, signal.SIGINT, 130), (os.kill, signal.SIGTERM, 143)  # Ctrl-C goes to the workers too


@pytest.mark.parametrize(
    ("options", "end", "number", "code"),
    [
        pytest.param(ALONE, *CTRL_C, id="int-in one process", marks=pytest.mark.slow),
        pytest.param(CREW, *CTRL_C, id="int-with a worker", marks=pytest.mark.slow),
        pytest.param(ALONE, *TERM, id="term-in one process"),
        pytest.param(CREW, *TERM, id="term-with a worker", marks=pytest.mark.slow),
    ],
)
def test_a_signal_keeps_what_is_finished_says_how_to_go_on_and_exits_with_its_code(
    tmp_path, options, end, number, code
):
    process, out = client(tmp_path, options)
    while stored_rows(out) < 20:
        assert process.poll() is None
        time.sleep(0.02)
    end(process.pid, number)
    assert 20 <= check_ended(process, out, code) < 800


# Dask's side of fetching a result sends Ctrl-C to its own process and gives the main thread time to be interrupted
AMID_A_GATHER = """
import distributed, os, signal, time
gather, gathers = distributed.Client._gather, []
async def interrupted(*args, **options):
    gathers.append(args)
    if len(gathers) == 4:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
    return await gather(*args, **options)
distributed.Client._gather = interrupted
"""


@pytest.mark.slow
def test_ctrl_c_while_a_result_is_fetched_from_dask_prints_no_traceback(tmp_path):
    process, out = client(tmp_path, ["--workers", "2"], prelude=AMID_A_GATHER)
    assert check_ended(process, out, 130) == 24  # three chunks of eight, the fourth was on its way


# No byte code: the interpreter does not notice that a compiled file was cut at the limit, and keeps it.
FULL = "import resource, sys; sys.dont_write_bytecode = True; resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))"


@pytest.mark.slow
def test_a_full_disk_names_the_file_and_exits_2(tmp_path):
    process, out = client(tmp_path, [], prelude=FULL)  # a file may not grow: what a full disk does to a write
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2, errors
    assert f"error: {out / 'rows.jsonl'}: File too large; finished rows are kept" in errors
    assert (out / "rows.jsonl").read_bytes().endswith(b"}\n")  # nothing half-written
    assert run_campaign(out, fakes.good)["complete"]  # with room again
