r"""Stiffness and damping of a part: \(K = Q\,\mathrm{diag}\,Q^T\), zero on compliant axes, k elsewhere.

That is k (I - sum u u^T) for compliant axes u (papers). Of a tool that did not turn, the axes across the push d that no
contact required are soft: they keep a share s of k, because a motion error across a stiff axis becomes a side force on
a face, and an axis that is free drifts where nothing holds it:

    K = k (s (I - sum u u^T) + (1 - s) d d^T)

The file has the critical damping of a nominal tool, 2 sqrt(m k), and a floor for compliant axes; at run time the
controller uses the true task-space inertia.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float


class Nominal(NamedTuple):
    """Nominal tool: mass [kg] or moment of inertia [kg m^2], and least damping [Ns/m or Nms/rad]."""

    inertia: float
    floor: float


TRANSLATION, ROTATION = Nominal(2.6, 20.0), Nominal(0.05, 0.3)


def gains(axes: Float, k: float, tool: Nominal, push: Float | None = None, share: float = 1.0) -> tuple[Float, Float]:
    """Stiffness (3, 3) and damping (3, 3) for compliant axes (d, 3).

    Args:
        axes: orthonormal rows.
        k: stiffness elsewhere [N/m or Nm/rad].
        tool: nominal.
        push: (3,) unit vector square to the axes, or None.
        share: of k, that is left square to a push and to the axes.
    """
    stiff = np.eye(3) - axes.T @ axes
    if push is not None:
        stiff = share * stiff + (1.0 - share) * np.outer(push, push)
    critical = max(2.0 * np.sqrt(tool.inertia * k), tool.floor)
    return k * stiff, tool.floor * np.eye(3) + (critical - tool.floor) * stiff
