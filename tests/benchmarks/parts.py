"""Two parts of meshes in contact by the own generator: processor time of the loop, and of a part's preparation."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from skillframe.world.surfaces import available
from tests.benchmarks.timing import timed_run
from tests.figures.test_parts import of_surfaces
from tests.laws.pushing import Push
from tests.laws.runs import setup

CLEARANCE, TRIALS, DURATION_S = 2.5e-4, 20, 1.0


def rows(show):
    """A filleted peg of 33 mm tilted into a hole 60 mm deep, 20 trials of the Panda side by side, with a trace.

    Args:
        show: takes a name, a value, its unit, and a bound that it has to hold.
    """
    if not available():
        print("parts of meshes: there is no compiler")
        return
    boxes = setup("panda", "peg_in_hole", params={"clearance": CLEARANCE})
    began = time.process_time()
    setting = replace(boxes, scene=of_surfaces(boxes.scene, CLEARANCE))
    show("two parts of meshes, prepared", time.process_time() - began, "s", 3.0)
    draws = {"start.tilt_y": np.linspace(-0.1, 0.1, TRIALS), "world.friction": np.full(TRIALS, 0.2)}
    skill = Push((0.0, 0.0, -1.0), np.diag([20.0, 20.0, 1500.0, 5.0, 5.0, 20.0]), stall=False)
    cpu, _, _ = timed_run(skill, setting, draws, TRIALS, DURATION_S)
    show(f"two parts of meshes, batch of {TRIALS}: real time of each trial", 1.0 / cpu, "x", 20.0, below=False)
