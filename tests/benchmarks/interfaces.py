"""What a tick of an arm costs that takes positions or velocities, beside the same arm as an ideal source of torques."""

import time
from dataclasses import replace

import numpy as np

from skillframe.execution.executor import begin
from skillframe.robot.interface import Control
from skillframe.world.quantities import SensorSettings
from tests.benchmarks.timing import timed_run
from tests.laws.pushing import Push, impedance
from tests.laws.runs import generators, setup

KINDS = {
    "torque": Control(),
    "position, 500 Hz": Control(interface="position", rate_hz=500.0),
    "position, 125 Hz": Control(interface="position", rate_hz=125.0, delay_s=0.02),
    "velocity, 1000 Hz": Control(interface="velocity", delay_s=0.003, bandwidth_hz=50.0),
}
BOUND, TICKS, ROUNDS = 1.2, 200, 9


def ratios(show, counts=(1, 96)):
    """The least CPU time of several rounds each, taken in turn; the bound is for positions."""
    for count in counts:
        loops = {name: _loop(control, count) for name, control in KINDS.items()}
        seconds = {name: [] for name in loops}
        for i in range(ROUNDS):
            for name, loop in loops.items():
                before = time.process_time()
                for tick in range(i * TICKS, (i + 1) * TICKS):
                    loop.tick(tick)
                seconds[name].append((time.process_time() - before) / TICKS)
        least = {name: min(values[1:]) for name, values in seconds.items()}
        for name, value in least.items():
            bound = BOUND if name.startswith("position") else None
            show(f"a tick of {count}, {name}, over torque ({1e6 * value:.0f} us)", value / least["torque"], "x", bound)


def real_time(show, bound=6.0):
    """One run of the UR5e told positions, with the peg and a rather fine trace, in contact for nearly all of it."""
    setting = replace(setup("ur5e", "peg_in_hole"), sensors=SensorSettings())
    skill, tilt = (
        Push((0.0, 0.0, -1.0), impedance("x", "y"), speed=0.02, stall=False),
        {"start.tilt_y": np.array([0.1])},
    )
    cpu, _, result = timed_run(skill, setting, tilt, 1, 2.0)
    touching = 100 * np.mean(np.abs(result.traces[0].wrench_true[:, :3]).sum(-1) > 0.0)
    pace = setting.pace  # the loop tells of its progress by the skill's clock
    what = f"UR5e told positions, one run, in contact {touching:.0f} % of the time: real time"
    show(what, pace / cpu, "x", bound, below=False)


def _loop(control, count):
    setting = setup("panda", "valley")
    robot = replace(setting.robot, spec=replace(setting.robot.spec, control=control))
    skill = Push((0.0, 0.0, -1.0), impedance("x"), speed=0.03, stall=False)
    draws = {"start.offset_x": np.linspace(-0.03, 0.03, count)}
    loop = begin(skill, replace(setting, robot=robot), draws, generators(count))
    loop.prepare()
    return loop
