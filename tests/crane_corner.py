"""The crane's load pushed into the corner of stack and stop: the skill written by hand for the how-to, its starts.

Three starts: over the stack, the nominal one, beside the stop. The plant's friction lies within 20 % and its masses
within 2 % of what the controller believes, as in the figures of the force estimate; sensors are noisy.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skillframe.execution.executor import Result, simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare

SKILL = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "corner.skill.json"
STARTS = ((-0.2, -0.15), (0.0, 0.0), (0.2, 0.15))
SECONDS, PEAK = 40.0, 12e3
FRICTION, MASS = 0.2, 0.02


class Corner(NamedTuple):
    """What became of trials: the result, and the start of each."""

    result: Result
    start: np.ndarray

    @property
    def good(self):
        """(N,) in the corner, and never pressed harder than the threshold."""
        return self.result.success & (self.result.peak_force_n < PEAK)


def draws(count, seed):
    """Starts in turn, friction and masses drawn evenly."""
    rng, start = np.random.default_rng(seed), np.arange(count) % len(STARTS)
    offsets = np.array(STARTS)[start]
    return start, {
        "start.offset_x": offsets[:, 0], "start.offset_z": offsets[:, 1],
        "actuator.friction_scale": rng.uniform(1.0 - FRICTION, 1.0 + FRICTION, count),
        "robot.mass_scale": rng.uniform(1.0 - MASS, 1.0 + MASS, count),
    }  # fmt: skip


def into_the_corner(surface, count, seed, document=None, trace_hz=None, seconds=SECONDS):
    """So many trials on a surface, with the skill of the how-to or another document."""
    document = document or json.loads(SKILL.read_text(encoding="utf-8"))
    skill, setup = prepare(load_robot_model("hiab_xs031"), load_world("pallets", {"surface": surface}), document)
    start, drawn = draws(count, seed)
    rngs = [np.random.default_rng([seed, i]) for i in range(count)]
    return Corner(simulate(skill, setup, drawn, rngs, duration_s=seconds, trace_hz=trace_hz), start)
