r"""Open-centre valves: a pump's flow returns through the centre edges of all its valves, which shut as spools open.

For the n valves of a line, with spools x_i as shares of their travel and p_R the return pressure,

    q_C = c_C e(p_S - p_R),    1/c_C^2 = sum 1/c_i^2,    c_i = sqrt(n) c_0 o(x_i),    o(x) = max(1 - |x|/x_C, 0),    (1)

the flow of orifices in series (H. E. Merritt, Hydraulic Control Systems, 1967, section 3), whose drops add up. e is the
root of the drop, linear below 1 bar, as of the valves' other edges. c_0 passes the pump's flow at the declared drop
with all spools in their middle. Equal centre edges and the linear o are our choice; x_C is 1 by default. The edges to
the actuators are in parallel, and each has a load check valve.
"""

from __future__ import annotations

from typing import Any

from skillframe_hydraulics.cylinder.equations import edge_flow, edge_slope
from skillframe_hydraulics.symbolic_or_numeric import absolute, maximum, sqrt

TRANSITION: Any = 1e5
"""Drop below which e is linear [Pa]."""
SHUT = 1e-6
"""Least o, so that (1) has no pole."""


def conductance(flow: Any, drop: Any) -> Any:
    """c_0 [m3/(s sqrt(Pa))] of a pump's flow [m3/s] and its drop with all spools in their middle [Pa]."""
    return flow / edge_flow(drop, TRANSITION)


def narrowed(spool: Any, shut_at: Any) -> Any:
    """(1/o)^2 of a spool."""
    opened = maximum(1.0 - absolute(spool) / shut_at, SHUT)
    return 1.0 / (opened * opened)


def bypass(centre: Any, narrowing: Any, drop: Any) -> tuple[Any, Any]:
    """q_C [m3/s] and its slope [m3/(s Pa)] for c_0, the mean of `narrowed` over the valves, and p_S - p_R."""
    passes = centre / sqrt(narrowing)
    return passes * edge_flow(drop, TRANSITION), passes * edge_slope(drop, TRANSITION)
