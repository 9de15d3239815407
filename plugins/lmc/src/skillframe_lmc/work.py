r"""Work of environment and teacher: a part is fully compliant if the environment did more.

    W = F_m . dx   (translation),    W = T_m . dbeta   (rotation, T_m at the grip)          (3) of the overview paper

F_m and T_m are the environment's, so the teacher's work is negative. The environment's share must exceed one half
significantly (95 % one-sided for independent signs, as an unsteady alignment has a share near one half),

    W+ - W- > 1.64 sqrt(sum_k W_k^2).

Intervals without contact, or with a load within 5 degrees of perpendicular to the motion, do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.frames import norm
from skillframe_lmc.intervals import Motion

SQUARE = 0.087  # sin 5 degrees
CERTAIN = 1.64  # standard errors, 95 % one-sided


class Work(NamedTuple):
    """Work [J] of the intervals that count, both positive, and the root of their sum of squares."""

    teacher: float
    environment: float
    scatter: float

    @property
    def fraction(self) -> float:
        """The environment's share, or 0 where no work counts."""
        total = self.teacher + self.environment
        return self.environment / total if total > 0.0 else 0.0

    @property
    def environment_drove(self) -> bool:
        """Whether the environment did significantly more."""
        return self.environment - self.teacher > CERTAIN * self.scatter


def work(motions: Sequence[Motion]) -> Work:
    """Work of both sides over all demonstrations of one part."""
    done = np.concatenate([m.work[_counts(m)] for m in motions])
    return Work(float(np.abs(done[done < 0.0]).sum()), float(done[done > 0.0].sum()), float(norm(done)))


def _counts(motion: Motion) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    load = norm(motion.load)
    result: np.ndarray[tuple[int], np.dtype[np.bool_]] = (load >= motion.load_min) & (
        np.abs(motion.work) > SQUARE * load * norm(motion.displacement)
    )
    return result
