"""A campaign without a simulator: success inside a closed-form region, and trials that kill, hang, hoard and raise."""

import base64
import ctypes
import json
import math
import os
import signal
import struct
import sys
import time
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from skillframe.campaign.folder import prepare
from skillframe.campaign.jobs import report_progress
from skillframe.campaign.rows import EXTRA, OUTCOME, TRACE, rows_of
from skillframe.campaign.runner import Options, run_campaign
from skillframe.campaign.sampling import draws, trial_rngs
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import UnknownName

GUILTY = 37


@dataclass(frozen=True, slots=True, kw_only=True)
class FakeParams:
    friction: float = 0.2
    clearance: float = 0.00025
    profile: str = "round"
    segments: int = 48


TEXT = """
name = "fake"
seed = 7
trials = {trials}
robot = "robots/box/robot.toml"
world = "fake"
skills = ["a.skill.json", "replay:demo.npz"]
duration_s = 5.0
[vary]
"start.tilt_y" = {{ uniform = [-0.21, 0.21] }}
"start.offset_x" = {{ normal = [0.0, 0.002] }}
"world.friction" = {{ choice = [0.1, 0.2, 0.3] }}
{extra}
"""


def write_campaign(folder: Path, *, trials: int = 128, extra: str = "", text: str = TEXT) -> Path:
    (folder / "robots" / "box").mkdir(parents=True, exist_ok=True)
    (folder / "robots" / "box" / "robot.toml").write_text('urdf = "box.urdf"\n')
    (folder / "robots" / "box" / "box.urdf").write_text('<robot name="box"><link name="box"/></robot>')
    (folder / "a.skill.json").write_text("{}")
    (folder / "demo.npz").write_bytes(b"\x00")
    path = folder / "campaign.toml"
    path.write_text(text.format(trials=trials, extra=extra))
    return path


def start(path: Path, out: Path) -> Path:
    prepare(CampaignSpec.from_toml(path, FakeParams), out, lambda spec: {"fixture": []}, FakeParams)
    return out


def run(folder: Path, evaluate=None, notify=None, **options):
    return run_campaign(folder, evaluate or good, Options(**options), notify, FakeParams)


def table(folder):
    return (folder / "results.csv").read_bytes()


def good(job):
    """A skill succeeds while |tilt| stays below its cone less the friction. Noise comes from the trial's generator."""
    spec = CampaignSpec.from_plain(job.spec)
    drawn = draws(spec, job.trials)
    noise = np.array([rng.standard_normal() for rng in trial_rngs(spec.seed, job.trials)])
    reach = np.abs(drawn["start.tilt_y"]) + 0.1 * drawn["world.friction"] + 0.01 * noise + abs(drawn["start.offset_x"])
    success = reach < (0.18 if job.skill == 0 else 0.12)
    rows = rows_of(spec, job.skill, job.trials, {
        "success": success, "failure": np.where(success, "", "stuck"), "duration_s": 2.0 + reach,
        "peak_force_n": np.where(success, 10.0 + noise, np.nan), "final_error_m": reach / 7.0,
        "final_error_rad": np.zeros(len(reach)), "status": np.where(success, 1, 2),
        "reason": np.where(success, "done", ""),
    })  # fmt: skip
    for row in rows if job.traces else ():
        row[TRACE] = f"trace of {row['trial']}".encode()
    return rows


def slow(job):
    time.sleep(0.02 * len(job.trials))
    return good(job)


def crawls(job):
    time.sleep(0.2 * len(job.trials))
    return good(job)


def tells_quickly(job):
    """Says that it is half done."""
    report_progress(0.5)
    return good(job)


def tells(job):
    """Says that it is half done, and takes its time."""
    for _ in range(20):
        report_progress(0.5)
        time.sleep(0.1)
    return good(job)


def unpacked(records):
    """The records of a rows.jsonl, its rows as the versions before 3 wrote them: one JSON object with all columns."""
    layouts, plain = {r["layout"]: r for r in records if "columns" in r}, []
    for record in (r for r in records if "columns" not in r):
        if "layout" in record:
            layout = layouts[record["layout"]]
            bits = base64.b64decode(record["bits"] + "=" * (-len(record["bits"]) % 4))
            floats = struct.unpack(f"<{len(layout['floats'])}d", bits)
            said = {n: x if math.isfinite(x) else repr(x) for n, x in zip(layout["floats"], floats, strict=True)}
            said |= layout["shared"]
            rest = iter(record["rest"])
            row = {name: said[name] if name in said else next(rest) for name in layout["columns"]}
            where = {"ran_on": layout["ran_on"]} if "ran_on" in layout else {}
            record = {"trial": record["trial"], **row, **where}
        plain.append(record)
    return plain


