"""What a tick of `skillframe drive run` costs: a learned valley through a link to a fake arm in the same process.

Wall time of the loop without that of the fake, which stands for the robot.
"""

import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LINKS = {"ur5e": ("position", 0.002, None), "fr3": ("torque", 0.001, 150.0)}


def rows(show):
    """Median and 99 % of the ticks of a run of 3 s."""
    import skillframe
    from skillframe.errors import UnknownName
    from skillframe.execution.executor import simulate
    from skillframe.extend.registry import registry

    try:
        registry().skill("lmc")
        from skillframe_drive.real import drive_type
    except (UnknownName, ImportError):
        print("the runner: its plug-in, or lmc, is not installed")
        return
    sys.path.insert(0, str(ROOT / "plugins" / "drive" / "tests"))
    from direct_link import DirectLink, arm

    from skillframe.execution.prepare import load_robot_model, load_world, prepare

    document = skillframe.learn(skillframe.record("valley", count=2, seed=3)).document
    for robot, (takes, period, most) in LINKS.items():
        link, ends = DirectLink(arm(robot), takes, period), []
        link.read = partial(_timed, link.read, ends)
        skill, setup = prepare(load_robot_model(robot), load_world("valley", {}), document)
        setup = replace(setup, drive=drive_type(link, {}))
        simulate(skill, setup, {}, [np.random.default_rng(0)], duration_s=3.0, trace_hz=100.0)
        waits = np.array(ends).reshape(-1, 2)
        ticks = 1e6 * (waits[1:, 0] - waits[:-1, 1])[-2500:]  # after the tare
        show(f"a tick of the runner, {robot} by {takes}, median", float(np.median(ticks)), "us", most)
        show(f"a tick of the runner, {robot} by {takes}, 99 %", float(np.quantile(ticks, 0.99)), "us")


def _timed(read, ends):
    """A state of the robot, with the times before and after it was read."""
    ends.append(time.perf_counter())
    state = read()
    ends.append(time.perf_counter())
    return state
