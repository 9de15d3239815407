r"""Does the tool go where the law wants it? Its speed and its way against the required ones, X_r' of the law.

    int |X'| dt  <=  s_1 + 2 int |X_r'| dt    over 0.1 s,      |int (X' - X_r') dt|  <=  s_2    over 0.2 s

X_r' = X_d' + D^{-1} [K (X_d - X) + f + f_ff] contains what an impedance yields to, so a tool that is held by a surface
follows. Both bounds are our choice, twice and more of what sound cranes did (docs/explanation/crane_control.md). In the
swing nothing is judged so, since friction and load are not known yet.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float, norm
from skillframe.machine.law.hydraulic import Reference
from skillframe.machine.watch.readings import Suspicion

EXCESS, MISSED = 0.05, 0.06
"""s_1 and s_2 [m]."""
FAST, SLOW = 5, 10
"""Looks that the two sums span."""


class ToolWatch:
    """Of N machines. Period: [s] between two looks."""

    def __init__(self, count: int, period: float) -> None:
        self._period, self._looks = period, 0
        self._sums: Float = np.zeros((SLOW + 1, count, 4))

    def look(self, rate: Float, error: Float, force: Float, reference: Reference) -> list[Suspicion]:
        """Judge the tool's velocity (N, 2), its error X_d - X, and the force (N, 2) that the law answers."""
        pull = (reference.stiffness @ error[..., None])[..., 0] + force + reference.push
        required = reference.velocity + _solved(reference.damping, pull)
        now, before = (self._looks % (SLOW + 1), (self._looks - 1) % (SLOW + 1))
        more = np.concatenate([rate - required, norm(rate)[:, None], norm(required)[:, None]], axis=-1)
        self._sums[now] = self._sums[before] + self._period * more
        self._looks += 1
        if self._looks <= SLOW:
            return []
        fast, slow = (self._sums[now] - self._sums[(now - span) % (SLOW + 1)] for span in (FAST, SLOW))
        rushed, missed = fast[:, 2] - 2.0 * fast[:, 3] > EXCESS, norm(slow[:, :2]) > MISSED
        if not (rushed.any() or missed.any()):
            return []
        seconds = FAST * self._period
        found = [Suspicion(int(i), False, _fast(*(fast[i, 2:] / seconds).tolist())) for i in np.flatnonzero(rushed)]
        ways = norm(slow[:, :2])
        return [
            *found,
            *(Suspicion(int(i), False, _lost(float(ways[i]), SLOW * self._period)) for i in np.flatnonzero(missed)),
        ]


def _solved(matrix: Float, vector: Float) -> Float:
    """Solutions (N, 2) of A x = b by Cramer's rule, a quarter of the time of a general solver."""
    (a, b), (c, d) = ((matrix[..., i, 0], matrix[..., i, 1]) for i in range(2))
    one, two = vector[:, 0], vector[:, 1]
    result: Float = np.stack([d * one - b * two, a * two - c * one], axis=-1) / (a * d - b * c)[..., None]
    return result


def _fast(speed: float, wanted: float) -> str:
    return f"watchdog: the tool moves at {speed:.2f} m/s, and the law wants {wanted:.2f} m/s"


def _lost(way: float, seconds: float) -> str:
    return f"watchdog: the tool is {1e3 * way:.0f} mm from where the law has wanted it in the last {seconds:.2g} s"