def edit_rows(folder, change, old=False):
    """Rewrite rows.jsonl through a function of its list of records, as version 2, or as skillframe 0.1 did.

    A line ends with `, "crc32": "%08x"}`, the CRC-32 of all that stands before it; 0.1's version was 1 and had none.
    """
    path = folder / "rows.jsonl"
    records = [json.loads(line) for line in path.read_text().splitlines()]
    for record in records:
        record.pop("crc32", None)
    records = unpacked(records)
    records[0]["version"] = 1 if old else 2
    if old:
        for record in records:
            record.pop("ran_on", None)
    content = b""
    for record in change(records):
        text = json.dumps(record, ensure_ascii=False).encode()[:-1]
        content += text + (b"}\n" if old else b', "crc32": "%08x"}\n' % zlib.crc32(text))
    path.write_bytes(content)


def _guilty(job):
    return GUILTY in job.trials and job.skill == 0 and not job.traces


def kills(job):
    if _guilty(job):
        os.kill(os.getpid(), signal.SIGKILL)
    return slow(job)


def hangs(job):
    if _guilty(job):
        time.sleep(3600)
    return slow(job)


def hangs_holding_the_lock(job):
    if _guilty(job):
        ctypes.PyDLL(None).sleep(3600)
    return slow(job)


def hoards(job):
    if _guilty(job):
        hoard = []
        while True:
            hoard.append(np.ones(1_000_000))
            time.sleep(0.005)
    return slow(job)


def raises(job):
    if _guilty(job):
        raise ValueError("the skill tripped")
    return slow(job)


def stalls(job):
    """Says again and again that it is as far as before."""
    while _guilty(job):
        report_progress(0.3)
        time.sleep(0.05)
    return slow(job)


def creeps(job):
    """Three seconds of slow progress."""
    for step in range(30 if _guilty(job) else 0):
        report_progress(step / 30)
        time.sleep(0.1)
    return good(job)


def tells_and_kills(job):
    """Half done for long enough to tell it, and then its worker is killed."""
    if _guilty(job):
        for step in range(8):
            report_progress(0.5 + 0.001 * step)
            time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGKILL)
    return good(job)


def needs_a_file(job):
    """As a skill with a model in a file beside the campaign."""
    (Path(job.folder) / "material").read_text()
    return good(job)


def needs_luck(job):
    """The process that comes first lacks a plug-in for as long as it lives."""
    marker = Path(job.folder) / "first"
    try:
        with marker.open("x") as file:
            file.write(str(os.getpid()))
    except FileExistsError:
        pass
    if marker.read_text() == str(os.getpid()):
        raise UnknownName("skill", "lmc", [])
    return slow(job)


def half_a_pair(job):
    """Words with half of a surrogate pair, as a skill may take from a damaged file name."""
    rows = good(job)
    return rows_of(CampaignSpec.from_plain(job.spec), job.skill, job.trials, {
        name: [f"bad \udcff {row['trial']}" if name == "reason" or (name == "failure" and row[name]) else row[name]
               for row in rows]
        for name in rows[0] if name in (*OUTCOME, *EXTRA)
    })  # fmt: skip


def always_raises(job):
    raise ValueError("nothing works")


def dies_once(job):
    """Kills its worker the first time the guilty trial runs. The marker lies beside the rows."""
    marker = Path(job.folder) / "died"
    if _guilty(job) and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return slow(job)


def dark(job):
    """Every measure is not a number."""
    return [{**row, "peak_force_n": math.nan, "final_error_m": math.inf} for row in good(job)]


if __name__ == "__main__":  # campaign_fakes.py FOLDER FUNCTION [WORKERS]: a client that tests kill
    workers = int(sys.argv[3]) if len(sys.argv) > 3 else None
    run(Path(sys.argv[1]), getattr(__import__("campaign_fakes"), sys.argv[2]), workers=workers, chunk=8, traces=0)
