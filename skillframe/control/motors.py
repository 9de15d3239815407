"""What a robot's motors can give: joint torques held to their rate and to the URDF's effort, joints watched.

The law's torques (with gravity, which a motor has to carry as well) are held to each joint's `effort`, and then to
`torque_rate_nm_s`. What a motor cannot do for long ends the trial, with the joint's name; the times are ours:

- torque rate: a command that asks for more for `RATE_PERSISTENCE` ticks running (a short saturation, as at an impact,
  is what the limiter is for);
- effort: a law that asks for more than a joint's for `MOTOR_S` running; speed: a joint faster than its `velocity` for
  as long; range: a joint of the arm pressed `RANGE_SLACK` into the end of its range for as long. Drives bear a peak of
  torque or speed for a moment; a tenth of a second is ten times an impact.

Zero, or nothing, in a URDF's `effort` or `velocity` means that it is not given, and no limit; `unstated` names such
joints, so that a result can say so. A free-flying base has no motors.

Of each limit the largest share used so far is kept, for the joint that used most: torque asked for over `effort`, speed
over `velocity`, and of the range the distance from its middle over half of it: 0 in the middle, 1 at an end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken, Ended
from skillframe.control.ticks import compiled
from skillframe.frames import Float
from skillframe.robot.model import RobotModel
from skillframe.robot.numbers import numbers
from skillframe.robot.urdf import Joint

RATE_PERSISTENCE = 20  # an impact keeps the limiter busy for 5 to 10 ms; twice that is a law gone wrong
MOTOR_S, RANGE_SLACK = 0.1, 1e-3  # s; rad or m, more than rounding and noise, less than any use


class JointLimits(NamedTuple):
    """Limits of the generalised velocities of one batch row, in the simulator's order. Infinite where none is given.

    Attributes:
        names: (nv) of the joints.
        sliding: (nv) prismatic joints.
        effort: (nv,) [N m or N]; velocity: (nv,) [rad/s or m/s].
        lower, upper: (nv,) [rad or m].
        ranged: (nv,) 1 where the URDF gives the range, 0 where lower and upper are ours or there are none.
    """

    names: tuple[str, ...]
    sliding: tuple[bool, ...]
    effort: Float
    velocity: Float
    lower: Float
    upper: Float
    ranged: Float


def joint_limits(robot: RobotModel, engine: Any, arms: Sequence[NDArray[np.int64]] | None = None) -> list[JointLimits]:
    """What the URDF says of a robot's joints, for each arm, or for the whole robot. Empty if it has no joints.

    Of a joint that no tool frame is carried by, as a gripper's that is closed, the range is not watched.

    Args:
        robot: with its URDF.
        engine: the simulator's model, which orders the generalised velocities.
        arms: of each arm its generalised velocities.
    """
    model, nv = robot.model, int(engine.nv)
    names, sliding = [""] * nv, [False] * nv
    effort, velocity, lower, upper = (np.full(nv, sign * np.inf) for sign in (1, 1, -1, 1))
    ranged = np.zeros(nv)
    carrying = {int(j) for f in robot.tool_frames for j in model.supports[model.frames[f].parentJoint]}
    for index in range(1, model.njoints):
        joint, urdf = model.joints[index], robot.urdf.joints.get(model.names[index])
        if urdf is None or joint.nv != 1:
            continue
        i, given = int(engine.joint(model.names[index]).dofadr[0]), _given(urdf)
        names[i], sliding[i] = model.names[index], urdf.type == "prismatic"
        effort[i], velocity[i] = given.effort, given.velocity
        if joint.nq == 1 and index in carrying:
            lower[i], upper[i] = (end[joint.idx_q] for end in (model.lowerPositionLimit, model.upperPositionLimit))
            ranged[i] = given.ranged
    if not any(names):
        return []
    chosen = [np.arange(nv)] if arms is None else arms
    return [
        JointLimits(tuple(names[i] for i in dofs), tuple(sliding[i] for i in dofs), *(
            part[dofs] for part in (effort, velocity, lower, upper, ranged)
        ))
        for dofs in chosen
    ]  # fmt: skip


class _Given(NamedTuple):
    """What a URDF says of a joint: effort and velocity, infinite where not given, and whether it gives a range."""

    effort: float
    velocity: float
    ranged: bool


def _given(joint: Joint) -> _Given:
    limit = joint.element.find("limit")
    effort, velocity, lower, upper = (
        numbers(limit, what, 1, (0.0,))[0] for what in ("effort", "velocity", "lower", "upper")
    )
    return _Given(effort if effort > 0.0 else np.inf, velocity if velocity > 0.0 else np.inf, lower < upper)


def unstated(robot: RobotModel) -> list[str]:
    """Sentences on joints whose effort, velocity or range the URDF does not give. None if it gives them all."""
    model = robot.model
    moving = [robot.urdf.joints.get(model.names[i]) for i in range(1, model.njoints) if model.joints[i].nv == 1]
    given = {joint.name: (_given(joint), joint.type) for joint in moving if joint is not None}
    motors = [name for name, (limits, _) in given.items() if np.isinf(limits.effort) or np.isinf(limits.velocity)]
    ranges = [name for name, (limits, kind) in given.items() if not limits.ranged and kind != "continuous"]
    said = (
        (motors, "the URDF gives no effort or no velocity for {}; what it does not give counts as unlimited"),
        (ranges, "the URDF gives no range for {}; it counts as free within +-2 pi rad or +-10 m"),
    )
    return [text.format(_few(names)) for names, text in said if names]


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


class Motors:
    """The motors of N rows. Rows are independent of each other.

    Args:
        limits: of each row's joints: one for all, or one per arm, which rows take in turn.
        rate: [N m/s] of joint torques, or None.
        count: N.
        dt: [s] between two ticks.
    """

    def __init__(self, limits: Sequence[JointLimits], rate: float | None, count: int, dt: float) -> None:
        self._limits, self._rate, self._dt = limits, rate, dt
        nv, turns = len(limits[0].names), count // len(limits)
        stacked = [np.tile([getattr(one, what) for one in limits], (turns, 1)) for what in JointLimits._fields[2:]]
        self._effort, velocity, lower, upper, ranged = stacked
        bounded = np.isfinite(lower) & np.isfinite(upper)
        lower, upper = np.where(bounded, lower, -1.0), np.where(bounded, upper, 1.0)
        self._middle = 0.5 * (lower + upper)
        half = np.where(bounded, 0.5 * (upper - lower) + RANGE_SLACK, np.inf)
        self._whole = np.stack([self._effort, velocity, np.where(ranged > 0.0, half - RANGE_SLACK, np.inf)], axis=1)
        step = np.full((count, nv), np.inf if rate is None else rate * dt)
        self._most = np.concatenate([step, self._effort, velocity, half], axis=-1)
        self._now = np.zeros((count, 4 * nv))
        self._change, self._asked, self._speed, self._place = (self._now[:, k * nv : (k + 1) * nv] for k in range(4))
        self._last = np.zeros((count, nv))
        self._begun = False
        self._ticks = np.zeros((count, 3 * nv), dtype=np.int64)  # of torque, speed, range
        self._rate_ticks = np.zeros(count, dtype=np.int64)
        self._peak = np.zeros((count, 4 * nv))
        self._persistence = max(1, round(MOTOR_S / dt))
        whole = {"now": self._now, "peak": self._peak, "last": self._last, "middle": self._middle, "most": self._most}
        self._above = compiled("held", {**whole, "count": count, "nv": nv}) or self._above_in_numpy
        self.counting = False
        """Is any row beyond what a motor can give?"""

    def held(self, torque: Float, velocity: Float, position: Float) -> Float:
        """Joint torques (N, nv) as the motors give them.

        Args:
            torque: (N, nv) that the law asks for.
            velocity: (N, nv) of the joints.
            position: (N, nv) of the joints.
        """
        if not self._begun:
            self._last[:], self._begun = torque, True
        self._asked[:] = torque
        self._speed[:] = velocity
        self._place[:] = position
        if self._above():
            torque = self._limited(torque, self._last, np.abs(self._now) > self._most)
        elif self.counting:
            self._ticks[:], self._rate_ticks[:], self.counting = 0, 0, False
        self._last[:] = torque
        return torque

    def _above_in_numpy(self) -> int:
        """Take in what is asked and done. How many numbers are above what a motor can give."""
        np.subtract(self._asked, self._last, out=self._change)
        np.subtract(self._place, self._middle, out=self._place)
        size = np.abs(self._now)
        np.maximum(self._peak, size, out=self._peak)
        return int(np.count_nonzero(size > self._most))

    def _limited(self, torque: Float, last: Float, over: NDArray[np.bool_]) -> Float:
        """Held to the effort, and then to the rate: a motor at its effort is not asked for a rate besides."""
        nv = torque.shape[1]
        torque = np.minimum(np.maximum(torque, -self._effort), self._effort)
        change = torque - last
        fast = np.abs(change) > self._most[:, :nv]
        self._ticks += 1
        self._ticks *= over[:, nv:]
        self._rate_ticks = (self._rate_ticks + 1) * fast.any(-1)
        self.counting = True
        if self._rate is None:
            return torque
        return np.where(fast, last + np.copysign(self._rate * self._dt, change), torque)

    def fine(self) -> NDArray[np.bool_]:
        """(N,) no row beyond for too long."""
        lasting: NDArray[np.bool_] = self._rate_ticks < RATE_PERSISTENCE
        lasting &= (self._ticks < self._persistence).all(-1)
        return lasting

    def broken(self, i: int) -> Broken | None:
        """Why row i is not fine."""
        if self._rate_ticks[i] >= RATE_PERSISTENCE:
            text = f"torque rate limit: above {self._rate:g} Nm/s for {RATE_PERSISTENCE} ticks"
            return Broken(i, Ended.TORQUE_RATE, text)
        nv = self._effort.shape[1]
        late = np.flatnonzero(self._ticks[i] >= self._persistence)
        return None if not len(late) else self._lasting(i, *divmod(int(late[0]), nv))

    def _lasting(self, i: int, kind: int, joint: int) -> Broken:
        """What joint `joint` of row i has asked, or done, for too long: 0 torque, 1 speed, 2 range."""
        limits = self._limits[i % len(self._limits)]
        name, sliding = limits.names[joint], limits.sliding[joint]
        nv, spell = len(limits.names), f"for {1e3 * MOTOR_S:.0f} ms"
        value, most = abs(self._now[i, (kind + 1) * nv + joint]), self._most[i, (kind + 1) * nv + joint]
        if kind == 0:
            unit = "N" if sliding else "Nm"
            text = f"motor limit: {name} at its {most:g} {unit} {spell}, the law asks for {value:.3g} {unit}"
            return Broken(i, Ended.MOTOR, text)
        unit = "m" if sliding else "rad"
        if kind == 1:
            text = f"joint speed limit: {name} at {value:.3g} {unit}/s, above its {most:g} {unit}/s, {spell}"
            return Broken(i, Ended.SPEED, text)
        end = self._middle[i, joint] + np.copysign(most - RANGE_SLACK, self._now[i, 3 * nv + joint])
        return Broken(i, Ended.RANGE, f"joint range: {name} pressed against its end at {end:.3g} {unit} {spell}")

    def shares(self) -> tuple[Float, NDArray[np.object_]]:
        """Largest shares so far of torque, speed and range (3, N), and the joints' names (3, N).

        NaN and "" where no limit is given. The torque is what the law asks for, so that a share above 1 tells how much
        a motor was short of.
        """
        rows, _, nv = self._whole.shape
        share = self._peak[:, nv:].reshape(rows, 3, nv) / self._whole
        share[np.isinf(self._whole)] = -1.0
        worst = np.argmax(share, axis=-1)
        most = np.take_along_axis(share, worst[..., None], axis=-1)[..., 0]
        names = np.array([one.names for one in self._limits], dtype=object)
        joints = names[(np.arange(rows) % len(names))[:, None], worst]
        known = most >= 0.0  # nor of a trial that diverged
        return np.where(known, most, np.nan).T, np.where(known, joints, "").T
