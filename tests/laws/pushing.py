"""A plain compliant push, the yardstick of the tests of loop, world and control: no plug-in, no learning, no chance."""

import numpy as np

from skillframe.frames import Pose, norm
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons

STIFFNESS, TURN_STIFFNESS = 1000.0, 20.0
FORCE_CAP = 20.0
STALL_S, STALL_M, STALL_RAD = 0.6, 1e-4, 1e-3


def impedance(free_axes=(), free_turns=(), stiffness=STIFFNESS, turn_stiffness=TURN_STIFFNESS):
    """Diagonal stiffness (6, 6), zero along the free axes "x", "y", "z"."""
    diagonal = np.array([stiffness] * 3 + [turn_stiffness] * 3)
    diagonal[["xyz".index(a) for a in free_axes]] = 0.0
    diagonal[[3 + "xyz".index(a) for a in free_turns]] = 0.0
    return np.diag(diagonal)


class Push(Skill):
    """Equation 2: x_d moves at `speed` along `direction` and leads the tool by at most `cap` newtons of spring force.

    Ends as a success when the tool has not moved for `STALL_S`; the scene's goal is the judge.
    """

    def __init__(self, direction, stiffness, speed=0.02, cap=FORCE_CAP, stall=True, damping=None):
        direction = np.asarray(direction, dtype=float)
        self.direction = direction / norm(direction)[..., None]
        self.stiffness, self.damping, self.speed, self.stall = stiffness, damping, speed, stall
        self.lead = cap / float(np.max(stiffness))

    def start(self, observation, rngs):
        count = len(rngs)
        self.position, self.rotation = observation.pose.position.copy(), observation.pose.rotation.copy()
        self.impedance, self.none = Impedance(self.stiffness, self.damping), no_reasons(count)
        self.zero, self.twist = np.zeros((count, 6)), np.zeros((count, 6))
        self.twist[:, :3] = self.speed * self.direction
        self.running = np.full(count, Status.RUNNING)
        self.anchor = np.concatenate([observation.pose.position, observation.pose.rotation[..., 2]], axis=-1)
        self.since = observation.time.copy()

    def step(self, observation):
        self.position = self.position + (self.speed * observation.dt) * self.direction
        lead = np.vecdot(self.position - observation.pose.position, self.direction)
        self.position = self.position - np.maximum(lead - self.lead, 0.0)[:, None] * self.direction
        status, reason = self._stalled(observation) if self.stall else (self.running, self.none)
        return Command(Pose(self.position, self.rotation), self.twist, self.impedance, self.zero, status, reason)

    def _stalled(self, observation):
        """Position and tool axis have stayed in a small box for `STALL_S`. Sensor noise alone is no motion."""
        now = np.concatenate([observation.pose.position, observation.pose.rotation[..., 2]], axis=-1)
        far = np.abs(now - self.anchor)
        moved = (far[:, :3] > 2.0 * STALL_M).any(-1) | (far[:, 3:] > 2.0 * STALL_RAD).any(-1)
        self.anchor = np.where(moved[:, None], now, self.anchor)
        self.since = np.where(moved, observation.time, self.since)
        done = observation.time - self.since > STALL_S
        if not done.any():
            return self.running, self.none
        reason = self.none.copy()
        reason[done] = "stalled"
        return np.where(done, Status.SUCCESS, Status.RUNNING), reason


class Hold(Skill):
    """Stay where the run started, plus an offset and a feed-forward. End with a status when told to."""

    def __init__(self, stiffness, offset=(0.0, 0.0, 0.0), feedforward=lambda time: np.zeros(6), damping=None, end=None):
        self.stiffness, self.offset, self.feedforward, self.damping, self.end = (
            stiffness,
            offset,
            feedforward,
            damping,
            end,
        )

    def start(self, observation, rngs):
        self.pose = Pose(observation.pose.position + np.array(self.offset), observation.pose.rotation.copy())
        self.impedance = Impedance(self.stiffness, self.damping)

    def step(self, observation):
        count, time = len(observation.time), observation.time[0]
        status, reason = np.zeros(count, dtype=int), no_reasons(count)
        if self.end is not None and time >= self.end[0]:
            status[:], reason[:] = self.end[1], self.end[2]
        push = np.broadcast_to(self.feedforward(time), (count, 6))
        return Command(self.pose, np.zeros((count, 6)), self.impedance, push, status, reason)


class Wrenches(Skill):
    """Constant wrenches (N, 6) in base, a stiffness (6, 6) about the attitude at the start, and a damping (6, 6)."""

    def __init__(self, wrenches, stiffness, damping):
        self.wrenches, self.impedance = wrenches, Impedance(stiffness, damping)

    def start(self, observation, rngs):
        self.rotation = observation.pose.rotation.copy()

    def step(self, observation):
        count = len(self.wrenches)
        pose, zero = Pose(observation.pose.position, self.rotation), np.zeros((count, 6))
        return Command(pose, zero, self.impedance, self.wrenches, np.zeros(count, dtype=int), no_reasons(count))
