r"""Steps of the bias: channels that change level within one sample without a contact.

A sensor that is tared or knocked steps from one sample to the next, and the motion goes on. A difference J of two
neighbours has the shape of a step if

- it is twelve times the scatter of the channel's differences, and at least 0.5 N or 0.05 Nm;
- no other difference within 50 ms (at least 8 samples) on either side exceeds a quarter of it;
- the levels before and after, medians over as long, differ by J to a quarter;
- the tool's velocity changes there by at most three times its median change, of point and of orientation.

A hard contact has that shape too, but it pushes the tool away, and its end returns the force to that of the start. So a
step is reported only if the force moves away from that of the first 50 ms by half of J, the tool then moves 10 mm along
J, and the force over that way and at its end is still J to a quarter. A step lasts until the same channels step back by
as much, to a quarter, or to the end. Below 50 Hz and for simulations without noise, none is reported. A contact at the
end of a motion can still pass for a step, so a step refuses nothing.

Jumps of the tool point: two recordings in one, or a pose that was lost and found again.

A tool's displacement in one sample is nearly the mean of those before and after. The deviation r from that mean is
-J/2, J, -J/2 around a jump J. It is a jump if r has this shape to a third, J is at least 2 mm and ten times the 95 %
quantile of |r|, and the acceleration J/dt^2 exceeds 10 m/s^2. So is a displacement of more than 20 mm at more than 10
m/s. Only samples with a new pose count; gaps of the clock are excluded, and a pose that stood still before it is a
stall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.checks import GAP
from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.faults.fault import JUMP, STEP, Flaw
from skillframe.demonstration.stalls import LEAST_NOISE, POSE, starts
from skillframe.frames import Float, norm

BLOCK = 4096
"""Samples processed together."""


def steps(time: Float, pose: Float, wrench: Float, skip: NDArray[np.bool_]) -> list[Flaw]:
    """Steps of the bias.

    Args:
        time: (T,) [s].
        pose: (T, 7) position and quaternion.
        wrench: (T, 6) as measured [N, Nm].
        skip: (T,) samples of other faults.
    """
    period = float(np.median(np.diff(time)))
    width = max(8, round(0.05 / period))
    if len(time) < 4 * width or period > 0.02:
        return []
    jump = np.diff(wrench, axis=0)
    second = np.median(np.abs(np.diff(jump, axis=0)), axis=0) / (0.6745 * np.sqrt(6.0))
    if not np.any(second > LEAST_NOISE):
        return []
    scatter = 1.4826 * np.median(np.abs(jump), axis=0)
    large = np.abs(jump) > np.maximum(12.0 * scatter, np.repeat([0.5, 0.05], 3))
    large[:, np.count_nonzero(large, axis=0) > 1000] = False  # a channel with more has no steps
    near = np.convolve(skip.astype(float), np.ones(2 * width + 1), "same") > 0.0
    rows = np.flatnonzero(np.any(large, axis=1) & ~near[1:] & ~near[:-1])
    rows = rows[(rows >= width) & (rows < len(jump) - width)]
    steady = np.zeros(len(pose) - 1, dtype=bool)
    change = pose[2 * width + 1 :] - pose[width + 1 : -width] - pose[width : -width - 1] + pose[: -2 * width - 1]
    sizes = norm(change[:, :3]), norm(change[:, 3:])
    steady[width:-width] = np.all([size <= 3.0 * np.median(size) for size in sizes], axis=0)
    found = [(int(k), which) for k in rows[steady[rows]] if np.any(which := _stepped(jump, wrench, k, width, large[k]))]
    sure = [_outlasts_contact(pose, wrench, k, width, which) for k, which in found]
    return _lasting(time, jump, found, sure)


def _stepped(jump: Float, wrench: Float, k: int, width: int, large: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of (6,) channels step from sample k to k + 1."""
    size = np.abs(jump[k])
    others = np.abs(np.concatenate([jump[k - width : k], jump[k + 1 : k + 1 + width]])).max(axis=0)
    before = np.median(wrench[k + 1 - width : k + 1], axis=0)
    after = np.median(wrench[k + 1 : k + 1 + width], axis=0)
    return np.asarray(large & (others <= 0.25 * size) & (np.abs(after - before - jump[k]) <= 0.25 * size))


