r"""Steps of the bias: channels that change level within one sample although nothing touched or let go of the tool.

A contact changes a force over the time in which the tool is stopped or let go. A sensor that was tared, warmed up or
knocked steps from one sample to the next, and the motion goes on. A difference J of two neighbours has the shape of a
step if

- it is twelve times the scatter of the channel's differences, and at least 0.5 N or 0.05 Nm;
- no other difference within 50 ms (8 samples at least) on either side is above a quarter of it, so that neither a
  contact that rises over samples nor one that rings is taken for one;
- the levels before and after, medians over as long, differ by J to a quarter;
- the velocity of the tool changes no more there than it does elsewhere: three times the median change at most, of the
  point and of the attitude.

A hard contact between two samples has that shape too. What tells them apart is that a contact pushes the tool away: a
tool that goes along the new force by 10 mm has left what it touched. And one that ends brings the force back to that
of the start. So a step is told only if the force comes further from the first 50 ms' by half of J, the tool goes
there, and the force over that way and at its end is still J to a quarter, along J. Others, and steps of torques
alone, are not told from contacts. One that is told lasts until the same channels step back by as much to a quarter,
else to the end. Nothing is said below 50 Hz, where a hand pushes within one sample, or of a simulation without noise.
A touch at the end of a motion, seen at 50 Hz, or a wrench whose axes are not those of the motion, can still pass for
one: a step is told, and nothing is left out or refused by it. All of this is our choice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.faults.fault import STEP, Flaw
from skillframe.demonstration.stalls import LEAST_NOISE
from skillframe.frames import Float, norm

SIGMAS, LEAST = 12.0, np.repeat([0.5, 0.05], 3)
AROUND_S, FEWEST = 0.05, 8
ISOLATED, SAME, USUAL = 0.25, 0.25, 3.0
LEFT, LONGEST_PERIOD, GROWS = 0.01, 0.02, 0.5  # m, s, share of J
BLOCK = 4096
"""Samples that are looked at together."""
MOST = 1000
"""Differences that are looked at: a channel with more is no channel with steps."""


def steps(time: Float, pose: Float, wrench: Float, skip: NDArray[np.bool_]) -> list[Flaw]:
    """Steps of the bias.

    Args:
        time: (T,) [s].
        pose: (T, 7) position and quaternion.
        wrench: (T, 6) as the sensor gave it [N, Nm].
        skip: (T,) samples that another fault explains: at their ends nothing is a step.
    """
    period = float(np.median(np.diff(time)))
    width = max(FEWEST, round(AROUND_S / period))
    if len(time) < 4 * width or period > LONGEST_PERIOD:
        return []
    jump = np.diff(wrench, axis=0)
    second = np.median(np.abs(np.diff(jump, axis=0)), axis=0) / (0.6745 * np.sqrt(6.0))
    if not np.any(second > LEAST_NOISE):
        return []
    scatter = 1.4826 * np.median(np.abs(jump), axis=0)
    large = np.abs(jump) > np.maximum(SIGMAS * scatter, LEAST)
    large[:, np.count_nonzero(large, axis=0) > MOST] = False
    near = np.convolve(skip.astype(float), np.ones(2 * width + 1), "same") > 0.0
    rows = np.flatnonzero(np.any(large, axis=1) & ~near[1:] & ~near[:-1])
    rows = rows[(rows >= width) & (rows < len(jump) - width)]
    steady = _steady(pose, width)
    found = [(int(k), which) for k in rows[steady[rows]] if np.any(which := _stepped(jump, wrench, k, width, large[k]))]
    sure = [_outlasts_contact(pose, wrench, k, width, which) for k, which in found]
    return _lasting(time, jump, found, sure)


def _steady(pose: Float, width: int) -> NDArray[np.bool_]:
    """Whether the tool's velocity stays what it was from sample k to k + 1, (T - 1,)."""
    result = np.zeros(len(pose) - 1, dtype=bool)
    change = pose[2 * width + 1 :] - pose[width + 1 : -width] - pose[width : -width - 1] + pose[: -2 * width - 1]
    sizes = norm(change[:, :3]), norm(change[:, 3:])
    result[width:-width] = np.all([size <= USUAL * np.median(size) for size in sizes], axis=0)
    return result


def _stepped(jump: Float, wrench: Float, k: int, width: int, large: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of (6,) channels step from sample k to k + 1."""
    size = np.abs(jump[k])
    others = np.abs(np.concatenate([jump[k - width : k], jump[k + 1 : k + 1 + width]])).max(axis=0)
    before = np.median(wrench[k + 1 - width : k + 1], axis=0)
    after = np.median(wrench[k + 1 : k + 1 + width], axis=0)
    return np.asarray(large & (others <= ISOLATED * size) & (np.abs(after - before - jump[k]) <= SAME * size))


def _outlasts_contact(pose: Float, wrench: Float, k: int, width: int, which: NDArray[np.bool_]) -> bool:
    """Whether a force that was not there stays when the tool has gone along it, away from whatever it could touch."""
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
    if abs(before + size - free) < abs(before - free) + GROWS * size:
        return False
    parts = (wrench[k + 1 : end + 1, :3], wrench[max(k + 1, end - width) : end + width, :3])
    return all(abs(float(np.median(part @ along)) - before - size) <= SAME * size for part in parts)


def _first_gone(pose: Float, k: int, along: Float) -> int | None:
    """The first sample after k at which the tool is `LEFT` further along a direction (3,)."""
    for start in range(k + 1, len(pose), BLOCK):
        gone = (pose[start : start + BLOCK, :3] - pose[k, :3]) @ along > LEFT
        if gone.any():
            return start + int(np.argmax(gone))
    return None


def _lasting(time: Float, jump: Float, found: list[tuple[int, NDArray[np.bool_]]], sure: list[bool]) -> list[Flaw]:
    """Faults from steps. One that goes back ends the first, and one of the two is enough to be sure of both."""
    result: list[Flaw] = []
    used: set[int] = set()
    for i, (k, which) in enumerate(found):
        if i in used:
            continue
        stop, told = float(time[-1]), sure[i]
        for j in range(i + 1, len(found)):
            m, back = found[j]
            if np.array_equal(back, which) and norm((jump[k] + jump[m])[which]) <= SAME * norm(jump[k][which]):
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
