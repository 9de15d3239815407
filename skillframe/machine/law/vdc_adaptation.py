r"""Virtual Decomposition Control, adaptation: parameters learn from the velocity error, within bounds.

    d theta/dt = rho s  with  s = Y^T (V_r - V),    set to zero for a parameter that would leave its bounds

(projection function, W.-H. Zhu, "Virtual Decomposition Control", Springer 2010). Then
d/dt (theta - theta^)^2 / (2 rho) <= -(theta - theta^) s for every true theta within the bounds, which is what the
accompanying function needs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.either import clip
from skillframe.frames import Float


def adapt(estimate: Any, rate: Any, bounds: tuple[Any, Any], dt: Any) -> Any:
    """Parameters after a step of dt [s]. Arrays or casadi expressions (`either`).

    From within the bounds, to clip says the same as to set the rate to zero at them first.

    Args:
        estimate: parameters (...).
        rate: rho s of each.
        bounds: lower and upper, of each.
        dt: [s].
    """
    return clip(estimate + dt * rate, *bounds)


def relative_bounds(nominal: Float, share: float) -> tuple[Float, Float]:
    """Bounds that lie a share of each parameter's size to both sides of it."""
    width = share * np.abs(nominal)
    return nominal - width, nominal + width
