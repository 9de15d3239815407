r"""Virtual Decomposition Control, adaptation: bounded learning of parameters from the velocity error.

    d theta/dt = rho s  with  s = Y^T (V_r - V),    zero for a parameter that would leave its bounds

(projection function, W.-H. Zhu, "Virtual Decomposition Control", Springer 2010). Then
d/dt (theta - theta^)^2 / (2 rho) <= -(theta - theta^) s for every true theta within the bounds, as the accompanying
function requires.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.frames import Float
from skillframe_hydraulics.symbolic_or_numeric import clip


def adapt(estimate: Any, rate: Any, bounds: tuple[Any, Any], dt: Any) -> Any:
    """Parameters after a step of dt [s]. Arrays or casadi expressions (`symbolic_or_numeric`).

    From within the bounds, clipping equals setting the rate to zero. `rate` is rho s.
    """
    return clip(estimate + dt * rate, *bounds)


def relative_bounds(nominal: Float, share: float) -> tuple[Float, Float]:
    """Bounds at a share of each parameter's size around it."""
    width = share * np.abs(nominal)
    return nominal - width, nominal + width
