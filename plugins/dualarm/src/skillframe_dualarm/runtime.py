r"""Impedance control of two arms, N trials at once.

Independent (as published): each arm i obeys equation (1) at its own centre of compliance with

    F_i = K_i (x_d,i - x_i) - D v,     x_d,1 = x_0,1 + s v_d,    x_d,2 = x_0,2        s <- s + nu dt  (lead limited)

where K_i is zero along its compliant axes. If both are compliant along an axis, the pair can drift. Relative
(cooperative task space, Chiacchio, Chiaverini, Siciliano 1996): of the errors e_i = x_d,i - x_i, only e_1 - e_2 is
compliant; the common one keeps the stiffness K_c = K - K_i, with damping D_c:

    F_i += K_c (e_1 + e_2) / 2 + D_c (de_1 + de_2) / 2
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.extend import Document
from skillframe.frames import Float, Pose, dot, pose_error, rotate
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_dualarm.document import Arm, Phase, read_phase

TOWARDS = np.array([1.0, -1.0])  # the arms move towards each other
COMMON_DAMPING = np.array([50.0] * 3 + [3.0] * 3)  # [Ns/m, Nms/rad] critical for 600 N/m, 40 Nm/rad


def build(document: Document) -> DualArm:
    """The coordinator of a document.

    Raises:
        InputError: the phase is invalid.
    """
    return DualArm(read_phase(document))


def stiffnesses(phase: Phase, arm: Arm, turn: Float) -> tuple[Float, Float]:
    """Stiffness kept and removed by compliance, (N, 6, 6) each, base axes.

    Args:
        phase: the motion.
        arm: its compliant parts.
        turn: (N, 3, 3) the arm's tool orientation at the start.
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
    """Coordinator of observations and commands (N, 2, ...).

    Args:
        phase: of both arms.
    """

    def __init__(self, phase: Phase) -> None:
        self._phase = phase
        self._share = np.array([arm.share for arm in phase.arms])

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the measured poses as the first desired ones, and rotate directions and axes into base."""
        n, phase = len(rngs), self._phase
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        forward = rotate(self._home.rotation[:, 0], np.broadcast_to(np.array(phase.desired_direction), (n, 3)))
        self._direction = TOWARDS[:, None] * forward[:, None]  # (N, 2, 3) direction of each arm
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
        """Advance the arms towards each other and check for the end."""
        dt = 0.0 if self._first else observation.dt
        self._first = False
        travel = dot(observation.pose.position - self._home.position, self._direction)  # (N, 2)
        lead = self._phase.lead_force_n / self._phase.stiffness
        moving = self._share > 0.0
        limit = ((travel + lead)[:, moving] / self._share[moving]).min(-1)
        self._progress = np.minimum(self._progress + self._phase.speed * dt, limit)
        behind = (self._progress[:, None] * self._share - travel)[:, moving].max(-1)
        ahead = (self._progress[:, None] * self._share)[..., None]
        pose = Pose(self._home.position + ahead * self._direction, self._home.rotation)
        extra = self._nothing
        if self._phase.mode == "relative":  # a wrench against common motion, the same for both arms
            error = pose_error(pose, observation.pose).mean(1)
            slip = (self._twist - observation.twist).mean(1)
            common = (self._common @ error[..., None] + self._common_damping @ slip[..., None])[..., 0]
            extra = np.repeat(common[:, None], 2, axis=1)
        self._judge(observation.time[:, 0], travel.sum(-1), behind >= 0.5 * lead)  # less is no push that could stall
        return Command(pose, self._twist, self._impedance, extra, self._status.copy(), self._reason.copy())

    def _judge(self, time: Float, approach: Float, pushing: NDArray[np.bool_]) -> None:
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
