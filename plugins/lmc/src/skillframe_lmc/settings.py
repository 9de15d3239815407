"""The learner's constants, all changeable with `learn --set NAME=VALUE`.

None of them is printed in the papers. They are our choice: the estimator's were tuned on simulated valleys, pegs and
couplings, the speeds and gains are what ran well there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from skillframe.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the learner uses, in SI units and radians.

    Attributes:
        step_m, step_rad: path between two knots; half of `step_m` where the whole path is under 20 mm.
        moving_m, moving_rad: least excursion from the start that counts as a motion; below it the part is held.
        force_min_n, torque_min_nm: below it an interval counts as free of contact (raised where the sensor is noisy or
            the forces of the recording are large).
        contact_only: leave out the motion before the tool touches and between touches; for machines, whose wrench is
            only an estimate and whose approach says little about the push.
        contact_modes: count contact modes for the translation, whatever the time that each was slid on; false weighs by
            intervals, demonstration by demonstration.
        expected: where contact modes decide, take the push to be expected from all groups of intervals; false takes the
            deepest.
        faces: give way in translation where faces turned a quarter of the push aside; false goes by the motion alone.
        concatenated: the papers' way of taking several demonstrations together, without what we put in its place: all
            intervals vote as those of one demonstration. No contact modes, no heading of the demonstrations, no second
            vote of the contact alone.
        quantile: share of a demonstration's intervals that must accept a direction; the rest may be outliers.
        pyramid_min_rad, pyramid_max_rad: least half-opening of the pyramids, and the largest at which a direction is
            still said to exist.
        slack: directions are chosen among those accepted at this multiple of the half-opening that was needed.
        straightness_rad: how far a person's mean rotation axis strays; the noise of the compliant-axes criterion.
        straightness_m: path over which a person's wandering averages out (30 mm/s x 0.5 s), the same for translations.
        speed_max_m_s, speed_max_rad_s: caps on the demonstrated speed.
        stiffness_n_m, stiffness_nm_rad: along and about axes that are not compliant.
        lead_force_n, lead_torque_nm: largest push, as stiffness times lead of the desired over the measured pose.
        lead_force_max_n: the teacher's push, where it was larger, is taken over up to this.
        stall_m, stall_rad: a run is done when, while pushing, nothing has moved by more than this for half a second;
            larger for machines, which never stand quite still.
        mass_kg, inertia_kg_m2: nominal tool, for the damping written into the file.
        damping_min_ns_m, damping_min_nms_rad: least damping, which is what compliant axes get.
    """

    step_m: float = 0.002
    step_rad: float = radians(1.0)
    moving_m: float = 0.005
    moving_rad: float = radians(2.5)
    force_min_n: float = 1.0
    torque_min_nm: float = 0.08
    contact_only: bool = False
    contact_modes: bool = True
    expected: bool = True
    faces: bool = True
    concatenated: bool = False
    quantile: float = 0.8
    pyramid_min_rad: float = radians(8.0)
    pyramid_max_rad: float = radians(25.0)
    slack: float = 1.25
    straightness_rad: float = 0.12
    straightness_m: float = 0.015
    speed_max_m_s: float = 0.020
    speed_max_rad_s: float = radians(5.0)
    stiffness_n_m: float = 1000.0
    stiffness_nm_rad: float = 20.0
    lead_force_n: float = 20.0
    lead_torque_nm: float = 2.0
    lead_force_max_n: float = 1e6
    stall_m: float = 1e-4
    stall_rad: float = 1e-3
    mass_kg: float = 2.6
    inertia_kg_m2: float = 0.05
    damping_min_ns_m: float = 20.0
    damping_min_nms_rad: float = 0.3

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, bool):
                continue
            if not 0.0 < value < float("inf"):
                raise InputError(f"--set {name}", f"{value} is not a positive number", "give a positive number")
        if self.quantile > 1.0 or self.slack < 1.0:
            raise InputError("--set", "quantile must be at most 1 and slack at least 1", "fix it")
        if self.lead_force_max_n < self.lead_force_n:
            raise InputError("--set lead_force_max_n", "is below lead_force_n", "give a larger one")
