r"""Does a machine ring? Its tool's speed in the swing before a run, against that of the path it is told.

    beside = rms |X' - X_d'| over the swing,    after = rms |X'| over its last half second, when X_d' = 0          (1)

both over the rms of X_d' in the swing. Ours: a machine rings if `after` is above 0.4 or `beside` above 1.25. A valve
that is stuck has 0 and 1. Of sound cranes and diggers with valves 40 ms late, 150 bar, friction by a third too large or
too small, an overlap of 2 % the worst had 0.18 and 0.53; those that rang, 1.3 and 0.99 or more. The opening of the
valves says less: a digger that swung by 0.3 m/s never opened one by more than 0.69.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float
from skillframe.machine.law.gains import derived_gains

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic_compiled import CompiledLaw

__all__ = ["Ringing"]

AFTER, BESIDE = 0.4, 1.25
LOOK_S = 0.5
"""The last so much of the swing, when the tool should have come to rest."""


class Ringing:
    """Equation (1) for N machines.

    Args:
        count: N.
        dt: sample time [s].
        end: of the swing and of coming to rest after it [s].
    """

    def __init__(self, count: int, dt: float, end: float) -> None:
        self._dt, self._from, self._ticks = dt, round((end - LOOK_S) / dt), 0
        self._beside, self._after = np.zeros(count), np.zeros(count)
        self._told = 0.0
        self._turns, self._side = np.zeros((count, 2)), np.zeros((count, 2))

    def step(self, speed: Float, wanted: Float) -> None:
        """Take in a tick: the tool's velocity (N, 2) as measured, and what it was told (2,) [m/s]."""
        off = speed - wanted
        square = np.vecdot(off, off)
        self._told += float(wanted @ wanted)
        self._beside += square
        if self._ticks >= self._from:
            side = np.sign(off)
            self._after += square
            self._turns += side * self._side < 0.0
            self._side = side
        self._ticks += 1

    @property
    def told(self) -> float:
        """Rms of the commanded speed [m/s]."""
        return float(np.sqrt(self._told / max(self._ticks, 1)))

    @property
    def beside(self) -> Float:
        """(N,) rms of the speed beside the commanded one [m/s]."""
        return np.sqrt(self._beside / max(self._ticks, 1))

    @property
    def after(self) -> Float:
        """(N,) rms of the speed when the tool should be at rest [m/s]. 0 before."""
        return np.sqrt(self._after / max(self._ticks - self._from, 1))

    def sentences(self, law: CompiledLaw) -> list[str]:
        """Of every machine: that it rings, with figures and what to set. Empty for one that does not."""
        rings = (self.after > AFTER * self.told) | (self.beside > BESIDE * self.told)
        cure = what_to_set(law) if rings.any() else ""
        return [f"{self._text(i)}; {cure}" if rings[i] else "" for i in range(len(rings))]

    def _text(self, i: int) -> str:
        beside, told, after = (1e3 * x for x in (self.beside[i], self.told, self.after[i]))
        often = float(self._turns[i].max()) / (2.0 * LOOK_S)
        told_at_rest = f"still moves at {after:.0f} mm/s when told to rest, to and fro {often:.1f} times a second"
        return (
            f"the machine rings: its tool swings {beside:.0f} mm/s (rms) beside a path of {told:.0f} mm/s, and"
            f" {told_at_rest}"
        )


def what_to_set(law: CompiledLaw) -> str:
    """Gains above those that follow from the machine's figures, and what these are, or where else to look."""
    derived, now, spec = derived_gains(law.chain), law.gains, law.chain.robot.spec
    rows = [("gains.body", now.body, derived.body)]
    for name, given, found in (("velocity", now.velocity, derived.velocity), ("force", now.force, derived.force)):
        rows += [
            (f"{name}_gain of {a.joint}", x, float(y)) for a, x, y in zip(spec.actuation, given, found, strict=True)
        ]
    large = [f"{name} from {x:.3g} to {y:.3g}" for name, x, y in rows if x > 1.05 * y]
    if large:
        return f"lower {', '.join(large)}, or leave them out of robot.toml, which says the same"
    body = f"give gains.body below {now.body:.3g}"
    return f"its gains follow from its figures already: compare delay, spool and volumes with the machine's, or {body}"
