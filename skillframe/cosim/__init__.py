"""Co-simulation of mechanics and actuators over power bonds, without a robot."""

from skillframe.cosim.coupling import Coupling, coupling_numbers, require_stable
from skillframe.cosim.energy_balance import Mechanics, Motion, bond_work, relative_residual
from skillframe.cosim.master import CosimSettings, Master

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
