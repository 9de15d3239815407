r"""LMC skill for N trials: equation (2) with a limit on the lead.

    x_d = x_0 + s v_d,      s <- min(s + nu dt,  (x - x_0).v_d + L)               (2), with the limit L = F_lead / k
    R_d = exp(theta w_d) R_0,      theta <- theta + lambda dt - max(0, (error about w_d) - L_o)

Without the limit a blocked tool would push with K nu t. The controller designs the damping. The phase ends with SUCCESS
where the push has come to rest, with FAILURE at a limit of force, time or travel. A trial's commands do not depend, to
the last bit, on the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.document import read_frame
from skillframe.extend import Document
from skillframe.frames import Float, Pose, dot, rotate, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of
from skillframe_lmc.phase import Part, Phase, read_phase
from skillframe_lmc.stall import StallWatch

RUNNING = int(Status.RUNNING)  # enumeration access is slow in the loop
PUSHING = 0.5  # of the lead limit: less is no push that could stall


def build(document: Document) -> LmcSkill:
    """The skill of a document.

    Raises:
        InputError: the document's phase is invalid.
    """
    return LmcSkill(read_phase(document), read_frame(document).from_start)


class LmcSkill(Skill):
    """One linear motion with compliance.

    Args:
        phase: the learned phase.
        in_start_attitude: directions refer to the tool's orientation at the start, not to base.
    """

    def __init__(self, phase: Phase, in_start_attitude: bool) -> None:
        self._phase, self._stop = phase, phase.stop
        self._in_start_attitude = in_start_attitude

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the measured pose as the first desired one, and rotate the directions into base."""
        n = len(rngs)
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._began = observation.time.copy()
        self._status = np.zeros(n, dtype=np.int64)
        self._reason = no_reasons(n)
        turn = self._home.rotation if self._in_start_attitude else np.broadcast_to(np.eye(3), (n, 3, 3))
        self._push = _Advance(self._phase.translation, turn, self._stop.lead_force_n)
        self._turn = _Advance(self._phase.rotation, turn, self._stop.lead_torque_nm)
        self._impedance = Impedance(self._stiffness(turn))
        self._twist = np.concatenate([self._push.velocity, self._turn.velocity], axis=1)
        self._nothing = np.zeros((n, 6))
        self._stall = StallWatch(self._stop)
        self._fresh: NDArray[np.bool_] | None = np.ones(n, dtype=bool)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        some = rows_of(observation, rows)
        fresh = LmcSkill(self._phase, self._in_start_attitude)
        fresh.start(some, rngs)
        for mine, theirs in (
            (self._home.position, fresh._home.position), (self._home.rotation, fresh._home.rotation),
            (self._began, fresh._began), (self._status, fresh._status), (self._reason, fresh._reason),
        ):  # fmt: skip
            mine[rows] = theirs
        self._push.replace(rows, fresh._push)
        self._turn.replace(rows, fresh._turn)
        self._twist = np.concatenate([self._push.velocity, self._turn.velocity], axis=1)
        if self._in_start_attitude:
            stiffness = self._impedance.stiffness.copy()
            stiffness[rows] = fresh._impedance.stiffness
            self._impedance = Impedance(stiffness)
        self._stall.forget(rows, some)
        self._fresh = np.zeros(len(self._status), dtype=bool) if self._fresh is None else self._fresh
        self._fresh[rows] = True

    def _stiffness(self, turn: Float) -> Float:
        """(6, 6) in base axes, or (N, 6, 6) where each trial started in its own orientation."""
        turn = turn if self._in_start_attitude else turn[:1]
        result = np.zeros((len(turn), 6, 6))
        back = np.swapaxes(turn, -1, -2)
        result[:, :3, :3] = turn @ self._phase.translation.stiffness @ back
        result[:, 3:, 3:] = turn @ self._phase.rotation.stiffness @ back
        result = 0.5 * (result + np.swapaxes(result, -1, -2))
        return result if self._in_start_attitude else result[0]

    def step(self, observation: Observation) -> Command:
        """Advance the desired pose and check for the end."""
        dt = observation.dt if self._fresh is None else np.where(self._fresh, 0.0, observation.dt)
        self._fresh = None
        travel = observation.pose.position - self._home.position
        pushing = self._push.advance(dt, dot(travel, self._push.direction))
        position = self._home.position + self._push.progress[:, None] * self._push.direction
        rotation, turning = self._home.rotation, None
        if self._turn.exists:
            rotation, turning = self._advance_rotation(observation, dt)
        self._judge(observation, travel, pushing if turning is None else pushing | turning)
        pose = Pose(position, rotation)
        return Command(pose, self._twist, self._impedance, self._nothing, self._status.copy(), self._reason.copy())

    def _advance_rotation(self, observation: Observation, dt: float | Float) -> tuple[Float, NDArray[np.bool_]]:
        wanted = self._turn.progress + self._turn.speed * dt
        desired = self._attitude(wanted)
        error = rotation_vector(desired @ np.swapaxes(observation.pose.rotation, -1, -2))
        pushing = self._turn.advance(dt, wanted - dot(error, self._turn.direction))
        return self._attitude(self._turn.progress), pushing

    def _attitude(self, angle: Float) -> Float:
        return rotation_matrix(angle[:, None] * self._turn.direction) @ self._home.rotation

    def _judge(self, observation: Observation, travel: Float, pushing: NDArray[np.bool_]) -> None:
        stop, elapsed = self._stop, observation.time - self._began
        stalled = self._stall.look(observation, pushing)
        force = observation.wrench[:, :3]
        over = dot(force, force) > stop.force_limit_n**2
        late = elapsed >= stop.time_limit_s
        far = dot(travel, travel) > stop.travel_limit_m**2
        if self._turn.exists:
            far |= np.abs(self._turn.progress) > stop.turn_limit_rad
        ending = (self._status == RUNNING) & (stalled | over | late | far)
        for i in np.flatnonzero(ending).tolist() if np.count_nonzero(ending) else ():
            self._status[i], self._reason[i] = self._verdict(
                i, bool(over[i]), bool(far[i]), bool(stalled[i]), travel[i], float(np.sqrt(dot(force, force)[i]))
            )

    def _verdict(self, i: int, over: bool, far: bool, stalled: bool, travel: Float, force: float) -> tuple[int, str]:
        stop = self._stop
        moved = 1e3 * float(np.sqrt(dot(travel[None], travel[None])[0]))
        if over:
            return Status.FAILURE, f"contact force {force:.0f} N above the limit of {stop.force_limit_n:.0f} N"
        if far:
            return Status.FAILURE, f"went {moved:.0f} mm from the start without coming to rest against anything"
        if stalled:
            return Status.SUCCESS, f"came to rest while pushing, {moved:.0f} mm from the start"
        if not (self._push.exists or self._turn.exists):
            return Status.SUCCESS, f"held for {stop.time_limit_s:.1f} s, there being no direction to push in"
        return Status.FAILURE, f"still under way after the time limit of {stop.time_limit_s:.1f} s"


