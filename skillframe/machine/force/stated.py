r"""The standard deviation stated of the estimated force: what the swing shows, and what the filter is late by.

    stated^2 = (s sigma)^2 + (f - f_late)^2,    s = max(1, q / 2),   q = 95 % quantile of |f_i| / sigma_i in air    (1)

W's sigma (`momentum`) holds friction that standing pistons hide and the noise of sensors, as far as these are known.
In the swing the true force is zero, so every estimate there is an error: s makes 95 % of them lie within two. A force
that has just begun is known as late as its filter lets it through. The feedback f_late is some 50 ms older, and the
difference is of the error's size (ours). The law goes by W's sigma as before: it needs to know what stiction hides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float

if TYPE_CHECKING:
    from skillframe.machine.force.momentum import Estimate

__all__ = ["StatedSigma"]

FROM_S, EVERY_S, COVERED = 2.5, 0.01, 0.95
"""Rows of the swing that count: from when friction and load are known well enough, so often; what share is covered."""


class StatedSigma:
    """Equation (1) for N machines.

    Args:
        count: N.
        dt: sample time [s].

    Attributes:
        scale: (N,) s; 1 before the swing is over.
    """

    def __init__(self, count: int, dt: float) -> None:
        self._from, self._every = round(FROM_S / dt), max(1, round(EVERY_S / dt))
        self.scale: Float = np.ones(count)
        self._rows: list[Float] = []

    def show(self, tick: int, estimate: Estimate) -> None:
        """Take in an estimate of the swing, where the true force is zero."""
        if tick >= self._from and tick % self._every == 0:
            self._rows.append(np.abs(estimate.force) / estimate.sigma)

    def hold(self) -> None:
        """The swing is over: find the scale."""
        if self._rows:
            seen = np.array(self._rows)
            every = np.moveaxis(seen, 1, 0).reshape(seen.shape[1], -1)
            self.scale = np.maximum(1.0, 0.5 * np.quantile(every, COVERED, axis=1))
        self._rows = []

    def stated(self, estimate: Estimate) -> Float:
        """(N, 2) [N]."""
        late = estimate.force - estimate.feedback
        return np.hypot(self.scale[:, None] * estimate.sigma, late)
