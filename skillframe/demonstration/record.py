"""The demonstration record: pose and wrench over time, in one convention.

A `Demonstration` holds the pose of the tool point in base and the wrench that the environment exerts on the tool at
that point, in base axes, without bias and without the tool's weight. Readers convert to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skillframe.config import parse_numbers
from skillframe.config.units import CENTER, parse, require_within, si
from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose, matrix_from_quaternion

POINT_ALIASES = ("tool", "origin")


@dataclass(frozen=True, slots=True, kw_only=True)
class Demonstration:
    """One recorded demonstration of one arm.

    Attributes:
        time: (T,) seconds, strictly increasing.
        position: (T, 3) tool point in base [m].
        quaternion: (T, 4) tool orientation in base, x, y, z, w, unit norm.
        wrench: (T, 6) environment on tool, force then torque [N, Nm], at the tool point, base axes.
        meta: metadata as in the file, JSON values: `task`, `rate`, `teacher` (kinesthetic | teleoperation), `frames`
            ({name: [x, y, z]} points in the tool frame), `hand` (a name of `frames`, or a point), `contact` (bool),
            `sensor` ({`force_noise`, `torque_noise`} standard deviations), `licence`, `notes`, and others.
        extra: further columns, name -> (T,) array.
        source: its file, for messages; empty if made in memory.
    """

    time: Float
    position: Float
    quaternion: Float
    wrench: Float
    meta: dict[str, Any] = field(default_factory=dict)
    extra: dict[str, Float] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        n = len(self.time)
        for name, columns in (("position", 3), ("quaternion", 4), ("wrench", 6)):
            if getattr(self, name).shape != (n, columns):
                raise InputError(
                    self.source or "demonstration",
                    f"{name} has shape {getattr(self, name).shape}, expected ({n}, {columns})",
                    "give one row per time stamp",
                )
        for array in (self.time, self.position, self.quaternion, self.wrench):
            array.setflags(write=False)

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def pose(self) -> Pose:
        """Poses of the tool point, (T, 3) and (T, 3, 3)."""
        return Pose(self.position, matrix_from_quaternion(self.quaternion))

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Median sample rate [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))

    def between(self, start: float | None = None, stop: float | None = None) -> Demonstration:
        """The part with start <= t <= stop [s], on the same clock.

        Raises:
            InputError: fewer than two samples remain.
        """
        keep = np.ones(len(self), dtype=bool)
        keep &= True if start is None else self.time >= start
        keep &= True if stop is None else self.time <= stop
        if keep.sum() < 2:
            raise InputError(
                self.source or "demonstration",
                f"no samples between {start} and {stop} s (the recording spans {self.time[0]:.3f} to "
                f"{self.time[-1]:.3f} s)",
                "choose times inside the recording",
            )
        return Demonstration(
            time=self.time[keep].copy(), position=self.position[keep].copy(), quaternion=self.quaternion[keep].copy(),
            wrench=self.wrench[keep].copy(), meta=self.meta, extra={k: v[keep].copy() for k, v in self.extra.items()},
            source=self.source,
        )  # fmt: skip

    def point(self, name: str | None) -> Float:
        """A point of the tool frame: "x,y,z" in metres, a name of `meta["frames"]`, or None for the tool point.

        Raises:
            UnknownName: no such frame.
        """
        return resolve_point(name, self.meta.get("frames", {}))


def resolve_point(text: str | None, frames: Mapping[str, Any], where: str = "") -> Float:
    """A point in tool coordinates [m] from "x,y,z" or a frame's name. None and "tool" are the tool point.

    Raises:
        UnknownName: the text is neither three numbers nor a known name.
        InputError: a unit of another dimension, or a point out of range.
    """
    if text is None or (text in POINT_ALIASES and text not in frames):
        return np.zeros(3)
    if text in frames:
        return np.array(frames[text], dtype=float)
    typed = [part.strip() for part in text.split(",")]
    values = [si(part, "m", f"{where or 'point'} {text}") for part in typed]
    numbers = np.array(parse_numbers(",".join(map(str, values))))
    if numbers.shape != (3,):
        note = 'or give "x,y,z" in metres in the tool frame, or with units: 0,0,20mm'
        raise UnknownName("point", text, [*frames, "tool"], note=note, where=where)
    for part, number, axis in zip(typed, numbers.tolist(), "xyz", strict=True):
        require_within(part if parse(part) else number, number, "m", CENTER.range, f"{where or 'point'} {text}: {axis}")
    return numbers
