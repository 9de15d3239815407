"""What a replay keeps of its demonstration: the tool point's trajectory and wrench at 100 Hz, and how to play them.

The stiffness (2000 N/m, 100 Nm/rad), the blending time of 0.5 s and the rate of 100 Hz are our choices: stiff enough to
follow free motion within a millimetre at hand speeds, and slow enough for a file that can be read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import frame_of
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float, norm

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffness:
    """Of translation [N/m] and rotation [Nm/rad], the same in every direction."""

    translation: float
    rotation: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """When it ends: after so many seconds."""

    time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """The one phase of a replay's document. The fields are those of `ReplaySettings`."""

    name: str = "replay"
    mode: Literal["shifted", "absolute"]
    stiffness: Stiffness
    feedforward: bool
    blend: float
    stop: Stop


def phase_of(document: Document) -> Phase:
    """The phase of a replay's document, checked.

    Raises:
        InputError: not one phase, or a key that is missing, unknown or of no use.
    """
    phases = document["phases"]
    if len(phases) != 1:
        raise InputError("phases", f"a replay has one phase, got {len(phases)}", "learn the skill again")
    phase = build(Phase, phases[0], "phases[0]")
    if min(phase.stiffness.translation, phase.stiffness.rotation, phase.blend) <= 0.0:
        raise InputError("phases[0]", "stiffness and blend must be positive", "give values above zero")
    return phase


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The body of a replay's document.

    Raises:
        InputError: not exactly one demonstration, an unknown setting, or a stiffness or blend that is not positive.
    """
    if len(demonstrations) != 1:
        raise InputError("replay", f"repeats one demonstration, got {len(demonstrations)}", "give one file")
    demonstration = demonstrations[0]
    settings = build(ReplaySettings, options.settings, "replay settings")
    trajectory = resampled(demonstration)
    phase = Phase(
        mode=settings.mode,
        stiffness=Stiffness(translation=settings.stiffness_translation, rotation=settings.stiffness_rotation),
        feedforward=settings.feedforward,
        blend=settings.blend,
        stop=Stop(time=trajectory["time"][-1] + SETTLE),
    )
    body = {"frame": frame_of(demonstrations, options), "phases": [asdict(phase)], "trajectory": trajectory}
    phase_of(body)
    return body


def resampled(demonstration: Demonstration) -> dict[str, list[Any]]:
    """Time from 0, position, quaternion and wrench of the tool point on an even grid of at most 10 ms.

    Faster recordings are averaged over a grid step first, so that their noise is not sampled.
    """
    time = demonstration.time - demonstration.time[0]
    grid = np.linspace(0.0, time[-1], int(np.ceil(time[-1] * RATE)) + 1)
    width = max(round(demonstration.rate / RATE), 1)

    def on_grid(values: Float) -> Float:
        smooth = moving_average(values, width)
        return np.stack([np.interp(grid, time, column) for column in smooth.T], axis=1)

    quaternion = on_grid(_continuous(demonstration.quaternion))
    return {
        "time": grid.tolist(),
        "position": on_grid(demonstration.position).tolist(),
        "quaternion": (quaternion / norm(quaternion)[:, None]).tolist(),
        "wrench": on_grid(demonstration.wrench).tolist(),
    }


def moving_average(values: Float, width: int) -> Float:
    """Centred mean over `width` samples (made odd), over fewer towards the ends so that the ends stay in place."""
    half = np.minimum(width // 2, np.minimum(np.arange(len(values)), np.arange(len(values))[::-1]))
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    result: Float = (total[index + half + 1] - total[index - half]) / (2 * half + 1)[:, None]
    return result


def _continuous(quaternion: Float) -> Float:
    """The same attitudes with signs chosen so that neighbours are near each other."""
    flips = np.where((quaternion[1:] * quaternion[:-1]).sum(1) < 0.0, -1.0, 1.0)
    result: Float = quaternion * np.concatenate([[1.0], np.cumprod(flips)])[:, None]
    return result


def describe(document: Document) -> list[str]:
    """A replay in words."""
    phase, trajectory = phase_of(document), document["trajectory"]
    path = np.asarray(trajectory["position"])
    length, (x, y, z) = norm(np.diff(path, axis=0)).sum(), 1e3 * (path[-1] - path[0])
    how = {
        "shifted": "from wherever the tool is at the start, knowing nothing of the fixture",
        "absolute": "at the recorded place; the error of the start is blended away",
    }[phase.mode]
    lines = [
        f"replay {trajectory['time'][-1]:.2f} s of recorded motion, {how}",
        f"path {1e3 * length:.0f} mm, ending at {x:+.0f}, {y:+.0f}, {z:+.0f} mm from its start",
        f"stiff in every direction: {phase.stiffness.translation:g} N/m, {phase.stiffness.rotation:g} Nm/rad",
    ]
    return [*lines, "exert the recorded wrench as well"] if phase.feedforward else lines


def example() -> Document:
    """A replay of the first example demonstration."""
    from skillframe.document.source import learned
    from skillframe.extend.registry import registry
    from skillframe.testing import example_demonstrations

    return learned(registry().skill("replay"), example_demonstrations()[:1])
