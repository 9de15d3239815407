r"""Warnings when force and torque contradict the orientation, or contain a weight that was tared away.

- **Quaternion order.** A tool that touches with one fixed point r has \(T = b + (R r) \times F\). The order as read is
  doubted if its residual is 1.3 times that of the other order, also in four of five parts of the contact, and if a
  point fixed in base axes fits as badly (else the better fit only means less rotation).
- **Tared weight.** A sensor set to zero in orientation \(R_0\) reads \(m (g - R R_0^T g)\) in base axes. A warning
  follows if this explains two thirds of the force in some part from the start that turns by 20 degrees.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.demonstration import LEVEL_TIME, Demonstration
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate, rotation_vector
from skillframe_recordings.thresholds import AUDIT

SAMPLES, PARTS = 600, 5
"""Most compared samples, and parts of the contact, of which four must agree."""


def w_first(d: Demonstration) -> Iterator[str]:
    """Warn about a quaternion whose other order makes the torques those of one point of the tool."""
    if d.meta.get("quaternion") is not None or turned(d.pose.rotation) < AUDIT.point_turn_rad:
        return
    strength = norm(d.wrench[:, :3])
    rows = np.flatnonzero(strength > max(AUDIT.contact_n, 0.2 * float(np.quantile(strength, 0.95))))
    if len(rows) < 4 * PARTS:
        return
    rows = rows[np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).round().astype(int)]
    torque = d.wrench[rows, 3:]
    if rms(torque - torque.mean(axis=0)) < AUDIT.torque_nm:
        return
    ours = point_residual(d.wrench[rows], d.pose.rotation[rows])
    theirs = point_residual(d.wrench[rows], matrix_from_quaternion(d.quaternion[rows][:, [1, 2, 3, 0]]))
    still = point_residual(d.wrench[rows], np.broadcast_to(np.eye(3), (len(rows), 3, 3)))
    parts = zip(np.array_split(ours, PARTS), np.array_split(theirs, PARTS), strict=True)
    better = sum(rms(a) > rms(b) for a, b in parts)
    if min(rms(ours), rms(still)) > AUDIT.order_ratio * rms(theirs) and better >= PARTS - 1:
        yield (
            f"quaternion: read w-first, forces at one point of the tool explain the torques to {rms(theirs):.3g} Nm, "
            f"as it was read only to {rms(ours):.3g} Nm: the values may be w-first; say the order with --set columns"
        )


def tared(d: Demonstration) -> Iterator[str]:
    """Warn about a weight in a wrench that was set to zero in the first orientation."""
    if d.meta.get("wrench", {}).get("includes_tool_weight"):
        return
    start = d.time <= d.time[0] + LEVEL_TIME
    level, home = d.wrench[start, :3].mean(axis=0), d.pose.rotation[start].mean(axis=0)
    for share in (0.1, 0.25, 0.5, 0.75, 1.0):
        count = max(2, round(share * len(d)))
        rows = np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).round().astype(int))
        rotation, force = d.pose.rotation[rows], d.wrench[rows, :3] - level
        if turned(rotation) < AUDIT.tared_turn_rad:
            continue
        design = (home - rotation) @ rotation[0].T  # relative to the same start as the force
        weight, left = robust(rotate(design, np.broadcast_to([0.0, 0.0, -1.0], force.shape)), force)
        there = float(np.median(norm(force)))
        if weight > AUDIT.tared_n and left < AUDIT.tared_left * there:
            yield (
                f"weight: {weight:.1f} N ({weight / 9.81:.2f} kg) of a tool explain the force of the first "
                f"{d.time[count - 1] - d.time[0]:.1f} s to {left:.2f} of {there:.2f} N, if the sensor was set to zero "
                "in the first orientation; take it off with `skillframe calibrate` (--set calibration)"
            )
            return


def turned(rotation: Float) -> float:
    """Return the largest angle from the first orientation (T, 3, 3) [rad]."""
    return float(norm(rotation_vector(rotation[0].T @ rotation)).max())


def rms(values: Float) -> float:
    """Return the root mean square of all numbers."""
    return float(np.sqrt(np.mean(values**2)))


def point_residual(wrench: Float, rotation: Float) -> Float:
    """Return the torques (T, 3) of wrenches (T, 6) that the best point of the tool and a constant leave."""
    force, zero = wrench[:, :3], np.zeros(len(wrench))
    x, y, z = force.T
    across = np.stack([np.stack(row, -1) for row in ((zero, z, -y), (-z, zero, x), (y, -x, zero))], -2)
    design = np.concatenate([across @ rotation, np.broadcast_to(np.eye(3), across.shape)], axis=-1)
    solution = np.linalg.lstsq(design.reshape(-1, 6), wrench[:, 3:].ravel(), rcond=1e-6)[0]
    result: Float = wrench[:, 3:] - design @ solution
    return result


def robust(direction: Float, force: Float) -> tuple[float, float]:
    """Return m by least absolute residuals for forces (T, 3) = m direction (T, 3), and the median residual [N]."""
    weight, size = np.ones(len(force)), 0.0
    residual = norm(force)
    for _ in range(12):
        squares = float((weight[:, None] * direction**2).sum())
        size = float((weight[:, None] * direction * force).sum()) / squares if squares > 0.0 else 0.0
        residual = norm(force - size * direction)
        weight = 1.0 / np.maximum(residual, 1e-3 + 0.1 * np.median(residual))
    return size, float(np.median(residual))
