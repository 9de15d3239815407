"""What sound recordings show of clock, axes, sign and order: `python -m tests.figures.untold`.

A fault of the whole can be told only if a figure of the right reading differs from that of the wrong one in the same
way on every recording. Each row is a sound recording: no seeds. Nothing here is an alarm.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from skillframe_recordings.lateness import RATE, SPAN, lateness_shares
from skillframe_recordings.orientation_doubts import point_residual, rms, turned

from skillframe.demonstration.checks import work_cosine
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate
from tests.figures.recorded import recordings

STEP, LEAST_STEP = 0.05, 2e-4  # s, m: directions of motion
LEAST_FORCE, STRONG = 1.0, 0.2  # N, share of the 95 % quantile: contact, as `orientation_doubts` takes it


class Shown(NamedTuple):
    """Figures of one sound recording.

    Attributes:
        turned_deg: largest angle from the first attitude.
        order_torque: torque that one point of the tool leaves, quaternion read wrongly over rightly.
        order_motion: share of the direction of motion along one axis of the tool, right less wrong.
        frame_torque: torque that one point leaves, of the tool over one fixed in base axes.
        work_base, work_tool: work over |F||dx|, wrench read rightly, and in tool axes read as in base axes.
        late_s, late_height: where the motion explains the force best, and how much more than at the median shift.
    """

    turned_deg: float
    order_torque: float
    order_motion: float
    frame_torque: float
    work_base: float
    work_tool: float
    late_s: float
    late_height: float


def shown(d: Demonstration) -> Shown:
    """The figures of one recording."""
    strength, stride = norm(d.wrench[:, :3]), max(1, round(STEP * d.rate))
    rows = np.arange(0, len(d) - stride, stride)
    rows = rows[strength[rows] > max(LEAST_FORCE, STRONG * float(np.quantile(strength, 0.95)))]
    right, wrong = (matrix_from_quaternion(d.quaternion[rows][:, order]) for order in ([0, 1, 2, 3], [3, 0, 1, 2]))
    still = np.broadcast_to(np.eye(3), right.shape)
    left = [rms(point_residual(d.wrench[rows], attitude)) for attitude in (right, wrong, still)]
    way = d.position[rows + stride] - d.position[rows]
    moves = norm(way) > LEAST_STEP
    along = [_along_one_axis(attitude[moves], way[moves]) for attitude in (right, wrong)]
    force, rotation = d.wrench[:, :3], d.pose.rotation
    misread = rotate(np.swapaxes(rotation, -1, -2), force)
    share = lateness_shares(d)
    best = int(np.argmax(share))
    return Shown(
        float(np.degrees(turned(rotation))), left[1] / left[0], along[0] - along[1], left[0] / left[2],
        work_cosine(d.position, force, d.time)[0], work_cosine(d.position, misread, d.time)[0],
        (best - SPAN) / RATE, float(share[best] - np.median(share)),
    )  # fmt: skip


def _along_one_axis(attitude: Float, way: Float) -> float:
    """Largest eigenvalue of the mean of u u^T, u the direction in tool axes: 1 for one axis, 1/3 for none."""
    u = rotate(np.swapaxes(attitude, -1, -2), way / norm(way)[:, None])
    return float(np.linalg.eigvalsh(u.T @ u / len(u))[-1])


def main() -> None:
    """Print the table."""
    print("| recording | " + " | ".join(Shown._fields) + " |")
    for name, d in recordings().items():
        figures = shown(d)
        print(
            f"| {name} | {figures.turned_deg:.0f} | " + " | ".join(f"{v:.2f}" for v in figures[1:]) + " |", flush=True
        )


if __name__ == "__main__":
    main()