class _Advance:
    """Progress of the desired pose along (or about) a direction, with a limited lead over the measured one.

    Attributes:
        direction: (N, 3) in base; zero if there is none.
        progress: (N,) s or theta [m or rad].
        velocity: (N, 3) desired.
    """

    def __init__(self, part: Part, turn: Float, push: float) -> None:
        self.exists = part.desired_direction is not None and part.speed > 0.0
        given = np.zeros(3) if part.desired_direction is None or not self.exists else part.desired_direction
        self.direction = rotate(turn, np.broadcast_to(given, (len(turn), 3)))
        self.speed = part.speed if self.exists else 0.0
        self.velocity = self.speed * self.direction
        self.progress = np.zeros(len(turn))
        stiffness = float(given @ part.stiffness @ given)
        self._limit = push / stiffness if stiffness > 0.0 else np.inf

    def advance(self, dt: float | Float, reached: Float) -> NDArray[np.bool_]:
        """Move on within the limit over `reached` (N,), and return which trials push."""
        if not self.exists:
            return np.zeros(len(self.progress), dtype=bool)
        self.progress = np.minimum(self.progress + self.speed * dt, reached + self._limit)
        pushing: NDArray[np.bool_] = self.progress - reached >= PUSHING * self._limit
        return pushing

    def replace(self, rows: NDArray[np.intp], other: _Advance) -> None:
        """Take over some trials from another that has only those."""
        for name in ("direction", "progress", "velocity"):
            values = getattr(self, name).copy()
            values[rows] = getattr(other, name)
            setattr(self, name, values)
