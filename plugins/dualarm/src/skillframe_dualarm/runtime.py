r"""Two arms under one impedance law, N trials at once.

Independent (as published, no central controller): each arm i obeys equation (1) at its own centre of compliance with

    F_i = K_i (x_d,i - x_i) - D v,     x_d,1 = x_0,1 + s v_d,    x_d,2 = x_0,2        s <- s + nu dt  (lead limited)

where K_i is zero along its compliant axes. If both arms are compliant along an axis, nothing holds the pair there: it
can turn or drift as a whole. Relative (ours; in the words of cooperative task space, Chiacchio, Chiaverini, Siciliano
1996): write the errors e_i = x_d,i - x_i as relative e_1 - e_2 and common (e_1 + e_2) / 2. Compliance is meant for the
first, so the second keeps the stiffness that was taken away, K_c = K - K_i, with damping D_c:

    F_i += K_c (e_1 + e_2) / 2 + D_c (de_1 + de_2) / 2

The same wrench on both arms does no work on relative motion, so alignment is as free as before. Each arm makes its
share of the motion. Every row is computed by itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.control.impedance import pose_error
from skillframe.extend.records import Document
from skillframe.frames import Float, Pose, rotate
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_dualarm.document import Arm, Phase, read_phase

TOWARDS = np.array([1.0, -1.0])  # the arms move towards each other
COMMON_DAMPING = np.array([50.0] * 3 + [3.0] * 3)  # [Ns/m, Nms/rad] ours: about critical for 600 N/m, 40 Nm/rad
PUSHING = 0.5  # of the lead: less is not yet a push that could stall


def build(document: Document) -> DualArm:
    """The coordinator of a document.

    Raises:
        InputError: the phase is not as it should be.
    """
    return DualArm(read_phase(document))


def stiffnesses(phase: Phase, arm: Arm, turn: Float) -> tuple[Float, Float]:
    """What an arm keeps and what compliance takes away, (N, 6, 6) each, base axes.

    Args:
        phase: the motion.
        arm: which of its parts give way.
        turn: (N, 3, 3) the arm's tool attitude at the start.
    """
    kept, taken = np.zeros((len(turn), 6, 6)), np.zeros((len(turn), 6, 6))
    parts = (
        (slice(0, 3), "translation", phase.compliant_translation, phase.stiffness),
        (slice(3, 6), "rotation", phase.compliant_rotation, phase.turn_stiffness),
    )
    for part, name, axes, k in parts:
        free = np.zeros((3, 3))
        if name in arm.compliant:
            free = sum((np.outer(a, a) for a in np.array(axes).reshape(-1, 3)), free)
        taken[:, part, part] = k * (turn @ free @ np.swapaxes(turn, -1, -2))
        kept[:, part, part] = k * np.eye(3) - taken[:, part, part]
    return kept, taken


class DualArm(Skill):
    """The coordinator. Observations and commands are (N, 2, ...).

    Args:
        phase: what the arms do.
    """

    def __init__(self, phase: Phase) -> None:
        self._phase = phase
        self._share = np.array([arm.share for arm in phase.arms])

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the measured poses as the first desired ones, and turn directions and axes into base."""
        n, phase = len(rngs), self._phase
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        forward = rotate(self._home.rotation[:, 0], np.broadcast_to(np.array(phase.desired_direction), (n, 3)))
        self._direction = TOWARDS[:, None] * forward[:, None]  # (N, 2, 3) where each arm's motion goes
        gains = [stiffnesses(phase, arm, self._home.rotation[:, i]) for i, arm in enumerate(phase.arms)]
        self._impedance = Impedance(np.stack([kept for kept, _ in gains], axis=1))
        self._common = 0.5 * (gains[0][1] + gains[1][1])  # (N, 6, 6), one for both arms
        scale = np.array([phase.stiffness] * 3 + [phase.turn_stiffness] * 3)
        self._common_damping = self._common * (COMMON_DAMPING / scale)
        self._twist = np.zeros((n, 2, 6))
        self._twist[..., :3] = phase.speed * self._share[:, None] * self._direction
        self._nothing = np.zeros((n, 2, 6))
        self._progress, self._status, self._reason = np.zeros(n), np.zeros(n, dtype=np.int64), no_reasons(n)
        self._began = observation.time[:, 0].copy()
        self._best, self._best_time = np.full(n, -np.inf), self._began.copy()
        self._first = True

    def step(self, observation: Observation) -> Command:
        """Advance the arms towards each other and look whether the phase has ended."""
        dt = 0.0 if self._first else observation.dt
        self._first = False
        travel = np.vecdot(observation.pose.position - self._home.position, self._direction)  # (N, 2)
        pushing = self._advance(dt, travel)
        ahead = (self._progress[:, None] * self._share)[..., None]
        pose = Pose(self._home.position + ahead * self._direction, self._home.rotation)
        extra = self._hold_common(pose, observation) if self._phase.mode == "relative" else self._nothing
        self._judge(observation.time[:, 0], travel.sum(-1), pushing)
        return Command(pose, self._twist, self._impedance, extra, self._status.copy(), self._reason.copy())

    def _advance(self, dt: float, travel: Float) -> NDArray[np.bool_]:
        """Move on, no arm's desired pose further ahead of it than the lead. Says who pushes."""
        lead = self._phase.lead_force_n / self._phase.stiffness
        moving = self._share > 0.0
        limit = ((travel + lead)[:, moving] / self._share[moving]).min(-1)
        self._progress = np.minimum(self._progress + self._phase.speed * dt, limit)
        behind = (self._progress[:, None] * self._share - travel)[:, moving].max(-1)
        pushing: NDArray[np.bool_] = behind >= PUSHING * lead
        return pushing

    def _hold_common(self, pose: Pose, observation: Observation) -> Float:
        """The wrench (N, 2, 6), one for both arms, against motion of the pair as a whole."""
        error = pose_error(pose, observation.pose).mean(1)
        slip = (self._twist - observation.twist).mean(1)
        wrench = (self._common @ error[..., None] + self._common_damping @ slip[..., None])[..., 0]
        result: Float = np.repeat(wrench[:, None], 2, axis=1)
        return result

    def _judge(self, time: Float, approach: Float, pushing: NDArray[np.bool_]) -> None:
        """End the trials that have stalled or run out of time. The first reason stays."""
        phase = self._phase
        gained = (approach > self._best + phase.stall_m) | ~pushing
        self._best = np.where(gained, approach, self._best)
        self._best_time = np.where(gained, time, self._best_time)
        stalled = time - self._best_time >= phase.stall_s
        late = time - self._began >= phase.time_limit_s
        for i in np.flatnonzero((self._status == Status.RUNNING) & (stalled | late)).tolist():
            moved = f"{1e3 * approach[i]:.0f} mm closer than at the start"
            if stalled[i]:
                self._status[i], self._reason[i] = Status.SUCCESS, f"the arms came to rest while pushing, {moved}"
            else:
                text = f"still under way after {phase.time_limit_s:g} s, {moved}"
                self._status[i], self._reason[i] = Status.FAILURE, text
