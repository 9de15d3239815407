"""What demonstrations must have in common before anything is learned from them, and what each must hold: one check."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.demonstration.faults.find import refuse_faults
from skillframe.demonstration.metafile import point_of
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import norm

SAME_POINT_M = 1e-6


def refuse_unfit(demonstrations: Sequence[Demonstration]) -> None:
    """Refuse demonstrations that no learner may take: of different tools, or with a stretch that is not what happened.

    Raises:
        InputError: with the file, and what is wrong with it.
    """
    if len(demonstrations) > 1:
        common_frames(demonstrations)
    for demonstration in demonstrations:
        refuse_faults(demonstration)


def common_frames(demonstrations: Sequence[Demonstration]) -> dict[str, list[float]]:
    """Named points of the tool [m], which all demonstrations must share to the micrometre.

    Raises:
        InputError: no demonstration, or two of different tools.
    """
    if not demonstrations:
        raise InputError("learn", "no demonstration given", "name at least one file")
    frames: dict[str, list[float]] = {}
    for demonstration in demonstrations:
        for name, point in demonstration.meta.get("frames", {}).items():
            values = point_of(point, f"{demonstration.source or 'demonstration'}: frames.{name}")
            if norm(np.subtract(values, frames.setdefault(name, values))) > SAME_POINT_M:
                raise InputError(
                    demonstration.source or "demonstration",
                    f"has its point {name!r} at {values}, another demonstration at {frames[name]}",
                    "learn from demonstrations of one tool",
                )
    return frames
