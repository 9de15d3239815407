"""Baseline segmenter: cuts where the tool rests or contact force changes (zero-velocity crossing).

    cut at the middle of a stop:  |v| < 0.15 v_r  and  |w| < 0.15 w_r,  for three windows or more
    cut where |F| crosses the force threshold, if one is given

Speeds of windows of 50 ms are smoothed over five; v_r and w_r are of `features`. Every interval is a phase of its own,
since the rule cannot recognise one that recurs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.config import build
from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import norm
from skillframe_segmenter import runs
from skillframe_segmenter.features import typical_speeds
from skillframe_segmenter.segmentation import rows_of, successors
from skillframe_segmenter.windows import Windows, cut_all

SHORTEST = 3  # windows


@dataclass(frozen=True, slots=True, kw_only=True)
class ZvcSettings:
    """Settings of the baseline.

    Attributes:
        still: share of the 80th percentile of speed below which the tool stands still.
        force_n: contact force at which it cuts as well [N]; 0: never.
        axes, at: as for the other segmenters.
    """

    still: float = 0.15
    force_n: float = 0.0
    axes: str = "base"
    at: str | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.still < 1.0 or self.force_n < 0.0:
            raise InputError("--set", "still is within 0 and 1, force_n not negative", "fix it")


def fit(demonstrations: Sequence[Demonstration], phases: int | None, settings: Mapping[str, Any]) -> Document:
    """`phase_model` and `demonstrations` of a policy file (see `SegmenterType.fit`)."""
    chosen = build(ZvcSettings, settings, "--set")
    cut, point = cut_all(demonstrations, chosen.at, chosen.axes)
    labels = [_labels(w, chosen, phases) for w in cut]
    rows = rows_of(cut, labels, [d.source for d in demonstrations])
    count = max(int(each.max()) for each in labels) + 1
    model = {
        "type": "zvc", "version": 1, "at": point.tolist(), "axes": chosen.axes, "still": chosen.still,
        "force_n": chosen.force_n, "successors": successors(labels, count).tolist(),
    }  # fmt: skip
    return {"phase_model": model, "demonstrations": rows}


def _labels(cut: Windows, settings: ZvcSettings, phases: int | None) -> NDArray[np.intp]:
    at = _stops(cut, settings.still)
    if settings.force_n > 0.0:
        loud = (norm(cut.wrench[:, :3]) > settings.force_n).astype(np.intp)
        at += [int(i) for i in runs.starts_of_runs(runs.without_short(loud, SHORTEST))[1:]]
    at = sorted(set(at))
    if phases is not None:
        strength, width = dict[int, float](), 6  # change of the mean motion over six windows
        for i in at:
            before, after = cut.motion[max(i - width, 0) : i], cut.motion[i : i + width]
            moved = len(before) and len(after)
            strength[i] = float(norm(before.mean(axis=0) - after.mean(axis=0))) if moved else 0.0
        at = sorted(sorted(at, key=lambda i: -strength[i])[: phases - 1])
    labels = np.zeros(cut.size, dtype=np.intp)
    for i in at:
        labels[i:] += 1
    return labels


def _stops(cut: Windows, share: float) -> list[int]:
    typical = typical_speeds([cut], cut)
    padded = [np.pad(norm(cut.motion[:, part]), 2, mode="edge") for part in (slice(0, 3), slice(3, 6))]
    speeds = [np.convolve(each, np.ones(5) / 5, mode="valid") for each in padded]  # over five windows
    still = (speeds[0] < share * typical[0]) & (speeds[1] < share * typical[1])
    starts = runs.starts_of_runs(still.astype(np.intp))
    ends = np.append(starts[1:], cut.size)
    return [
        int(a + b) // 2 for a, b in zip(starts, ends, strict=True)
        if still[a] and b - a >= SHORTEST and a > 0 and b < cut.size
    ]  # fmt: skip
