r"""Who moved the tool: three degrees of freedom are compliant if the environment did more work than the teacher.

    W = F_m . dx   (translation),    W = T_m . dbeta   (rotation, T_m at the hand)          (3) of the overview paper

F_m and T_m are the environment's, so positive work is the environment's and negative work the teacher's. Sliding with
friction always takes work from the teacher; levering a peg round an edge drives the wrist. The part is fully compliant
if the environment's share exceeds one half by more than chance makes of even shares (ours),

    W+ - W- > 1.64 sqrt(sum_k W_k^2),

95 % one-sided for intervals whose signs are independent: a shaky alignment turns to and fro and ends with a share
anywhere near one half, while levering has a share of one. Intervals without contact, and those whose load is within 5
degrees of square to the motion, have work that is noise and do not count (ours).
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
    """Work over the intervals that count, in joules, both positive, and the root of their sum of squares."""

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
        """The environment did more, by more than chance makes of even shares."""
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
