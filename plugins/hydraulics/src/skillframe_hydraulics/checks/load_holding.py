"""Setting of a counterbalance valve against the pressure of the load that it holds.

Makers have it set to at least 1.3 times the greatest load pressure (Sun Hydraulics, data sheet of CBCL), or 1.2.
"""

from __future__ import annotations

from typing import NamedTuple

from skillframe.robot import Actuation
from skillframe_hydraulics.checks.figures import areas, called
from skillframe_hydraulics.counterbalance import DEFAULTS

LEAST, USUAL = 1.2, 1.3
"""Setting over load pressure."""


class Setting(NamedTuple):
    """Setting of a counterbalance valve, and pressures at its port [Pa]: its load's, and with the pilot's share."""

    setting: float
    load: float
    opening: float


def at_rest(actuation: Actuation, force: float) -> Setting | None:
    """Pressures that hold a force [N, Nm] with the other port at the return line's, None without a valve."""
    p = {**DEFAULTS, **actuation.known}
    port = "a" if p["counterbalance_a"] > 0.0 else "b"
    if (setting := float(p[f"counterbalance_{port}"])) <= 0.0:
        return None
    own, other = areas(actuation) if port == "a" else areas(actuation)[::-1]
    load = ((force if port == "a" else -force) + other * p["return_pressure"]) / own
    return Setting(setting, load, load + p["pilot_ratio"] * p["return_pressure"])


def opens_by_itself(actuation: Actuation, force: float) -> list[str]:
    """A sentence on a counterbalance valve that its load opens, or none."""
    found = at_rest(actuation, force)
    if found is None or found.opening < found.setting:
        return []
    text = f"the counterbalance valve of {called(actuation)} is set to {found.setting / 1e5:.4g} bar, and its load of"
    more = f"{found.load / 1e5:.4g} bar opens it by itself with the return line's pressure at its pilot"
    return [f"{text} {more}: set it to {_usual(found)}"]


def low_setting(actuation: Actuation, force: float) -> str:
    """A sentence on a counterbalance valve that is set low, or that its load does not press on, or ""."""
    found = at_rest(actuation, force)
    if found is None or found.opening >= found.setting:
        return ""
    own = f"the counterbalance valve of {called(actuation)}"
    if found.load <= float(actuation.known["return_pressure"]):
        return f"{own} is at the port that its load at home does not press on"
    if found.setting >= LEAST * found.load:
        return ""
    text = f"{own} is set to {found.setting / 1e5:.4g} bar, {found.setting / found.load:.3g} times its load at home"
    return f"{text}; usual are {_usual(found)}"


def _usual(found: Setting) -> str:
    low, high = (share * found.load / 1e5 for share in (LEAST, USUAL))
    return f"{low:.4g} to {high:.4g} bar, {LEAST:g} to {USUAL:g} times the greatest load pressure, or more"
