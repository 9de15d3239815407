"""Diggers that press a corner's stack and stop as the how-to's skill says; what their tools did, from the simulator."""

import json
from typing import NamedTuple

import numpy as np

from skillframe.execution.executor import Result, simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from tests.crane_corner import SKILL

TOUCH = 50.0  # N: the least force that counts as contact
GUST = 0.05  # s after a landing that still belong to it: a tool of 200 kg on 1e6 N/m turns round in 44 ms


class Landing(NamedTuple):
    """Of one trial: times that the tool left what it had landed on, largest speed [m/s] and true force [N]."""

    bounces: int
    speed: float
    force: float


def draws(count, seed):
    rng = np.random.default_rng(seed)
    return {
        "start.offset_x": rng.uniform(-0.1, 0.1, count), "start.offset_z": rng.uniform(-0.1, 0.1, count),
        "actuator.friction_scale": rng.uniform(0.8, 1.2, count), "robot.mass_scale": rng.uniform(0.98, 1.02, count),
    }  # fmt: skip


def press(robot, count, seed, seconds=16.0) -> Result:
    """So many trials with the skill of docs/how-to/own-crane.md; a trace at 1 kHz."""
    document = json.loads(SKILL.read_text(encoding="utf-8"))
    skill, setup = prepare(load_robot_model(str(robot)), load_world("pallets", {}), document)
    rngs = [np.random.default_rng([seed, i]) for i in range(count)]
    return simulate(skill, setup, draws(count, seed), rngs, duration_s=seconds, trace_hz=1000.0)


def landing(trace) -> Landing:
    """What a trace shows. Leaving within `GUST` of the first touch is the landing itself."""
    force = np.linalg.norm(trace.wrench_true[:, :3], axis=1)
    on = force > TOUCH
    first = int(np.argmax(on)) if on.any() else len(on)
    left = np.flatnonzero(on[:-1] & ~on[1:])
    speed = np.linalg.norm(np.gradient(trace.position, trace.time, axis=0), axis=1)
    late = left > first + round(GUST * 1000.0)
    return Landing(int(late.sum()), float(speed.max()), float(force.max()))
