"""Present phase of a run or demonstration: the gate for a robot, the forward filter for a demonstration.

Both use windows of 50 ms, N trials at once. A phase takes over after `switch_windows` windows in a row above
`switch_posterior`, which ignores single odd windows, and only if it followed the present one in a demonstration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration
from skillframe.frames import Float, Pose, move_wrench, norm, rotate
from skillframe.skill import Observation
from skillframe_segmenter import emission, gate, transitions
from skillframe_segmenter.features import regressors, soft_pair
from skillframe_segmenter.model import PhaseModel
from skillframe_segmenter.segmentation import pose_regressors
from skillframe_segmenter.settings import WINDOW_S
from skillframe_segmenter.windows import Windows, windows

NOBODY = -1
SHARPER, FELT = 2.5, 1.0 / 3.0  # the filter's weight of a motion over the fit's, and a wrench's share of it
STILL = (4e-3, float(np.deg2rad(2.0)))  # m/s, rad/s


class Debounce:
    """Turns posteriors of windows into decisions, N trials."""

    def __init__(self, model: PhaseModel, count: int, longer: int = 0) -> None:
        self._bar, self._windows = model.switch_posterior, model.switch_windows + longer
        self._candidate = np.full(count, NOBODY)
        self.seen = np.zeros(count, dtype=np.intp)

    def decide(self, posterior: Float) -> NDArray[np.intp]:
        """The phase that has been probable for long enough (N,), or `NOBODY`, from the posterior (N, P)."""
        best = posterior.argmax(axis=1)
        sure = posterior[np.arange(len(best)), best] > self._bar
        self.seen = np.where(sure & (best == self._candidate), self.seen + 1, sure.astype(np.intp))
        self._candidate = np.where(sure, best, NOBODY)
        return np.where(self.seen >= self._windows, best, NOBODY)


class Asked(NamedTuple):
    """Result of the gate at the end of a window, N trials.

    Attributes:
        phase: (N,) the indicated phase, or `NOBODY`.
        posterior: (N, P).
        windows: (N,) since when it indicates that phase.
        still: (N,) the tool hardly moved since the last window.
    """

    phase: NDArray[np.intp]
    posterior: Float
    windows: NDArray[np.intp]
    still: NDArray[np.bool_]


class Gate:
    """The gate of `skillframe_segmenter.gate` on observations at the control rate.

    Args:
        model: the phases.
        center_of_compliance: (3,) point of the observed wrench in the tool frame.
    """

    def __init__(self, model: PhaseModel, center_of_compliance: Float) -> None:
        self._model = model
        self._shift = model.at - center_of_compliance
        self._moved = bool(np.abs(self._shift).max() > 1e-9)
        self._members = model.membership

    def start(self, observation: Observation) -> None:
        """Begin where the demonstrations began."""
        n, k = len(observation.time), len(self._model.phase_of)
        self._belief = np.tile(self._model.initial, (n, 1))
        self._sum, self._ticks = np.zeros((n, 6)), 0
        self._per_window = max(1, round(WINDOW_S / observation.dt))
        self._memory: list[Float] = []
        self._last = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._debounce = Debounce(self._model, n)
        self._home = observation.pose.rotation.copy() if self._model.axes == "phase_start" else None
        self.posterior = self._belief @ self._members
        assert k == len(self._members)

    def look(self, observation: Observation) -> Asked | None:
        """Take in one tick, with a result at the end of each window."""
        self._sum += observation.wrench
        self._ticks += 1
        if self._ticks < self._per_window:
            return None
        phi = self._regressors(self._sum / self._ticks, observation)
        self._sum, self._ticks = np.zeros_like(self._sum), 0
        self._memory = [*self._memory, phi][-self._model.gate.memory :]
        self._belief = gate.advance(
            self._model.gate, self._belief, sum(self._memory[1:], self._memory[0]) / len(self._memory)
        )
        self.posterior = self._belief @ self._members
        phase = self._debounce.decide(self.posterior)
        now = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        elapsed = self._per_window * observation.dt
        moved = norm(now.position - self._last.position)
        turned = norm((now.rotation - self._last.rotation).reshape(-1, 9)) / np.sqrt(2.0)
        self._last = now
        return Asked(
            phase, self.posterior, self._debounce.seen, ((moved < STILL[0] * elapsed) & (turned < STILL[1] * elapsed))
        )

    def believe(self, row: int, phase: int) -> None:
        """Set the belief of a trial that entered a phase for another reason."""
        mine = np.where(self._model.phase_of == phase, self._model.gate.share, 1e-6)
        self._belief[row] = mine / mine.sum()

    def _regressors(self, wrench: Float, observation: Observation) -> Float:
        rotation = observation.pose.rotation
        shift = rotate(rotation, np.broadcast_to(self._shift, (len(wrench), 3))) if self._moved else None
        if self._model.origin is not None:
            position = observation.pose.position if shift is None else observation.pose.position + shift
            return pose_regressors(position, rotation, self._model.origin)
        if shift is not None:
            wrench = move_wrench(wrench, shift)
        if self._home is not None:
            wrench = (wrench.reshape(-1, 2, 3) @ self._home).reshape(-1, 6)
        scales = self._model.scales
        return soft_pair(wrench, scales.force, scales.torque)


class Filter:
    """Forward algorithm on windows of demonstrations: motion given the wrench, and wrench.

    Without later windows, a motion counts 2.5 times as in the fit, and a wrench, which wanders with the teacher's aim,
    a third of that: with less, a tool held by friction in a compliant grip is late, with more, one that bounces.
    `follow` waits one window longer than the gate. Where poses drive the transitions, wrenches are no evidence.
    """

    def __init__(self, model: PhaseModel, count: int = 1) -> None:
        self._model, self._count = model, count
        self._belief: Float | None = None

    def step(self, motion: Float, wrench: Float, drive: Float | None = None) -> Float:
        """Posterior (N, P) after a window.

        Args:
            motion: (N, 6) velocity and angular velocity.
            wrench: (N, 6).
            drive: (N, R) regressors of the transitions, if not the wrench.
        """
        model = self._model
        contact = soft_pair(wrench, model.scales.force, model.scales.torque)
        seen = emission.observe(soft_pair(motion, model.scales.speed, model.scales.turning), contact)
        log_density = emission.log_likelihood(seen, model.phases)
        if model.origin is None:
            log_density = log_density + FELT * model.gate.log_evidence(contact)
        log_density = SHARPER * model.temper * log_density
        density = np.exp(log_density - log_density.max(axis=1, keepdims=True))
        if self._belief is None:
            ahead = np.tile(model.initial, (self._count, 1))
        else:
            steps = transitions.probabilities(model.weights, regressors(contact) if drive is None else drive)
            ahead = (self._belief[:, :, None] * steps).sum(axis=1)
        belief = ahead * density + 1e-300
        self._belief = belief / belief.sum(axis=1, keepdims=True)
        result: Float = self._belief @ model.membership
        return result


def drive_of(model: PhaseModel, cut: Windows) -> Float:
    """Regressors (W, R) of the transitions for a demonstration's windows."""
    if model.origin is not None:
        return pose_regressors(cut.position, cut.rotation, model.origin)
    return regressors(soft_pair(cut.wrench, model.scales.force, model.scales.torque))


