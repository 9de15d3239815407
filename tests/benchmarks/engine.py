"""What the engine of a campaign takes beside the trials: wall time, memory of the coordinator, bytes of the store.

The trials are free: an outcome made up in numpy with all columns that a trial of a world has. Each figure is of a
process of its own, `engine.py COUNT WORKERS FOLDER`, for the peak of a process's memory never falls.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
TRIALS = 100_000
TEXT = """
name = "free"
seed = 7
trials = {trials}
robot = "robots/box/robot.toml"
world = "fake"
skills = ["a.skill.json"]
duration_s = 5.0
[vary]
"start.tilt_y" = {{ uniform = [-0.21, 0.21] }}
"start.offset_x" = {{ normal = [0.0, 0.002] }}
"world.friction" = {{ choice = [0.1, 0.2, 0.3] }}
"""


def free(job):
    """Rows with every column that a judged trial has, for no work."""
    from skillframe.campaign.rows import JUDGED_MEASURES, rows_of
    from skillframe.campaign.spec import CampaignSpec

    spec, n = CampaignSpec.from_plain(job.spec), len(job.trials)
    rng = np.random.default_rng(job.trials[0])
    success = rng.random(n) < 0.9
    joints = np.array([f"panda_joint{i}" for i in range(1, 8)])
    outcome = {
        "success": success, "failure": np.where(success, "", "time limit: 5 s"), "duration_s": 2.0 + rng.random(n),
        **{name: rng.random(n) for name in ("peak_force_n", "final_error_m", "final_error_rad", *JUDGED_MEASURES)},
        "ended_by": np.where(success, "goal", "time_limit"),
        **{name: joints[rng.integers(0, 7, n)]
           for name in ("peak_torque_joint", "peak_speed_joint", "peak_range_joint")},
        "goal_reached": success, "ended_itself": success, "status": np.where(success, 1, 2),
        "reason": np.where(success, "done", ""),
    }  # fmt: skip
    return rows_of(spec, job.skill, job.trials, outcome)


def measure(count, workers):
    """Run in a process of its own: seconds, peak MB, bytes a trial."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tests.benchmarks.engine", str(count), str(workers), folder]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return json.loads(done.stdout.splitlines()[-1])


def rows(show):
    """Print the engine's rows with `run.show`."""
    for workers, most, what in ((0, 0.5, "in-process"), (2, 1.0, "with 2 workers")):
        found = measure(TRIALS, workers)
        show(f"a campaign of {TRIALS:,} free trials {what}: wall time a trial", found["ms"], "ms", most)
        show(f"a campaign of {TRIALS:,} free trials {what}: coordinator's memory", found["mb"], "MB", 250.0)
    show("rows.jsonl with its checksums, a trial", found["bytes"], "B", 300.0)
    show("the same, with zlib over the whole for comparison", found["zlib"], "B")


def _peak_mb():
    """Largest resident memory since this program began; `resource` counts its parent's, too."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1e3


def main(count, workers, place):
    import zlib

    from skillframe.campaign.runner import Options, run_campaign
    from tests.benchmarks import engine
    from tests.unit.campaign.campaign_fakes import FakeParams, start, write_campaign

    folder = start(write_campaign(place / "plan", trials=count, text=TEXT), place / "out")
    begin = time.perf_counter()
    run_campaign(folder, engine.free, Options(workers=workers or None, traces=0), None, FakeParams)
    seconds = time.perf_counter() - begin
    peak = _peak_mb()
    content = (folder / "rows.jsonl").read_bytes()
    figures = {"ms": 1e3 * seconds / count, "mb": peak, "bytes": len(content) / count}
    print(json.dumps(figures | {"zlib": len(zlib.compress(content)) / count}))


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "unit" / "campaign")]
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
