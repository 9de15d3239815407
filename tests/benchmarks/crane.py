"""Rows of the hydraulic crane: co-simulation with three cylinders, contact, estimate and filter, on one core.

A trial presses a plate at K = 1e5 N/m and D = 5e4 N s/m; sensors, estimate, law, three FMUs, MuJoCo (RK4) and a trace
at 100 Hz are in the loop at 1 kHz. CPU time, of ticks alone, in windows of a quarter of a second: the fastest in
contact is what the code can do, the mean what it did on a machine whose cores others used as well.
"""

from __future__ import annotations

import itertools
import time
from contextlib import ExitStack
from unittest import mock

import numpy as np

from tests.benchmarks import driver

COUNT, SECONDS, WINDOW_MS = 32, 4.0, 250


def setting():
    from skillframe_papers.rows import crane_runs

    from skillframe.execution.executor import Setup
    from skillframe.execution.prepare import load_robot_model

    start = np.array([crane_runs.FIXTURE[0], 0.0, 0.7])
    scene = crane_runs.scene(start, plate=True)
    return Setup(robot=load_robot_model("hiab_xs031"), scene=scene, center_of_compliance=np.zeros(3))


def loop(count):
    """A loop after its calibration in the air."""
    from skillframe.execution.executor import begin
    from tests.laws.pushing import Push

    stiffness, damping = np.diag([1e5] * 3 + [0.0] * 3), np.diag([5e4] * 3 + [1.0] * 3)
    skill = Push((0.2, 0.0, -1.0), stiffness, speed=0.1, cap=8000.0, stall=False, damping=damping)
    draws = {
        "robot.mass_scale": np.linspace(0.98, 1.02, count), "actuator.friction_scale": np.linspace(0.8, 1.2, count)
    }  # fmt: skip
    rngs = [np.random.default_rng(i) for i in range(count)]
    made = begin(skill, setting(), draws, rngs, 100.0)
    with np.errstate(invalid="ignore", over="ignore"):
        made.prepare()
    return made


def timed(count, seconds=SECONDS):
    """Simulated seconds of all trials per CPU second: in the fastest window with contact, and in the mean."""
    made = loop(count)
    marks = []

    def note(now):
        if round(1000 * now) % WINDOW_MS == 0:
            marks.append((time.process_time(), bool(made.plant.contact_force().max() > 0.0)))

    with np.errstate(invalid="ignore", over="ignore"):
        made.run(seconds, note)
    assert not made.outcomes.limited.any(), made.outcomes.reason
    spent = [(after[0] - before[0], before[1]) for before, after in itertools.pairwise(marks)]
    fastest = min(cpu for cpu, touching in spent if touching)
    mean = sum(cpu for cpu, _ in spent) / len(spent)
    return count * WINDOW_MS * 1e-3 / fastest, count * WINDOW_MS * 1e-3 / mean


def uncompiled():
    """The loop as a machine without a compiler runs it that was given a built FMU: interpreter, ctypes."""
    stack = fresh_banks()
    stack.enter_context(mock.patch("skillframe_hydraulics.law.generated.build_library", return_value=None))
    stack.enter_context(mock.patch("skillframe.fmu.driver.compiled_step", return_value=None))
    return stack


def reference_actuators():
    """The loop as it is without a compiler and without a built FMU: interpreter, law and reference cylinders."""
    stack = fresh_banks()
    for module in ("skillframe.fmu.build", "skillframe_hydraulics.cylinder.bank"):
        stack.enter_context(mock.patch(f"{module}.find_compiler", return_value=None))
    return stack


def fresh_banks():
    """Banks that were opened before count as not there, here and afterwards."""
    stack = ExitStack()
    stack.enter_context(mock.patch("skillframe.fmu.opening._KEPT", {}))
    return stack


def second_run():
    """CPU seconds of resetting and starting the cylinders in a bank that is there."""
    made = loop(1)
    before = time.process_time()
    for _ in range(20):
        made.drive.bank.start(0.0)
    return (time.process_time() - before) / 20


def rows(show):
    """Print the crane's rows with `run.show`."""
    from skillframe.fmu.build import find_compiler

    if find_compiler() is None:
        print("crane: no C compiler here")
        return
    best, mean = timed(1)
    show("crane, one run: real time, fastest 0.25 s in contact", best, "x", 10.0, below=False)
    show("crane, one run: real time, mean", mean, "x")
    with uncompiled():
        best, mean = timed(1)
    show("crane, no compiler, FMUs built elsewhere: real time, fastest", best, "x", 3.0, below=False)
    show("crane, no compiler, FMUs built elsewhere: real time, mean", mean, "x")
    with reference_actuators():
        best, _ = timed(1)
    show("crane, no compiler, reference cylinders: real time, fastest", best, "x", 3.0, below=False)
    best, mean = timed(COUNT, 3.5)
    show(f"crane, batch of {COUNT}: simulated seconds of all trials per second, mean", mean, "x", 8.0, below=False)
    show("crane: starting its cylinders again in the same process", 1e3 * second_run(), "ms", 5.0)
    driver.rows(show)
