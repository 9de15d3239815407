"""Admittance controller: motion commands that make a position- or velocity-controlled arm act as an impedance.

    M dv/dt + D (v - v_d) + K (x_c - x_d) = f_ff + f_ext                                                      (1)
    v  <-  v + (M + h D + h^2 K)^-1 h [ K (e - h v) + D (v_d - v) + f_ff + f_ext ],     e = x_d - x_c         (2)

x_c is the pose of the commanded joints, f_ext the filtered wrench of the environment on the tool. (2) solves (1) by an
implicit Euler step h, which is stable for every D and K; an explicit step needs h D < 2 M. In addition:

- the skill's damping is raised to a floor that keeps contact stable (`skillframe.robot.interface`);
- force and torque of the drive K e + D v_d + f_ff are limited to the push of robot.toml;
- a wrench below 0.5 N and 0.03 Nm counts as zero, so that a tare error causes no drift.

Contact rings where the surroundings are stiffer than the controller was designed for:

    f_s' = (f - f_s) / (2 T_tot),     up <- max(f - f_s, up exp(-h / (5 T_tot))),     down the same of f_s - f
    a = |min(up, down)|, axis by axis,     rings where a > share * push

A controller with too little damping rings at 1 / (4 T_tot) or slightly faster. f_s is the slow part of the force, a
the amplitude, remembered for about a period. A one-sided force, as at every touch, does not count. Raising an
admittance's damping while its force rings follows Dimeas and Aspragathos, IEEE Transactions on Haptics 9 (2016), who
use the spectrum.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.impedance import critical_damping, raised_damping
from skillframe.control.ticks import LawSettings, compiled, compiled_admittance
from skillframe.errors import InputError
from skillframe.frames import Float, Pose, dot, norm, pose_error
from skillframe.robot.interface import VIRTUAL_INERTIA, VIRTUAL_MASS
from skillframe.skill import Command, Impedance

SLOW, MEMORY = 2.0, 5.0
"""Time constants of f_s and a in T_tot: 0.5 and 1.25 periods of a ringing of 1 / (4 T_tot)."""
SHARE = 0.1
"""Ringing amplitude as a share of the push: 2 N of 20 N, far above a wrist sensor's noise."""


class RingWatch:
    """The detector of N independent trials, with step h = `dt` [s], T_tot = `delay` [s] and the push [N]."""

    def __init__(self, count: int, dt: float, delay: float, push: float) -> None:
        self._follow = -float(np.expm1(-dt / (SLOW * delay)))
        self._fade = float(np.exp(-dt / (MEMORY * delay)))
        self._least = SHARE * push
        self._slow, self._up, self._down, self._both, self._force = np.zeros((5, count, 3))
        self._move = compiled("rung", {
            "slow": self._slow, "up": self._up, "down": self._down, "least": self._both, "force": self._force,
            "follow": self._follow, "fade": self._fade, "numbers": self._slow.size,
        }) or self._move_in_numpy  # fmt: skip
        self.amplitude = np.zeros(count)

    def look(self, force: Float) -> NDArray[np.bool_]:
        """Return which contacts ring (N,), given the current forces (N, 3)."""
        self._force[:] = force
        self._move()
        self.amplitude = norm(self._both)
        result: NDArray[np.bool_] = self.amplitude > self._least
        return result

    def _move_in_numpy(self) -> int:
        off = self._force - self._slow
        self._slow += self._follow * off
        self._up[:] = np.maximum(off, self._fade * self._up)
        self._down[:] = np.maximum(-off, self._fade * self._down)
        np.minimum(self._up, self._down, out=self._both)
        return 0


QUIET_FORCE, QUIET_TORQUE = 0.5, 0.03
"""Contact threshold [N, Nm]: five times the noise of a filtered wrist sensor."""
CALMING = 4.0
"""Factor on the damping while contact rings. It keeps contact stable up to four times the declared stiffness."""
QUIET = np.array([QUIET_FORCE, QUIET_TORQUE]) ** 2
MASS = np.diag(np.repeat([VIRTUAL_MASS, VIRTUAL_INERTIA], 3))  #: (6, 6) virtual mass matrix [kg, kg m2]


class Bounds(NamedTuple):
    """Limits that keep the controller stable and gentle.

    Attributes:
        floor: least damping along any axis [Ns/m, Nms/rad].
        push: largest drive [N, Nm].
        stiffness: of arm and surroundings in series [N/m]; the skill may not be stiffer.
    """

    floor: tuple[float, float]
    push: tuple[float, float]
    stiffness: float = np.inf


