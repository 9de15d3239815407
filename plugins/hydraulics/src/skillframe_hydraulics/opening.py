r"""Opening of a valve's edges over its spool's travel, by points (x_i, y_i) of a data sheet.

Shares of the travel and of the rated flow, from (x_1, 0), the overlap, to (1, 1), strictly rising, joined by straight
lines and alike in both directions:

    T(x) = sign(x) sum_i s_i clip(|x| - x_i, 0, x_{i+1} - x_i),    s_i = (y_{i+1} - y_i) / (x_{i+1} - x_i),          (1)
    T^-1(y) = sign(y) (x_1 tanh(|y|/w) + sum_i clip(|y| - y_i, 0, y_{i+1} - y_i) / s_i).                             (2)

(2) crosses the overlap within w = 0.2 % of the flow, as `vdc_actuator.across_deadband` does. A valve without points
opens in proportion beyond its `deadband`. With points, `deadband` is what the swing finds beside them, a share of the
flow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot import Actuation
from skillframe_hydraulics.symbolic_or_numeric import absolute, clip, copysign, tanh

POINTS = 8
"""Most points of a valve."""
COUNT = "opening_points"
ACROSS = 2e-3  # w, share of the valve's travel


def names(i: int) -> tuple[str, str]:
    """Parameters of the FMU for the point i, counted from 0."""
    return f"travel_{i + 1}", f"opening_{i + 1}"


PARAMETERS = (COUNT, *(name for i in range(POINTS) for name in names(i)))


WRITE_OPENING = (
    "write shares of the travel and of the rated flow, such as opening = [[0.1, 0.0], [0.5, 0.12], [1.0, 1.0]]"
)


def wrong(points: Sequence[Sequence[float]], deadband: object = None) -> str:
    """Why points (x_i, y_i) are none of a valve with this `deadband`, or ""."""
    first, last = points[0], points[-1]
    if deadband:
        return "stands beside a deadband, whose place the first point takes"
    if not 2 <= len(points) <= POINTS:
        return f"has {len(points)} points, and a valve has 2 to {POINTS}"
    if first[0] < 0.0 or first[1] != 0.0 or tuple(last) != (1.0, 1.0):
        return f"goes from {[*first]} to {[*last]}, and not from the overlap with a flow of 0 to [1.0, 1.0]"
    for before, after in pairwise(points):
        if not (after[0] > before[0] and after[1] > before[1]):
            return f"does not rise from {[*before]} to {[*after]}"
    return ""


def parameters_of(table: object, deadband: object, where: str) -> dict[str, float]:
    """Parameters of the FMU for `opening` of a `[[cylinder]]` or `[[motor]]`. Raises `InputError` with `where`."""
    rows = table if isinstance(table, list) else []
    pairs = [row for row in rows if isinstance(row, list) and len(row) == 2 and {*map(type, row)} <= {int, float}]
    if not rows or len(pairs) != len(rows):
        raise InputError(where, f"is {table!r:.60}", WRITE_OPENING)
    if text := wrong(pairs, deadband):
        raise InputError(where, text, WRITE_OPENING)
    points = {name: float(value) for i, pair in enumerate(pairs) for name, value in zip(names(i), pair, strict=True)}
    return {COUNT: float(len(pairs)), **points}


def points_of(known: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Points of an actuator's figures, empty if it has none."""
    count = int(known.get(COUNT, 0))
    return [(float(known.get(x, 1.0)), float(known.get(y, 1.0))) for x, y in map(names, range(count))]


@dataclass(frozen=True, slots=True, kw_only=True)
class Openings:
    """Points of n valves, as ramps.

    Attributes:
        has: (n,), 1 with points, else 0.
        travel, share: x_i and y_i (8, n), 1 behind the last point.
    """

    has: Float
    travel: Float
    share: Float


def openings(actuation: Sequence[Actuation]) -> Openings | None:
    """The points that a robot's actuators declare, None if there are none."""
    each = [points_of(a.known) for a in actuation]
    if not any(each):
        return None
    padded: Float = np.array([[*points, *[(1.0, 1.0)] * (POINTS - len(points))] for points in each])
    has = np.array([1.0 if points else 0.0 for points in each])
    return Openings(has=has, travel=padded[..., 0].T.copy(), share=padded[..., 1].T.copy())


def ramps(x: Any, start: Float, value: Float) -> Any:
    """Values (..., n) at x >= 0 of lines through points (m, n), flat behind the last one."""
    width = np.diff(start, axis=0)
    slope: Float = np.divide(np.diff(value, axis=0), width, out=np.zeros_like(width), where=width > 0.0)
    total = 0.0 * x
    for i in range(len(width)):
        total = total + slope[i] * clip(x - start[i], 0.0 * width[i], width[i])
    return total


def opened(o: Openings | None, command: Any) -> Any:
    """Opening of (1) for commands (..., n), which they are themselves for valves without points."""
    if o is None:
        return command
    x = clip(absolute(command), 0.0, 1.0)
    y = ramps(x, o.travel, o.share)
    return command + o.has * (copysign(y, command) - command)


def travel(o: Openings | None, opening: Any) -> Any:
    """Travel of (2) for openings (..., n), which they are themselves for valves without points."""
    if o is None:
        return opening
    y = clip(absolute(opening), 0.0, 1.0)
    x = ramps(y, o.share, o.travel) + o.travel[0] * tanh(y / ACROSS)
    return opening + o.has * (copysign(x, opening) - opening)


def overlap(o: Openings | None, deadband: Any) -> Any:
    """Travel (..., n) at which edges begin to open."""
    return deadband if o is None else deadband + o.has * (o.travel[0] - deadband)
