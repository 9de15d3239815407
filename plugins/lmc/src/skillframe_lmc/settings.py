"""The learner's constants, set with `learn --set NAME=VALUE`.

The papers print none of them; these were chosen on simulated valleys, humps, pegs and couplings. Those of the posterior
are beside its equations (`posterior`). Turns are measured by the way of a point 100 mm from their axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from skillframe.errors import InputError

LEVER_M = 0.1
"""Way of a point per radian [m]: half of the 150 to 200 mm from a hand to its tool's contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Constants of the learner in SI units and radians.

    Attributes:
        step_m: path between two knots, and the resolution of loops; larger for machines, which demonstrate over metres.
        moving_m, moving_rad: least excursion that counts as a motion; below it the part is held.
        force_min_n: a smaller force, or a torque smaller than it at 100 mm, counts as free of contact (raised for noisy
            sensors or large forces).
        contact_only: leave out motion without contact; for machines, whose wrench is an estimate and whose approach
            says little about the push.
        concatenated: as in the papers, all intervals vote as those of one demonstration, by pyramids.
        side_stiffness: share of the stiffness that is left across the push where no contact required compliance, of a
            tool that did not turn; 0.1 keeps 2 N within 20 mm.
        speed_max_m_s, speed_max_rad_s: caps on the demonstrated speed.
        stiffness_n_m, stiffness_nm_rad: along and about axes that are not compliant.
        lead_force_n, lead_torque_nm: largest push, as stiffness times lead of the desired over the measured pose.
        lead_force_max_n: cap on the teacher's larger push.
        stall_m: a run is done when, while pushing, nothing has moved by more than this, or turned by it at 100 mm, for
            half a second; larger for machines, which never rest fully.
    """

    step_m: float = 0.002
    moving_m: float = 0.005
    moving_rad: float = radians(2.5)
    force_min_n: float = 1.0
    contact_only: bool = False
    concatenated: bool = False
    side_stiffness: float = 0.1
    speed_max_m_s: float = 0.020
    speed_max_rad_s: float = radians(5.0)
    stiffness_n_m: float = 1000.0
    stiffness_nm_rad: float = 20.0
    lead_force_n: float = 20.0
    lead_torque_nm: float = 2.0
    lead_force_max_n: float = 1e6
    stall_m: float = 1e-4

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, bool):
                continue
            if not 0.0 < value < float("inf"):
                raise InputError(f"--set {name}", f"{value} is not a positive number", "give a positive number")
        if self.side_stiffness > 1.0:
            raise InputError("--set side_stiffness", "is a share of the stiffness, at most 1", "fix it")
        if self.lead_force_max_n < self.lead_force_n:
            raise InputError("--set lead_force_max_n", "is below lead_force_n", "give a larger one")
