r"""Energy over a power bond: what the plant received against what the actuator gave.

Over a step the plant sees the force go linearly from F0 to F1. With the cubic Hermite interpolant of its motion,

\(W = F_0\,\Delta x + (F_1 - F_0)\,(\Delta x / 2 + H (v_1 - v_0) / 12)\),

exact for a cubic x(t) (integration by parts and the corrected trapezoidal rule). The difference to the actuator's own
work is energy that the coupling has made or lost: it falls with the square of the step in a coupling of second order,
which makes it a free monitor of convergence (after Sadjina et al., Engineering with Computers 33, 2017, who control the
step by it).
"""

from __future__ import annotations

import numpy as np

from skillframe.cosim.plant import Float


def bond_work(begin: Float, end: Float, path: Float, v0: Float, v1: Float, step: float) -> Float:
    """Work [J] of a force that goes linearly from `begin` to `end` over a path [m] with end velocities v0, v1."""
    return begin * path + (end - begin) * (0.5 * path + step / 12.0 * (v1 - v0))


def relative_residual(difference: Float, exchanged: Float) -> Float:
    """|energy made or lost| per energy exchanged, (count,), or zero where nothing was exchanged."""
    return np.abs(difference) / np.where(exchanged > 0.0, exchanged, 1.0)
