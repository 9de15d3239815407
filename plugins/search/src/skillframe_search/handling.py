"""Constants of a seating, the same for all parts, chosen by their worth on AutoMate's assemblies."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """When a part has stalled, and what is added to its push.

    Attributes:
        approach_speed: [m/s].
        short_m: at rest within this of the end is seated [m]; lost_m: farther beyond it is beside the hole [m].
        progress_m: less is a stall, after stall_s on the rim, after patience_s once a search is over [m, s, s].
        centre_n, aside_m: at rest near the end but farther than aside_m from the axis, it is moved back until more than
            centre_n holds it [N, m]; 0: not.
        sunk_m: deeper than the stall by this, plus the effect of tilt, is in the hole [m].
        catch_m_s, catch_ns_m: faster along the way than this is braked, with this damping [m/s, Ns/m].
        upright_nm_rad: stiffness towards upright before a search or rest in the hole [Nm/rad].
        rock_nm, rock_hz: torque across the way after rock_after_s at rest in the hole, against a jam [Nm, Hz, s];
            slow_nm, slow_hz: after slow_after_s, to move the tip.
        tip_pitch_m, tip_hz: of a spiral of the tip after that [m, Hz]; tip_nm_rad, tip_nm: its stiffness and largest
            torque [Nm/rad, Nm].
        swing_m, swing_s: deeper than the first contact by this, a part is guided by its hole, and swung after so long
            at rest short of its end [m, s].
        known_m, known_rad: error of the fixture across the way and in orientation after a swing, several times the one
            measured [m, rad]; known_catch_m_s: as catch_m_s, then.
        settle_nm, settle_n: largest torque that rocks it near the end, and force that pulls it to the axis [Nm, N].
    """

    approach_speed: float = 0.03
    short_m: float = 0.0005
    lost_m: float = 0.002
    progress_m: float = 0.0003
    stall_s: float = 0.5
    patience_s: float = 2.0
    centre_n: float = 8.0
    aside_m: float = 0.001
    sunk_m: float = 0.0008
    catch_m_s: float = 0.03
    catch_ns_m: float = 1000.0
    upright_nm_rad: float = 3.0
    rock_nm: float = 0.4
    rock_hz: float = 4.0
    rock_after_s: float = 0.15
    slow_nm: float = 0.6
    slow_hz: float = 1.0
    slow_after_s: float = 0.75
    tip_pitch_m: float = 0.0007
    tip_hz: float = 1.25
    tip_nm_rad: float = 40.0
    tip_nm: float = 0.9
    swing_m: float = 0.004
    swing_s: float = 1.0
    known_m: float = 0.0006
    known_rad: float = radians(1.5)
    known_catch_m_s: float = 0.010
    settle_nm: float = 0.4
    settle_n: float = 6.0


HANDLING = Handling()
