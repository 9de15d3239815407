"""The crane taught by simulated operators on pallets, and what LMC learns from two demonstrations each.

An operator aims at an angle in the crane's plane and starts where a person would who aims so: once over the stack, to
land 0.25 m before the stop, once beside the stop, to touch it 0.25 m over the stack. Plants differ from the
controller's model, pair by pair, by up to 20 % of friction and 2 % of mass; sensors are noisy.
"""

from __future__ import annotations

from math import atan, degrees, radians, tan
from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.sessions import aimed, demonstration_of_machine, operate
from skillframe_hydraulics.teleoperation import OperatorSettings
from skillframe_papers.rows.crane_taught import LEARN

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.execution.trace import Trace
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import norm

SLIDE, OFF = 0.25, 0.12  # m: left to slide once landed, and from the surface at the start
CORNER = np.array([0.5, 0.482])  # x, z of the tool in the world's corner [m]
FRICTION, MASS = 0.2, 0.02
ATTEMPTS = 5


class Taught(NamedTuple):
    """Demonstrations of one operator on one machine, and the traces behind them."""

    demonstrations: list[Demonstration]
    traces: list[Trace]


def starts(angle: float) -> np.ndarray:
    """(2, 2) offsets x, z from the world's nominal start for an operator who aims at an angle [degrees]."""
    world, down = load_world("pallets", {}), tan(radians(-angle))
    over, beside = (-SLIDE - OFF / down, OFF), (-OFF, SLIDE + OFF * down)
    return np.array([over, beside]) + CORNER - np.array(world.start_tip)[[0, 2]]


def teach(angle: float, delay: float, seeds: range, **channel: float) -> tuple[list[Taught], list[str]]:
    """A pair of demonstrations per seed, all pairs in one lock-step loop, and why attempts failed that were redrawn."""
    robot = load_robot_model("hiab_xs031")
    scene = aimed(robot, load_world("pallets", {}), radians(angle))
    settings = OperatorSettings(delay_s=delay, **channel)
    slots = [(seed, i) for seed in seeds for i in (0, 1)]
    done: dict[tuple[int, int], Trace] = {}
    failed: list[str] = []
    for attempt in range(ATTEMPTS):
        left = [slot for slot in slots if slot not in done]
        if not left:
            break
        rngs = [np.random.default_rng([*slot, attempt]) for slot in left]
        result = operate(robot, scene, settings, draws(angle, left), rngs)
        assert result.traces is not None
        for slot, good, reason, trace in zip(left, result.success, result.failure, result.traces, strict=True):
            if good:
                done[slot] = trace
            else:
                failed.append(f"seed {slot[0]}, demonstration {slot[1]}: {reason}")
    assert len(done) == len(slots), failed
    return [_taught([done[seed, i] for i in (0, 1)], scene, settings) for seed in seeds], failed


def _taught(traces, scene, settings):
    return Taught([demonstration_of_machine(trace, scene, settings) for trace in traces], traces)


def draws(angle: float, slots: list[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Start and plant of every (seed, demonstration)."""
    offsets = starts(angle)
    plants = [np.random.default_rng([seed, 77]).uniform(-1.0, 1.0, 2) for seed, _ in slots]
    friction, mass = np.array(plants).T
    places = np.array([offsets[i] for _, i in slots])
    return {
        "start.offset_x": places[:, 0], "start.offset_z": places[:, 1],
        "actuator.friction_scale": 1.0 + FRICTION * friction, "robot.mass_scale": 1.0 + MASS * mass,
    }  # fmt: skip


def learn(demonstrations: list[Demonstration], **settings: object) -> Document:
    """An LMC skill, learned as the how-to page says unless a setting is given."""
    return learned(registry().behaviour("lmc"), demonstrations, LearnOptions(settings={**LEARN, **settings}))


def angle_of(document: Document) -> float:
    """Of the desired direction in the crane's plane [degrees]; NaN where there is none."""
    direction = document["phases"][0]["translation"]["desired_direction"]
    return np.nan if direction is None else degrees(np.arctan2(direction[2], direction[0]))


def margin(angle: float, friction: float = 0.3) -> float:
    """How far an angle lies inside the set of pushes that slide on stack and stop alike [degrees]; negative outside."""
    cone = degrees(atan(friction))
    return min(-cone - angle, angle + 90.0 - cone)


def estimate_error(trace: Trace, least: float = 500.0) -> float:
    """Root mean square of the estimated force's error while the tool touches [N]."""
    touching = norm(trace.wrench_true[:, :3]) > least
    return float(np.sqrt(np.square(trace.wrench - trace.wrench_true)[touching][:, [0, 2]].sum(axis=1).mean()))
