"""The identifying swing in the air before a run, and the use of its results.

Identification is a phase of the task: automatic detection of contact by force would mistake stiction for contact.

    stated^2 = (s sigma)^2 + (f - f_late)^2,    s = max(1, q / 2),   q = 95 % quantile of |f_i| / sigma_i in air    (1)
    beside = rms |X' - X_d'| over the swing,    after = rms |X'| over its last half second, when X_d' = 0           (2)
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from skillframe.frames import Float, dot
from skillframe_hydraulics.force.identification import Identification
from skillframe_hydraulics.force.load import BelievedLoad, carrier, inertias
from skillframe_hydraulics.force.momentum import Estimate
from skillframe_hydraulics.force.valve import ValveIdentification
from skillframe_hydraulics.law.gains import derived_gains
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import friction_parameters
from skillframe_hydraulics.law.vdc_adaptation import relative_bounds

LOOK_S = 0.5
"""Last part of the swing, when the tool should be at rest [s]."""
CALIBRATION_S = 6.0
"""Two or three reversals of every cylinder."""
SWING_S = CALIBRATION_S + 1.0
"""With the time to come to rest."""


@lru_cache(maxsize=1 << 14)
def swing(time: float, axes: int = 2, part: float = 1.0) -> tuple[Float, Float, float, float]:
    """Displacement (m,) [m] and velocity of the tool, and of the open joints, at a time of the calibration [s].

    The tool moves up and back along the last of its m axes, to and fro along the others, the joints out and in, so
    that every cylinder reverses, each at times of its own. All are `part` of their full size.
    """
    h = 1e-4
    now, rate = _displacement(time, axes), (_displacement(time + h, axes) - _displacement(time - h, axes)) / (2 * h)
    return part * now[:-1], part * rate[:-1], part * float(now[-1]), part * float(rate[-1])


def _displacement(time: float, axes: int) -> Float:
    fade = min(1.0, max(0.0, time / 0.5), max(0.0, (CALIBRATION_S - time) / 1.0))
    fade = fade * fade * (3.0 - 2.0 * fade)
    turn = 2.0 * np.pi * time / CALIBRATION_S
    along = [0.10 * np.sin(3 * turn), 0.10 * np.sin(2.5 * turn)][: axes - 1]  # m
    return fade * np.array([*along, 0.10 * (1.0 - np.cos(2 * turn)), 0.05 * np.sin(2 * turn)])


def hold_identified(law: CompiledLaw, found: Identification) -> None:
    """Use the identified friction and payload in a controller, and stop its adaptation.

    The load may be any within the rating, the body that carries it heavier or lighter by `share`. Adapted inertias are
    dropped, because they drift with the friction of standing pistons.
    """
    nominal = friction_parameters(law.cylinders)
    lower, upper = relative_bounds(nominal, law.gains.friction_share)
    errors = np.stack([found.coulomb, found.viscous], axis=1)
    law.adapt(False)
    law.friction[:] = np.clip(nominal + errors, lower, upper)
    row, (least, most) = carrier(law.chain), carried_bounds(law)
    mass = law.told[:, row, 0]
    law.theta[:] = law.told
    law.theta[:, row] *= (np.clip(mass + found.payload, least, most) / mass)[:, None]


def carried_bounds(law: CompiledLaw) -> tuple[float, float]:
    """Least and largest mass of the body that carries the load, load included [kg]."""
    payload, share = law.chain.robot.spec.payload, law.gains.share
    assert payload is not None  # required by the force estimate
    empty, full = inertias(law.chain, np.array([0.0, payload.rating]))[:, carrier(law.chain), 0]
    return (1.0 - share) * float(empty), (1.0 + share) * float(full)


def findings(
    law: CompiledLaw, load: BelievedLoad, found: Identification, valves: ValveIdentification
) -> list[list[str]]:
    """Sentences on every trial's swing: a load that differs from the declared one, and figures beyond their bounds.

    Every clipped figure is reported, except the lower bound of zero on overlap.
    """
    nominal, joints = friction_parameters(law.cylinders), law.chain.actuated
    lower, upper = relative_bounds(nominal, law.gains.friction_share)
    row, bounds, largest = carrier(law.chain), carried_bounds(law), valves.settings.largest
    cure = "expect the tool to sag or to rise, and check payload.mass and the masses in the URDF"
    told: list[list[str]] = []
    for i in range(len(load.mass)):
        own: list[str] = []
        told.append(own)
        if load.mass[i] != load.told[i]:
            text = f"the controller was given {load.told[i]:.0f} kg in the grip; at rest the cylinders' pressures"
            own.append(f"{text} hold {load.mass[i]:.0f} kg, and it goes by these")
        mass = law.told[i, row, 0]
        for bound, beyond in zip(bounds, (np.less, np.greater), strict=True):
            if beyond(mass + found.payload[i], bound):
                text = _bounded("load in the grip", load.mass[i] + found.payload[i], load.mass[i] + bound - mass, "kg")
                own.append(f"{text}; {cure}")
        seen = nominal + np.stack([found.coulomb[i], found.viscous[i]])
        for j, (name, unit) in enumerate((("coulomb_friction", "N"), ("viscous_friction", "N s/m"))):
            for k, joint in enumerate(joints):
                if not lower[j, k] <= seen[j, k] <= upper[j, k]:
                    own.append(_bounded(f"{name} of {joint}", seen[j, k], law.friction[i, j, k], unit))
        for k, joint in enumerate(joints):
            if valves.overlap[i, k] - valves.overlap_deviation[i, k] > largest:
                figures = 100.0 * valves.overlap[i, k], 100.0 * largest
                own.append(_bounded(f"deadband of {joint}", *figures, "% of the travel"))
            pressure, used = valves.supply_found[i, k], valves.supply[i, k]
            measured = valves.line_deviation is not None and np.isfinite(valves.line_deviation[i, k])
            if abs(pressure - used) > 1.0 and not measured:  # Pa: above rounding errors
                own.append(_bounded(f"supply_pressure of {joint}", pressure / 1e5, used / 1e5, "bar"))
    return told


def _bounded(what: str, found: float, bound: float, unit: str) -> str:
    return f"{what}: the swing found {found:.4g} {unit}, beyond its bound; the controller uses {bound:.4g} {unit}"


class StatedSigma:
    """Reported standard deviation of the estimated force of N machines: equation (1). `scale` (N,) is s.

    In the swing the true force is zero, so s makes 95 % of the errors lie within two sigmas. The difference to the
    feedback f_late, 50 ms older, covers the lag. The controller uses sigma of `momentum`, which covers stiction.
    """

    def __init__(self, count: int, dt: float) -> None:
        self._from, self._every = round(2.5 / dt), max(1, round(0.01 / dt))  # s
        self.scale: Float = np.ones(count)
        self._rows: list[Float] = []

    def show(self, tick: int, estimate: Estimate) -> None:
        """Add an estimate of the swing, where the true force is zero."""
        if tick >= self._from and tick % self._every == 0:
            self._rows.append(np.abs(estimate.force) / estimate.sigma)

    def hold(self) -> None:
        """Compute the scale, 1 until then, after the swing."""
        if self._rows:
            seen = np.array(self._rows)
            every = np.moveaxis(seen, 1, 0).reshape(seen.shape[1], -1)
            self.scale = np.maximum(1.0, 0.5 * np.quantile(every, 0.95, axis=1))
        self._rows = []

    def stated(self, estimate: Estimate) -> Float:
        """Standard deviation (N, m) [N]."""
        late = estimate.force - estimate.feedback
        return np.hypot(self.scale[:, None] * estimate.sigma, late)


class Ringing:
    """Detects N oscillating machines, from the tool's speed in the swing that ends at `end` [s]: equation (2).

    A machine oscillates if `after` is above 0.4 or `beside` above 1.25 of the rms of X_d'. A stuck valve has 0 and 1;
    the worst of sound simulated machines had 0.18 and 0.53, oscillating ones at least 1.3 or 0.99.
    """

    def __init__(self, count: int, dt: float, end: float, axes: int = 2) -> None:
        self._dt, self._from, self._ticks = dt, round((end - LOOK_S) / dt), 0
        self._beside, self._after = np.zeros(count), np.zeros(count)
        self._told = 0.0
        self._turns, self._side = np.zeros((count, axes)), np.zeros((count, axes))

    def step(self, speed: Float, wanted: Float) -> None:
        """Add a tick: measured (N, m) and commanded (m,) velocity of the tool [m/s]."""
        off = speed - wanted
        square = dot(off, off)
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
        """Rms of the deviation from the commanded velocity (N,) [m/s]."""
        return np.sqrt(self._beside / max(self._ticks, 1))

    @property
    def after(self) -> Float:
        """Rms of the speed when the tool should be at rest (N,) [m/s]. 0 before."""
        return np.sqrt(self._after / max(self._ticks - self._from, 1))

    def sentences(self, law: CompiledLaw) -> list[str]:
        """A sentence for every oscillating machine, with figures and a fix, else ""."""
        rings = (self.after > 0.4 * self.told) | (self.beside > 1.25 * self.told)
        cure = what_to_set(law) if rings.any() else ""
        return [f"{self._text(i)}; {cure}" if rings[i] else "" for i in range(len(rings))]

    def _text(self, i: int) -> str:
        beside, told, after = (1e3 * x for x in (self.beside[i], self.told, self.after[i]))
        often = float(self._turns[i].max()) / (2.0 * LOOK_S)
        swings = f"its tool swings {beside:.0f} mm/s (rms) beside a path of {told:.0f} mm/s"
        if self._ticks <= self._from:  # ended before it was commanded to rest
            return f"the machine rings: {swings}; or it lacks the pressure to carry its load"
        at_rest = f"still moves at {after:.0f} mm/s when commanded to rest, to and fro {often:.1f} times a second"
        return f"the machine rings: {swings}, and {at_rest}"


def what_to_set(law: CompiledLaw) -> str:
    """Gains above the derived ones, with these, or other possible causes."""
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