def follow(model: PhaseModel, demonstration: Demonstration, by: str = "filter") -> list[tuple[float, int]]:
    """Phases of a demonstration as recognised online.

    Args:
        model: learned from other demonstrations of the task.
        demonstration: a new one.
        by: "filter", or "gate".

    Returns:
        Time of each switch and the new phase; the first entry is the start.
    """
    cut = windows(demonstration, model.at, model.axes)
    drive = drive_of(model, cut)
    averaged = gate.averaged(drive, model.gate.memory)
    watch, belief, debounce = (
        Filter(model),
        model.initial[None].copy(),
        Debounce(model, 1, 0 if by == "gate" else 1),  # windows that the filter waits beyond `switch_windows`
    )
    switches: list[tuple[float, int]] = []
    for i in range(cut.size):
        if by == "gate":
            belief = gate.advance(model.gate, belief, averaged[i : i + 1])
            posterior = belief @ model.membership
        else:
            posterior = watch.step(cut.motion[i : i + 1], cut.wrench[i : i + 1], drive[i : i + 1])
        phase = int(debounce.decide(posterior)[0])
        if phase != NOBODY and (not switches or model.successors[switches[-1][1], phase] > 0.0):
            switches.append((cut.start + (i + 1) * WINDOW_S, phase))
    return switches
