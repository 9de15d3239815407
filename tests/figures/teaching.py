"""Demonstrations of the simulated teacher and what LMC learns from them, for the tables over many seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.demonstration.record import Demonstration
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.world.quantities import SensorSettings

SEED = 20261121
PAIRS = 20
DOWN = np.array([0.0, 0.0, -1.0])


def taught(
    world: str, params: dict[str, Any], noise_deg: float, *, pairs: int = PAIRS, each: int = 2, seed: int = SEED,
    robot: str = "free_tool", sensors: SensorSettings | None = None, **person: Any,
) -> tuple[list[list[Demonstration]], int]:  # fmt: skip
    """Groups of `each` demonstrations by independent seeds, and how many attempts were rejected on the way."""
    settings = TeacherSettings(aim_noise=float(np.deg2rad(noise_deg)), **person)
    scene = load_world(world, params)
    recording = record(load_robot_model(robot), scene, settings, count=pairs * each, seed=seed, sensors=sensors)
    demonstrations = recording.demonstrations
    return [demonstrations[each * i : each * (i + 1)] for i in range(pairs)], len(recording.rejected)


def learned(demonstrations: list[Demonstration], **options: Any) -> Document:
    """The LMC body (`frame`, `phases`) learned from demonstrations."""
    learn = registry().skill("lmc").learn
    assert learn is not None
    return learn(demonstrations, LearnOptions(**options))


def phases(groups: list[list[Demonstration]], **options: Any) -> list[Document]:
    """The one phase learned from each group."""
    return [learned(group, **options)["phases"][0] for group in groups]


def angle_deg(a: Any, b: Float) -> float:
    """Angle between two directions [degrees]."""
    return float(np.rad2deg(np.arccos(np.clip(np.dot(a, b), -1.0, 1.0))))


def axis_angle_deg(a: Any, b: Float) -> float:
    """Angle between two axes, which have no sign [degrees]."""
    return float(np.rad2deg(np.arccos(np.clip(abs(np.dot(a, b)), 0.0, 1.0))))


def row(*cells: Any) -> None:
    """One line of a table on the terminal."""
    print("  ".join(f"{cell!s:>14}" if not isinstance(cell, str) else f"{cell:<34}" for cell in cells))
