r"""What force and torque say against the attitude, and of a weight that was tared away: sentences, never refusals.

- **One point of the tool.** Where a tool touches with one point r of its own, \(T = b + (R r) \times F\). Both orders
  of a quaternion are fitted to the contact. The one that was read is doubted if it leaves 1.2 times as much of the
  torque as the other, and more in four of five parts of the contact. An order is a turn of the whole curve, so that
  the motion alone tells nothing of it.
- **A tared weight.** A sensor that was set to zero in attitude \(R_0\) reads \(m (g - R R_0^T g)\) in base axes: one
  number, in a direction that the attitude gives. It is told if it explains the force of the first tenth, quarter, half,
  three quarters or all of a recording that turned by 20 degrees or more there, to a third.

Thresholds are our choice.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate, rotation_vector

SAMPLES, PARTS, LEAST_PARTS, ROUNDS = 600, 5, 4, 12
LEAST_TORQUE, LEAST_FORCE, WORSE = 0.02, 1.0, 1.2
POINT_TURN, TARED_TURN = np.deg2rad(10.0), np.deg2rad(20.0)
SHARES, TARED_LEFT = (0.1, 0.25, 0.5, 0.75, 1.0), 1.0 / 3.0
LEAST_WEIGHT, LEVEL_TIME = 1.0, 0.25  # N, s
DOWN = np.array([0.0, 0.0, -1.0])


def w_first(d: Demonstration) -> Iterator[str]:
    """A quaternion whose other order makes the torques those of one point of the tool."""
    if d.meta.get("quaternion") is not None or turned(d.pose.rotation) < POINT_TURN:
        return
    strength = norm(d.wrench[:, :3])
    rows = np.flatnonzero(strength > max(LEAST_FORCE, 0.2 * float(np.quantile(strength, 0.95))))
    if len(rows) < 4 * PARTS:
        return
    rows = rows[np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).round().astype(int)]
    torque = d.wrench[rows, 3:]
    if rms(torque - torque.mean(axis=0)) < LEAST_TORQUE:
        return
    ours = point_residual(d.wrench[rows], d.pose.rotation[rows])
    theirs = point_residual(d.wrench[rows], matrix_from_quaternion(d.quaternion[rows][:, [1, 2, 3, 0]]))
    parts = zip(np.array_split(ours, PARTS), np.array_split(theirs, PARTS), strict=True)
    better = sum(rms(a) > rms(b) for a, b in parts)
    if rms(ours) > WORSE * rms(theirs) and better >= LEAST_PARTS:
        yield (
            f"quaternion: read w-first, forces at one point of the tool explain the torques to {rms(theirs):.3f} Nm, "
            f"as it was read only to {rms(ours):.3f} Nm: the values may be w-first; say the order with --columns"
        )


def tared(d: Demonstration) -> Iterator[str]:
    """A weight in a wrench that was set to zero in the first attitude."""
    if d.meta.get("wrench", {}).get("includes_tool_weight"):
        return
    start = d.time <= d.time[0] + LEVEL_TIME
    level, home = d.wrench[start, :3].mean(axis=0), d.pose.rotation[start].mean(axis=0)
    for share in SHARES:
        count = max(2, round(share * len(d)))
        rows = np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).round().astype(int))
        rotation, force = d.pose.rotation[rows], d.wrench[rows, :3] - level
        if turned(rotation) < TARED_TURN:
            continue
        design = (home - rotation) @ rotation[0].T  # against the same start as the force
        weight, left = robust(rotate(design, np.broadcast_to(DOWN, force.shape)), force)
        there = float(np.median(norm(force)))
        if weight > LEAST_WEIGHT and left < TARED_LEFT * there:
            yield (
                f"weight: {weight:.1f} N ({weight / 9.81:.2f} kg) of a tool explain the force of the first "
                f"{d.time[count - 1] - d.time[0]:.1f} s to {left:.2f} of {there:.2f} N, if the sensor was set to zero "
                "in the first attitude; take it off with `skillframe calibrate` (--calibration)"
            )
            return


def turned(rotation: Float) -> float:
    """Largest angle from the first attitude (T, 3, 3) [rad]."""
    return float(norm(rotation_vector(rotation[0].T @ rotation)).max())


def rms(values: Float) -> float:
    """Root mean square of all numbers."""
    return float(np.sqrt(np.mean(values**2)))


def point_residual(wrench: Float, rotation: Float) -> Float:
    """What the best one point of the tool and a constant leave of the torques (T, 3) of wrenches (T, 6)."""
    force, zero = wrench[:, :3], np.zeros(len(wrench))
    x, y, z = force.T
    across = np.stack([np.stack(row, -1) for row in ((zero, z, -y), (-z, zero, x), (y, -x, zero))], -2)
    design = np.concatenate([across @ rotation, np.broadcast_to(np.eye(3), across.shape)], axis=-1)
    solution = np.linalg.lstsq(design.reshape(-1, 6), wrench[:, 3:].ravel(), rcond=1e-6)[0]
    result: Float = wrench[:, 3:] - design @ solution
    return result


def robust(direction: Float, force: Float) -> tuple[float, float]:
    """The m of forces (T, 3) that are m times a direction (T, 3), by least absolute residuals, and their median [N]."""
    weight, size = np.ones(len(force)), 0.0
    residual = norm(force)
    for _ in range(ROUNDS):
        squares = float((weight[:, None] * direction**2).sum())
        size = float((weight[:, None] * direction * force).sum()) / squares if squares > 0.0 else 0.0
        residual = norm(force - size * direction)
        weight = 1.0 / np.maximum(residual, 1e-3 + 0.1 * np.median(residual))
    return size, float(np.median(residual))
