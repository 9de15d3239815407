"""Saturation: stretches in which a channel stays at its largest or least value, since a sensor shows no more.

Noise makes a live channel leave its extreme at once. It saturates if it stays there for five samples or more, three
times as long as nine in ten of its runs, while the rest of the wrench goes on. A sensor that resolves less than its
noise may rest at its extreme too: a stretch is none if such a channel is within twice its resolution of it before and
after (`stalls`). Stretches closer than 50 ms are one. From a second on it is a stall too. Our choice.
"""

from __future__ import annotations

import numpy as np

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.faults.fault import SATURATED, Flaw
from skillframe.demonstration.stalls import explained
from skillframe.frames import Float

SAMPLES, LEAST_RUNS, APART = 5.0, 20, 0.05


def saturated(time: Float, wrench: Float) -> list[Flaw]:
    """Stretches in which channels saturate.

    Args:
        time: (T,) [s].
        wrench: (T, 6) as the sensor gave it [N, Nm].
    """
    changes = np.concatenate([[0], np.cumsum(np.any(wrench[1:] != wrench[:-1], axis=1))])
    result: list[Flaw] = []
    for i, name in enumerate(WRENCH):
        channel = wrench[:, i]
        starts = np.concatenate([[0], np.flatnonzero(channel[1:] != channel[:-1]) + 1])
        lengths = np.diff(np.append(starts, len(channel)))
        if len(starts) < LEAST_RUNS:
            continue
        goes_on = changes[starts + lengths - 1] > changes[starts]
        least = max(SAMPLES, 3.0 * float(np.quantile(lengths, 0.9)))
        for extreme in (float(channel.max()), float(channel.min())):
            stays = np.flatnonzero((channel[starts] == extreme) & (lengths >= least) & goes_on & (extreme != 0.0))
            runs = [(int(starts[k]), int(starts[k] + lengths[k] - 1)) for k in stays]
            spans = [run for run in runs if not explained(time, channel[:, None], run)]
            result += _joined(time, spans, name, extreme)
    return result


def _joined(time: Float, spans: list[tuple[int, int]], name: str, extreme: float) -> list[Flaw]:
    result: list[Flaw] = []
    for first, last in spans:
        start, stop = float(time[first]), float(time[last])
        if result and start - result[-1].stop < APART:
            start = result.pop().start
        result.append(Flaw(SATURATED, name, start, stop, extreme))
    return result
