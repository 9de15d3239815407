"""Saturation: stretches in which a channel stays at the end of its sensor's range.

A channel saturates if it stays at its extreme for five samples or more, three times the 90 % quantile of its runs,
while the other channels of the force, or of the torque, change. Excluded are

- a smooth force of coarse resolution: noise no larger than the resolution, or a channel within twice the resolution of
  its extreme before and after (`stalls`);
- a channel inside the range: another of the same sensor goes further.

Stretches closer than 50 ms are joined.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.faults.fault import SATURATED, Flaw
from skillframe.demonstration.stalls import explained, resolution, white_noise
from skillframe.frames import Float


def saturated(time: Float, wrench: Float) -> list[Flaw]:
    """Stretches in which channels saturate, from time (T,) [s] and measured wrench (T, 6) [N, Nm]."""
    result: list[Flaw] = []
    fresh = np.flatnonzero(np.diff(_changes(wrench), prepend=-1))
    for i, name in enumerate(WRENCH):
        channel, sensor = wrench[:, i], slice(i - i % 3, i - i % 3 + 3)
        starts = np.concatenate([[0], np.flatnonzero(channel[1:] != channel[:-1]) + 1])
        lengths = np.diff(np.append(starts, len(channel)))
        new = channel[fresh]
        inner = new[(new > new.min()) & (new < new.max())]
        if len(starts) < 20 or not white_noise(inner) > resolution(new):  # its noise stays within its resolution
            continue
        goes_on = _changes(wrench[:, sensor])
        goes_on = goes_on[starts + lengths - 1] > goes_on[starts]
        least = max(5.0, 3.0 * float(np.quantile(lengths, 0.9)))
        furthest = float(np.abs(wrench[:, sensor]).max())
        for extreme in (float(channel.max()), float(channel.min())):
            if abs(extreme) < furthest:
                continue
            stays = np.flatnonzero((channel[starts] == extreme) & (lengths >= least) & goes_on & (extreme != 0.0))
            runs = [(int(starts[k]), int(starts[k] + lengths[k] - 1)) for k in stays]
            spans = [run for run in runs if not explained(time, channel[:, None], run)]
            result += _joined(time, spans, name, extreme)
    return result


def _changes(values: Float) -> NDArray[np.intp]:
    return np.concatenate([[0], np.cumsum(np.any(values[1:] != values[:-1], axis=1))])


def _joined(time: Float, spans: list[tuple[int, int]], name: str, extreme: float) -> list[Flaw]:
    result: list[Flaw] = []
    for first, last in spans:
        start, stop = float(time[first]), float(time[last])
        if result and start - result[-1].stop < 0.05:
            start = result.pop().start
        result.append(Flaw(SATURATED, name, start, stop, extreme))
    return result