def _outlasts_contact(pose: Float, wrench: Float, k: int, width: int, which: NDArray[np.bool_]) -> bool:
    """Whether a new force persists after the tool has moved along it, away from any contact."""
    change = np.where(which[:3], wrench[k + 1, :3] - wrench[k, :3], 0.0)
    size = float(norm(change))
    if not size > 0.0:
        return False
    along = change / size
    end = _first_gone(pose, k, along)
    if end is None:
        return False
    before = float(np.median(wrench[k + 1 - width : k + 1, :3] @ along))
    free = float(np.median(wrench[:width, :3] @ along))
    if abs(before + size - free) < abs(before - free) + 0.5 * size:
        return False
    parts = (wrench[k + 1 : end + 1, :3], wrench[max(k + 1, end - width) : end + width, :3])
    return all(abs(float(np.median(part @ along)) - before - size) <= 0.25 * size for part in parts)


def _first_gone(pose: Float, k: int, along: Float) -> int | None:
    """The first sample after k at which the tool is 1 cm further along a direction (3,)."""
    for start in range(k + 1, len(pose), BLOCK):
        gone = (pose[start : start + BLOCK, :3] - pose[k, :3]) @ along > 0.01
        if gone.any():
            return start + int(np.argmax(gone))
    return None


def _lasting(time: Float, jump: Float, found: list[tuple[int, NDArray[np.bool_]]], sure: list[bool]) -> list[Flaw]:
    """Faults from steps. A step back ends the first, and confirms it if either is sure."""
    result: list[Flaw] = []
    used: set[int] = set()
    for i, (k, which) in enumerate(found):
        if i in used:
            continue
        stop, told = float(time[-1]), sure[i]
        for j in range(i + 1, len(found)):
            m, back = found[j]
            if np.array_equal(back, which) and norm((jump[k] + jump[m])[which]) <= 0.25 * norm(jump[k][which]):
                used.add(j)
                stop, told = float(time[m]), told or sure[j]
                break
        if not told:
            continue
        names = [name for name, there in zip(WRENCH, which, strict=True) if there]
        force = bool(np.any(which[:3]))
        size = norm(jump[k][:3][which[:3]]) if force else norm(jump[k][3:][which[3:]])
        sign = float(np.sign(jump[k][which][0])) if which.sum() == 1 else 1.0
        what = "wrench" if len(names) == len(WRENCH) else ", ".join(names)
        result.append(Flaw(STEP, what, float(time[k + 1]), stop, sign * float(size)))
    return result


def jumps(time: Float, pose: Float) -> list[Flaw]:
    """Jumps of the tool point, from time (T,) [s] and pose (T, 7) [m]."""
    fresh = starts(pose)
    if len(fresh) < 8:
        return []
    t, way = time[fresh], np.diff(pose[fresh, :3], axis=0)
    dt = np.diff(t)
    short = dt < GAP * float(np.median(dt))
    even = short[1:-1] & short[2:] & short[:-2]
    beyond = way[1:-1] - 0.5 * (way[2:] + way[:-2])
    size = norm(beyond)
    least = np.maximum(max(0.002, 10.0 * float(np.quantile(size, 0.95))), 10.0 * dt[1:-1] ** 2)  # 10 m/s^2
    large = np.flatnonzero((size > least) & even)
    found = {int(k) + 1: float(size[k]) for k in large if _has_the_shape(beyond, int(k), float(size[k]))}
    length = norm(way)
    found |= {int(k): float(length[k]) for k in np.flatnonzero((length > 10.0 * dt) & (length > 0.02) & short)}
    return [Flaw(JUMP, POSE, float(time[fresh[k + 1] - 1]), float(t[k + 1]), found[k]) for k in sorted(found)]


def _has_the_shape(beyond: Float, k: int, size: float) -> bool:
    """Whether the neighbours of sample k are minus half of it."""
    near = [beyond[i] for i in (k - 1, k + 1) if 0 <= i < len(beyond)]
    return all(norm(side + 0.5 * beyond[k]) < 1.0 / 3.0 * size for side in near)
