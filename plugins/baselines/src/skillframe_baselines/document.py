"""What a replay keeps of its demonstration: the tool point's trajectory and wrench at 100 Hz, and how to play them.

The stiffness (2000 N/m, 100 Nm/rad), the blending time of 0.5 s and the rate of 100 Hz are our choices: stiff enough to
follow free motion within a millimetre at hand speeds, and slow enough for a file that can be read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.records import Document, LearnOptions

RATE = 100.0  # Hz
SETTLE = 0.3  # s held after the last sample, before it calls itself done


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySettings:
    """How a recorded motion is played.

    Attributes:
        mode: "shifted": the recorded displacement, from wherever the tool is at the start; "absolute": the recorded
            poses, with the error of the start blended away.
        stiffness_translation: [N/m].
        stiffness_rotation: [Nm/rad].
        feedforward: whether the recorded wrench is exerted as well.
        blend: seconds over which the start's error vanishes and the feed-forward grows.
    """

    mode: Literal["shifted", "absolute"] = "shifted"
    stiffness_translation: float = 2000.0
    stiffness_rotation: float = 100.0
    feedforward: bool = True
    blend: float = 0.5


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The body of a replay's document.

    Raises:
        InputError: not exactly one demonstration, an unknown setting, or a stiffness or blending time that is not
            positive.
    """
    if len(demonstrations) != 1:
        raise InputError("replay", f"repeats one demonstration, got {len(demonstrations)}", "give one file")
    demonstration = demonstrations[0]
    settings = build(ReplaySettings, options.settings, "replay settings")
    if min(settings.stiffness_translation, settings.stiffness_rotation, settings.blend) <= 0.0:
        raise InputError("replay settings", "stiffness and blend must be positive", "give values above zero")
    at = demonstration.point(options.at)
    hand = options.hand or demonstration.meta.get("hand")
    work_at = demonstration.point(hand) if isinstance(hand, str) else np.asarray(at if hand is None else hand, dtype=float)
    trajectory = resampled(demonstration)
    duration = trajectory["time"][-1]
    return {
        "frame": {
            "learned_at": at.tolist(),
            "work_at": work_at.tolist(),
            "center_of_compliance": at.tolist(),
            "axes": options.axes,
        },
        "phases": [
            {
                "name": "replay",
                "mode": settings.mode,
                "stiffness": {"translation": settings.stiffness_translation, "rotation": settings.stiffness_rotation},
                "feedforward": settings.feedforward,
                "blend": settings.blend,
                "stop": {"time": duration + SETTLE},
            }
        ],
        "trajectory": trajectory,
    }


def resampled(demonstration: Demonstration) -> dict[str, list[Any]]:
    """Time from 0, position, quaternion and wrench of the tool point on an even grid of at most 10 ms.

    Faster recordings are averaged over a grid step first, so that their noise is not sampled.
    """
    time = demonstration.time - demonstration.time[0]
    grid = np.linspace(0.0, time[-1], int(np.ceil(time[-1] * RATE)) + 1)
    width = max(round(demonstration.rate / RATE), 1)

    def on_grid(values: Float) -> Float:
        smooth = _moving_average(values, width)
        return np.stack([np.interp(grid, time, column) for column in smooth.T], axis=1)

    quaternion = on_grid(_continuous(demonstration.quaternion))
    return {
        "time": grid.tolist(),
        "position": on_grid(demonstration.position).tolist(),
        "quaternion": (quaternion / norm(quaternion)[:, None]).tolist(),
        "wrench": on_grid(demonstration.wrench).tolist(),
    }


def _moving_average(values: Float, width: int) -> Float:
    """Centred mean over `width` samples (made odd), over fewer towards the ends so that the ends stay in place."""
    half = np.minimum(width // 2, np.minimum(np.arange(len(values)), np.arange(len(values))[::-1]))
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    result: Float = (total[index + half + 1] - total[index - half]) / (2 * half + 1)[:, None]
    return result


def _continuous(quaternion: Float) -> Float:
    """The same attitudes with signs chosen so that neighbours are near each other."""
    flips = np.where((quaternion[1:] * quaternion[:-1]).sum(1) < 0.0, -1.0, 1.0)
    return quaternion * np.concatenate([[1.0], np.cumprod(flips)])[:, None]


def describe(document: Document) -> list[str]:
    """A replay in words."""
    phase, trajectory = document["phases"][0], document["trajectory"]
    path = np.asarray(trajectory["position"])
    length, way = norm(np.diff(path, axis=0)).sum(), path[-1] - path[0]
    how = {
        "shifted": "from wherever the tool is at the start, knowing nothing of the fixture",
        "absolute": "at the recorded place; the error of the start is blended away",
    }[phase["mode"]]
    lines = [
        f"replay {trajectory['time'][-1]:.2f} s of recorded motion, {how}",
        f"path {1e3 * length:.0f} mm, ending {1e3 * way[0]:+.0f}, {1e3 * way[1]:+.0f}, {1e3 * way[2]:+.0f} mm from its start",
        f"stiff in every direction: {phase['stiffness']['translation']:g} N/m, {phase['stiffness']['rotation']:g} Nm/rad",
    ]
    return [*lines, "exert the recorded wrench as well"] if phase["feedforward"] else lines


def example() -> Document:
    """A replay of the first example demonstration."""
    from skillframe.registry import registry
    from skillframe.skillsource import learned
    from skillframe.testing import example_demonstrations

    return learned(registry().skill("replay"), example_demonstrations()[:1])
