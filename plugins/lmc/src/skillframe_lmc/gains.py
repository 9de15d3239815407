r"""Stiffness and damping of a part: \(K = Q\,\mathrm{diag}\,Q^T\), zero on compliant axes, k elsewhere.

With orthonormal compliant axes u this is k (I - sum u u^T). The damping in the file is the critical damping of a
nominal tool, 2 sqrt(m k), with a floor that compliant axes get too; at run time the controller designs it from the
true task-space inertia instead. Zero stiffness on compliant axes is the papers'; the values of k, m and the floor are
ours.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float


def gains(axes: Float, fully_compliant: bool, k: float, inertia: float, floor: float) -> tuple[Float, Float]:
    """Stiffness (3, 3) and damping (3, 3) for compliant axes (d, 3).

    Args:
        axes: orthonormal rows.
        fully_compliant: no stiffness at all.
        k: stiffness elsewhere [N/m or Nm/rad].
        inertia: nominal mass [kg] or moment of inertia [kg m^2].
        floor: least damping [Ns/m or Nms/rad].
    """
    stiff = np.zeros((3, 3)) if fully_compliant else np.eye(3) - axes.T @ axes
    return k * stiff, floor * np.eye(3) + (max(2.0 * np.sqrt(inertia * k), floor) - floor) * stiff
