r"""Motor limits: joint torques limited in effort and rate, and joints checked for speed and range.

Torques, gravity included, are clipped to `effort`, then to `torque_rate_nm_s`. A trial ends after

- torque rate: `RATE_PERSISTENCE` ticks in a row above the limit (an impact saturates it only briefly);
- effort, speed: `MOTOR_S` above a joint's `effort` or `velocity`; drives can bear a short peak;
- range: `MOTOR_S` with a joint of the arm `RANGE_SLACK` beyond its range.

Zero or absent `effort` and `velocity` in a URDF mean no limit. The largest share of each limit is stored with its
joint: torque over `effort`, speed over `velocity`, and distance from the middle of the range over half of it.

`FrictionCompensation` adds nominal friction and damping of the joints to the torques of a controller that knows them,

    \(\tau_c = d \dot q + f \, \mathrm{clip}(\dot q / v_s, -1, 1)\) with \(v_s\) = 0.1 rad/s or m/s, which avoids
    chatter at rest.

Since \(|\tau_c - d \dot q| \le f\), a joint with nominal friction is never driven by it. The compensation is zero at
rest: a joint that sticks still needs f to start.

`InnerLoop` models an arm's own joint loop: delay, limited bandwidth, and a stiff servo, for each joint.

    position:  q_f'' = w^2 (q_cmd - q_f) - 2 zeta w q_f'            velocity:  q_f'' = w (q'_cmd - q_f')
    tau = M(q) [ q_f'' + 2 s (q_f' - q') + s^2 (q_f - q) ] + h(q, q')                                         (1)

Commands arrive `delay_ticks` late and are held between ticks, so the filter has an exact step. M and h are the nominal
robot's; `Motors` limits the torques. The servo's corner s sets how far the arm yields under load.
Makers do not publish w, zeta and s: the values of `skillframe.robot.interface` are guesses to be measured on the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import c_int64
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.control.ticks import compiled
from skillframe.frames import Float
from skillframe.robot.interface import LOOP_DAMPING, SERVO, Admittance
from skillframe.robot.model import RobotModel
from skillframe.robot.urdf import Joint, numbers
from skillframe.skill import Broken, Ended

RATE_PERSISTENCE = 20  # an impact saturates the limiter for 5 to 10 ms
MOTOR_S, RANGE_SLACK = 0.1, 1e-3  # s, ten times an impact; rad or m, more than rounding and noise


class JointLimits(NamedTuple):
    """Limits of one batch row, in the simulator's order of generalised velocities. Infinite where none is given.

    Attributes:
        names: (nv) of the joints.
        sliding: (nv) prismatic joints.
        effort: (nv,) [N m or N].
        velocity: (nv,) [rad/s or m/s].
        lower, upper: (nv,) [rad or m].
        ranged: (nv,) 1 where the URDF gives the range, else 0.
    """

    names: tuple[str, ...]
    sliding: tuple[bool, ...]
    effort: Float
    velocity: Float
    lower: Float
    upper: Float
    ranged: Float


def joint_limits(robot: RobotModel, engine: Any, arms: Sequence[NDArray[np.int64]] | None = None) -> list[JointLimits]:
    """URDF limits of the joints of each arm, or of the whole robot. Empty if it has no joints.

    `engine` orders the generalised velocities, `arms` lists those of each arm. Ranges of joints that carry no tool
    frame, such as a closed gripper's, are ignored.
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
    """URDF limits of a joint: effort and velocity, infinite where absent, and whether it has a range."""

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
    """Return sentences on joints without effort, velocity or range in the URDF."""
    model = robot.model
    moving = [robot.urdf.joints.get(model.names[i]) for i in range(1, model.njoints) if model.joints[i].nv == 1]
    given = {joint.name: (_given(joint), joint.type) for joint in moving if joint is not None}
    motors = [name for name, (limits, _) in given.items() if np.isinf(limits.effort) or np.isinf(limits.velocity)]
    ranges = [name for name, (limits, kind) in given.items() if not limits.ranged and kind != "continuous"]
    said = (
        (motors, "the URDF gives no effort or no velocity for {}; what it does not give counts as unlimited"),
        (ranges, "the URDF gives no range for {}; it counts as free within +-2 pi rad or +-10 m"),
    )
    few = [", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "") for names, _ in said]
    return [text.format(named) for named, (names, text) in zip(few, said, strict=True) if names]


class Motors:
    """The motors of N independent rows, which take `limits` in turn. `rate` is of joint torques [N m/s]."""

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
        """Whether any row currently exceeds a limit."""

    def held(self, torque: Float, velocity: Float, position: Float) -> Float:
        """Joint torques (N, nv) that the motors deliver for commanded torques and the joints' state."""
        if not self._begun:
            self._last[:], self._begun = torque, True
        self._asked[:] = torque
        self._speed[:] = velocity
        self._place[:] = position
        if self._above():
            over = np.abs(self._now) > self._most
            nv = torque.shape[1]
            torque = np.minimum(np.maximum(torque, -self._effort), self._effort)  # else it would count as too fast
            change = torque - self._last
            fast = np.abs(change) > self._most[:, :nv]
            self._ticks += 1
            self._ticks *= over[:, nv:]
            self._rate_ticks = (self._rate_ticks + 1) * fast.any(-1)
            self.counting = True
            if self._rate is not None:
                torque = np.where(fast, self._last + np.copysign(self._rate * self._dt, change), torque)
        elif self.counting:
            self._ticks[:], self._rate_ticks[:], self.counting = 0, 0, False
        self._last[:] = torque
        return torque

    def _above_in_numpy(self) -> int:
        np.subtract(self._asked, self._last, out=self._change)
        np.subtract(self._place, self._middle, out=self._place)
        size = np.abs(self._now)
        np.maximum(self._peak, size, out=self._peak)
        return int(np.count_nonzero(size > self._most))

    def fine(self) -> NDArray[np.bool_]:
        """Rows (N,) that exceed no limit for too long."""
        lasting: NDArray[np.bool_] = self._rate_ticks < RATE_PERSISTENCE
        lasting &= (self._ticks < self._persistence).all(-1)
        return lasting

    def broken(self, i: int) -> Broken | None:
        """The limit that row i broke."""
        if self._rate_ticks[i] >= RATE_PERSISTENCE:
            text = f"torque rate limit: above {self._rate:g} Nm/s for {RATE_PERSISTENCE} ticks"
            return Broken(i, Ended.TORQUE_RATE, text)
        nv = self._effort.shape[1]
        late = np.flatnonzero(self._ticks[i] >= self._persistence)
        if not len(late):
            return None
        kind, joint = divmod(int(late[0]), nv)
        limits, spell = self._limits[i % len(self._limits)], f"for {1e3 * MOTOR_S:.0f} ms"
        name, sliding = limits.names[joint], limits.sliding[joint]
        value, most = abs(self._now[i, (kind + 1) * nv + joint]), self._most[i, (kind + 1) * nv + joint]
        if kind == 0:
            unit = "N" if sliding else "Nm"
            text = f"motor limit: {name} at its {most:g} {unit} {spell}, the controller commands {value:.3g} {unit}"
            return Broken(i, Ended.MOTOR, text)
        unit = "m" if sliding else "rad"
        if kind == 1:
            text = f"joint speed limit: {name} at {value:.3g} {unit}/s, above its {most:g} {unit}/s, {spell}"
            return Broken(i, Ended.SPEED, text)
        end = self._middle[i, joint] + np.copysign(most - RANGE_SLACK, self._now[i, 3 * nv + joint])
        return Broken(i, Ended.RANGE, f"joint range: {name} pressed against its end at {end:.3g} {unit} {spell}")

    def shares(self) -> tuple[Float, NDArray[np.object_]]:
        """Largest shares so far of torque, speed and range (3, N), and the joints' names (3, N).

        NaN and "" where no limit is given. Torque is the commanded one, so a share above 1 shows what the motor lacked.
        """
        rows, _, nv = self._whole.shape
        share = self._peak[:, nv:].reshape(rows, 3, nv) / self._whole
        share[np.isinf(self._whole)] = -1.0
        worst = np.argmax(share, axis=-1)
        most = np.take_along_axis(share, worst[..., None], axis=-1)[..., 0]
        names = np.array([one.names for one in self._limits], dtype=object)
        joints = names[(np.arange(rows) % len(names))[:, None], worst]
        known = most >= 0.0  # false for a diverged trial too
        return np.where(known, most, np.nan).T, np.where(known, joints, "").T


SLOW = 0.1  # rad/s or m/s


class FrictionCompensation:
    """Friction compensation of N rows, each with the joints of one arm.

    `arms` lists the generalised velocities of each arm, which rows take in turn; None if rows have all of them.
    """

    def __init__(self, engine: Any, arms: Sequence[NDArray[np.int64]] | None, count: int) -> None:
        chosen = [np.arange(int(engine.nv))] if arms is None else arms
        turns = count // len(chosen)
        self._friction, self._damping = (
            np.tile(np.stack([np.array(values, dtype=float)[dofs] for dofs in chosen]), (turns, 1))
            for values in (engine.dof_frictionloss, engine.dof_damping)
        )

    def torque(self, velocity: Float) -> Float:
        """Torques (N, nv) to add at joint velocities (N, nv)."""
        along = np.minimum(np.maximum(velocity * (1.0 / SLOW), -1.0), 1.0)
        result: Float = self._damping * velocity + self._friction * along
        return result


LATE, STIFF = 2.0 * SERVO, SERVO**2
"""2 s and s^2 of (1)."""


class InnerLoop:
    """The loops of N independent arms with n joints each, at rest at `start` (N, n).

    `mass_matrix` returns (N, n, n) of the nominal robots.
    """

    def __init__(self, arm: Admittance, start: Float, mass_matrix: Callable[[], Float], dt: float) -> None:
        self._of_position = arm.kind == "position"
        w, self._mass_matrix = arm.bandwidth, mass_matrix
        # coefficients of (1): q_f'' combined with the servo's term in q_f'
        self._back, self._fade = (-w * w, LATE - 2.0 * LOOP_DAMPING * w) if self._of_position else (w, LATE - w)
        self._place, self._speed = start.copy(), np.zeros_like(start)
        still = start if self._of_position else self._speed
        self._line = np.tile(still, (arm.delay_ticks + 1, 1, 1))
        self._position, self._velocity = np.zeros((2, *start.shape))
        self._asked, self._torque = np.zeros((2, *start.shape, 1))
        self._tick = 0
        self._step = _exact_step(arm, dt)
        (a, b, u), (c, d, v) = self._step
        self._ask = compiled("inner", {
            "line": self._line, "position": self._position, "velocity": self._velocity, "place": self._place,
            "speed": self._speed, "asked": self._asked, "back": self._back, "fade": self._fade, "late": LATE,
            "stiff": STIFF, "a": a, "b": b, "u": u, "c": c, "d": d, "v": v, "of_position": int(self._of_position),
            "numbers": self._place.size,
        }, c_int64) or self._ask_in_numpy  # fmt: skip

    def torque(self, command: Float, position: Float, velocity: Float, bias: Float) -> Float:
        """Joint torques (N, n) for a command (N, n) of joint positions or velocities sent now.

        `bias` (N, n) are gravity, Coriolis and centrifugal torques of the nominal robots.
        """
        length = len(self._line)
        self._line[self._tick % length] = command
        if self._tick % 20 == 0:  # an arm hardly turns in 20 ms
            self._mass = self._mass_matrix()
        self._tick += 1
        self._position[:], self._velocity[:] = position, velocity
        self._ask(self._tick % length)  # the oldest: sent `delay_ticks` ago
        np.matmul(self._mass, self._asked, out=self._torque)
        torque: Float = self._torque[..., 0] + bias
        return torque

    def _ask_in_numpy(self, heard_at: int) -> int:
        heard, speed = self._line[heard_at], self._speed
        off = self._place - heard
        rate = self._back * (off if self._of_position else heard) + self._fade * speed
        self._asked[..., 0] = rate - LATE * self._velocity + STIFF * (self._place - self._position)
        (a, b, u), (c, d, v) = self._step
        if self._of_position:
            self._place[:], self._speed[:] = heard + a * off + b * speed, c * off + d * speed
        else:
            self._place[:], self._speed[:] = self._place + b * speed + u * heard, d * speed + v * heard
        return 0


def _exact_step(arm: Admittance, dt: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Rows (place, speed, command) of the filter's exact step for place and speed, with a position command of 0."""
    w = arm.bandwidth
    if arm.kind == "velocity":
        fade = float(np.exp(-w * dt))
        return (1.0, (1.0 - fade) / w, dt - (1.0 - fade) / w), (0.0, fade, 1.0 - fade)
    real, turn = LOOP_DAMPING * w, w * float(np.sqrt(1.0 - LOOP_DAMPING**2))
    fade, cosine, sine = float(np.exp(-real * dt)), float(np.cos(turn * dt)), float(np.sin(turn * dt)) / turn
    return (
        (fade * (cosine + real * sine), fade * sine, 0.0),
        (-fade * w * w * sine, fade * (cosine - real * sine), 0.0),
    )
