r"""The admittance law: what to tell an arm that takes velocities or positions, so that it acts as an impedance.

    M dv/dt + D (v - v_d) + K (x_c - x_d) = f_ff + f_ext                                                      (1)
    v  <-  v + (M + h D + h^2 K)^-1 h [ K (e - h v) + D (v_d - v) + f_ff + f_ext ],     e = x_d - x_c         (2)

x_c is the pose of the joints as commanded, not as measured, f_ext the filtered wrench of the environment on the tool.
(1) is the loop's impedance read the other way round, force in and motion out. (2) is (1) by an implicit Euler step of
h, stable for every D and K at any rate, where an explicit one needs h D < 2 M. Our choices:

- the skill's damping is raised to a floor that keeps contact stable (`skillframe.robot.interface`);
- the drive K e + D v_d + f_ff is cut to the push that robot.toml allows, force and torque each: D v_d alone, at
  2000 Ns/m and 20 mm/s, is 40 N that no limit of the skill knows of;
- while no contact is felt (below 0.5 N and 0.03 Nm) the wrench counts as none, so that a tare's error makes no drift.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.control.impedance import critical_damping, pose_error, raised_damping
from skillframe.control.ringing import RingWatch
from skillframe.control.ticks import LawSettings, compiled_admittance
from skillframe.errors import InputError
from skillframe.frames import Float, Pose, norm
from skillframe.robot.interface import VIRTUAL_INERTIA, VIRTUAL_MASS
from skillframe.skill import Command, Impedance

QUIET_FORCE, QUIET_TORQUE = 0.5, 0.03
"""[N, Nm] below which no contact is felt: five times what the filter leaves of a wrist sensor's noise (ours)."""
CALMING = 4.0
"""Times the damping where contact rings: stable up to four times the stiffness that was declared (ours)."""
QUIET = np.array([QUIET_FORCE, QUIET_TORQUE]) ** 2
MASS = np.diag(np.repeat([VIRTUAL_MASS, VIRTUAL_INERTIA], 3))


class Bounds(NamedTuple):
    """What keeps the law stable and gentle.

    Attributes:
        floor: least damping along any axis [Ns/m, Nms/rad].
        push: largest drive [N, Nm].
        stiffness: of what the arm may touch and of itself in series [N/m]; a skill cannot be stiffer.
    """

    floor: tuple[float, float]
    push: tuple[float, float]
    stiffness: float = np.inf


class AdmittanceLaw:
    """The law of N trials. Rows are independent of each other.

    Args:
        count: N.
        dt: h [s], between two commands.
        bounds: of the arm.
        watch: for contact that rings, which is damped `CALMING` times as much. None damps all alike.
    """

    def __init__(self, count: int, dt: float, bounds: Bounds, watch: RingWatch | None = None) -> None:
        self._dt, self._bounds, self._watch = dt, bounds, watch
        self._impedance: Impedance | None = None
        self._compiled = compiled_admittance(count, LawSettings(dt, bounds.push, QUIET))
        self.twist = np.zeros((count, 6))
        """(N, 6) v of the centre of compliance, base axes. Who moves the joints writes here what they really do."""

    def step(self, command: Command, pose: Pose, wrench: Float, ramp: float = 1.0) -> Float:
        """Move v on by a step, and give the law's wrench (N, 6) on the tool: drive less damping.

        Args:
            command: what the skill wants.
            pose: of the centre of compliance at the commanded joints.
            wrench: (N, 6) of the environment on the tool there, base axes.
            ramp: 0 ... 1 fades desired twist and feed-forward in.

        Raises:
            InputError: the skill is stiffer than the arm can be.
        """
        self._design(command.impedance)
        damping, gain = self._now(wrench)
        drive, force = self._forces(command, pose, wrench, ramp, damping)
        self.twist = self.twist + _times(gain, force)
        law: Float = drive - _times(damping, self.twist)
        return law

    def _forces(self, command: Command, pose: Pose, wrench: Float, ramp: float, damping: Float) -> tuple[Float, Float]:
        """The drive (N, 6), held to the push, and all forces together."""
        if (law := self._compiled) is not None and law.strayed(command.pose, pose, self.twist):
            law.find(command, wrench, ramp, (self._stiffness, self._damping, damping))
            return law.drive, law.force
        error = pose_error(command.pose, pose) - self._dt * self.twist
        wanted = _times(self._damping, command.twist) + command.feedforward
        drive = self._cut(_times(self._stiffness, error) + ramp * wanted)
        return drive, drive - _times(damping, self.twist) + felt(wrench)

    def _now(self, wrench: Float) -> tuple[Float, Float]:
        """Damping and step matrix, those of the trials whose contact rings with more damping."""
        if self._watch is None:
            return self._damping, self._gain
        rings = self._watch.look(wrench[:, :3])
        if not np.count_nonzero(rings):
            return self._damping, self._gain
        chosen = rings[:, None, None]
        return np.where(chosen, CALMING * self._damping, self._damping), np.where(chosen, self._calm, self._gain)

    def _cut(self, drive: Float) -> Float:
        """Force and torque held to the push, each in its direction."""
        halves = drive.reshape(-1, 2, 3)
        share = norm(halves) / self._bounds.push
        result: Float = (halves / np.maximum(share, 1.0)[..., None]).reshape(-1, 6)
        return result

    def _design(self, impedance: Impedance) -> None:
        """Damping and step matrix for an impedance, when another one comes."""
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
                f"the skill asks for {largest:.3g} N/m, and arm, sensor and part together yield with "
                f"{self._bounds.stiffness:.3g} N/m (contact_stiffness): the interface cannot hold it"
            )
            raise InputError("control.interface", text, "learn or write a softer skill, or measure contact_stiffness")


def felt(wrench: Float) -> Float:
    """Wrenches (N, 6), none where no contact is felt."""
    halves = wrench.reshape(-1, 2, 3)
    touching = (np.vecdot(halves, halves) > QUIET).any(-1)
    result: Float = wrench * touching[:, None]
    return result


def _times(matrix: Float, vector: Float) -> Float:
    """Matrices (6, 6) or (N, 6, 6) times vectors (N, 6), row by row."""
    result: Float = (matrix @ vector[..., None])[..., 0]
    return result


def _same(a: Float | None, b: Float | None) -> bool:
    if a is None or b is None:
        return a is b
    return a.shape == b.shape and not np.count_nonzero(a != b)