class AdmittanceLaw:
    """The controller of N independent trials, with step h = `dt` [s].

    While `watch` finds ringing contact, damping is raised by `CALMING`; without it damping is constant.
    """

    def __init__(self, count: int, dt: float, bounds: Bounds, watch: RingWatch | None = None) -> None:
        self._dt, self._bounds, self._watch = dt, bounds, watch
        self._impedance: Impedance | None = None
        self._compiled = compiled_admittance(count, LawSettings(dt, bounds.push, QUIET))
        self.twist = np.zeros((count, 6))
        """Velocity v (N, 6) of the centre of compliance, base axes. Set it to the motion that the joints make."""

    def step(self, command: Command, pose: Pose, wrench: Float, ramp: float = 1.0) -> Float:
        """Advance v by one step and return the controller's wrench (N, 6) on the tool, drive minus damping.

        `pose` is at the commanded joints, `wrench` (N, 6) acts there on the tool, both in base axes. `ramp`, 0 to 1,
        scales desired twist and feed-forward.

        Raises:
            InputError: the skill is stiffer than the arm.
        """
        self._design(command.impedance)
        damping, gain = self._damping, self._gain
        if self._watch is not None and np.count_nonzero(rings := self._watch.look(wrench[:, :3])):
            chosen = rings[:, None, None]
            damping, gain = np.where(chosen, CALMING * damping, damping), np.where(chosen, self._calm, gain)
        if (law := self._compiled) is not None and law.strayed(command.pose, pose, self.twist):
            law.find(command, wrench, ramp, (self._stiffness, self._damping, damping))
            drive, force = law.drive, law.force
        else:
            error = pose_error(command.pose, pose) - self._dt * self.twist
            wanted = _times(self._damping, command.twist) + command.feedforward
            halves = (_times(self._stiffness, error) + ramp * wanted).reshape(-1, 2, 3)
            share = norm(halves) / self._bounds.push
            drive = (halves / np.maximum(share, 1.0)[..., None]).reshape(-1, 6)
            force = drive - _times(damping, self.twist) + felt(wrench)
        self.twist = self.twist + _times(gain, force)
        asked: Float = drive - _times(damping, self.twist)
        return asked

    def _design(self, impedance: Impedance) -> None:
        last, (stiffness, damping) = self._impedance, impedance
        if last is not None and _same(last.stiffness, stiffness) and _same(last.damping, damping):
            return
        self._impedance = Impedance(stiffness.copy(), None if damping is None else damping.copy())
        self._require_soft(stiffness)
        floor = self._bounds.floor
        self._stiffness = self._impedance.stiffness
        if damping is None:
            inertia = np.broadcast_to(MASS, stiffness.shape)
            self._damping = critical_damping(stiffness, inertia, floor=floor)
        else:
            self._damping = raised_damping(damping, floor)
        h = self._dt
        self._gain, self._calm = (
            np.linalg.inv(MASS / h + share * self._damping + h * stiffness).astype(np.float64, copy=False)
            for share in (1.0, CALMING)
        )

    def _require_soft(self, stiffness: Float) -> None:
        part = stiffness[..., :3, :3]
        if not np.isfinite(part).all() or not np.isfinite(self._bounds.stiffness):
            return
        largest = float(np.linalg.eigvalsh(0.5 * (part + part.mT)).max())
        if largest > self._bounds.stiffness:
            text = (
                f"the skill commands {largest:.3g} N/m, and arm, sensor and part together yield with "
                f"{self._bounds.stiffness:.3g} N/m (contact_stiffness): the interface cannot hold it"
            )
            raise InputError("control.interface", text, "learn or write a softer skill, or measure contact_stiffness")


def felt(wrench: Float) -> Float:
    """Return wrenches (N, 6), zero where they are below the contact threshold."""
    halves = wrench.reshape(-1, 2, 3)
    touching = np.any(dot(halves, halves) > QUIET, axis=-1)
    result: Float = wrench * touching[:, None]
    return result


def _times(matrix: Float, vector: Float) -> Float:
    """Matrices (6, 6) or (N, 6, 6) times vectors (N, 6)."""
    result: Float = (matrix @ vector[..., None])[..., 0]
    return result


def _same(a: Float | None, b: Float | None) -> bool:
    if a is None or b is None:
        return a is b
    return a.shape == b.shape and not np.count_nonzero(a != b)
