"""Co-simulation of mechanics and actuators over power bonds. It needs no robot.

`Master` couples `Mechanics` (forces in, motion out) with a bank of actuators (motion in, forces out),
`coupling_numbers` and `require_stable` say beforehand whether a step is small enough.
"""

from skillframe.cosim.bond import bond_work, relative_residual
from skillframe.cosim.coupling import Coupling, coupling_numbers, require_stable
from skillframe.cosim.master import CosimSettings, Master
from skillframe.cosim.plant import Mechanics, Motion

__all__ = [
    "CosimSettings",
    "Coupling",
    "Master",
    "Mechanics",
    "Motion",
    "bond_work",
    "coupling_numbers",
    "relative_residual",
    "require_stable",
]
