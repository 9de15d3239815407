r"""Dynamic movement primitives: a spring to the goal with a learned forcing term (Ijspeert et al. 2013, eq. 2.1).

    tau^2 y'' = alpha (beta (g - y) - tau y') + f(z),    f(z) = z sum_i w_i psi_i(z) / sum_i psi_i(z)

with alpha = 25, beta = 6.25 per degree of freedom of the state (`common`), learned by the library
`movement_primitives`, whose phase falls as z = exp(-alpha_z t / tau), to 0.01 at tau. Weights are averaged over aligned
demonstrations (`align`), which equals regression on all of them. The same basis functions give the wrench profile. Runs
integrate without the library, for all trials at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError, MissingDependency
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, Pose, move_wrench, norm, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_baselines import align
from skillframe_baselines.common import (
    SETTLE,
    Following,
    array,
    body,
    example_demonstration,
    following_words,
    goal_model,
    goal_of,
    phase_of,
    point_offset,
    pose_of,
    settings_and_frame,
    state_of,
)

ALPHA, BETA = 25.0, 6.25
STEP = 0.005  # s of integration; the spring's rate is 12.5 / tau


@dataclass(frozen=True, slots=True, kw_only=True)
class DmpSettings(Following):
    """Settings of the learner.

    Attributes:
        weights: basis functions per degree of freedom.
        regularization: of the ridge regression.
    """

    weights: int = 25
    regularization: float = 1e-6


class Basis:
    """Normalised Gaussians over the phase.

    Args:
        centers, widths: (W,) psi_i = exp(-widths_i (z - centers_i)^2).
        alpha_z: decay of the phase.
        tau: execution time [s].
    """

    def __init__(self, centers: Float, widths: Float, alpha_z: float, tau: float) -> None:
        self.centers, self.widths, self.alpha_z, self.tau = centers, widths, alpha_z, tau

    def phase(self, time: Float) -> Float:
        """Z at times (T,)."""
        result: Float = np.exp(-self.alpha_z * time / self.tau)
        return result

    def activations(self, time: Float) -> Float:
        """psi_i / sum psi at times (T,), (T, W)."""
        exponent = -self.widths * (self.phase(time)[:, None] - self.centers) ** 2
        psi = np.exp(exponent - exponent.max(1, keepdims=True))
        result: Float = psi / psi.sum(1, keepdims=True)
        return result


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a DMP's document.

    Raises:
        InputError: no demonstration, or unsuitable demonstrations or settings.
        MissingDependency: `movement_primitives` is not installed.
    """
    settings, frame = settings_and_frame("dmp", DmpSettings, demonstrations, options)
    if settings.weights < 2 or settings.regularization < 0.0:
        raise InputError("dmp settings", "weights must be 2 or more, regularization 0 or more", "correct them")
    common = align.aligned(align.recorded(demonstrations, np.array(frame["learned_at"])))
    try:
        from movement_primitives.dmp import DMP
    except ImportError:
        command = "pip install 'skillframe-baselines[dmp]'"
        raise MissingDependency("movement_primitives", "learning a dmp", command) from None
    tau = float(common.time[-1])
    weights = []
    for state in common.state:
        primitive = DMP(n_dims=6, execution_time=tau, n_weights_per_dim=settings.weights, alpha_y=ALPHA, beta_y=BETA)
        primitive.imitate(common.time, state.copy(), regularization_coefficient=settings.regularization)
        weights.append(primitive.forcing_term.weights_)
    term = primitive.forcing_term
    basis = Basis(np.array(term.centers), np.array(term.widths), float(term.alpha_z), tau)
    activations = basis.activations(common.time)
    ridge = activations.T @ activations + settings.regularization * np.eye(settings.weights)
    profile = np.linalg.solve(ridge, activations.T @ common.wrench.mean(0)).T
    model: dict[str, Any] = {
        **goal_model(common.goal), "tau": tau, "alpha_z": basis.alpha_z,
        "centers": basis.centers.tolist(), "widths": basis.widths.tolist(),
        "weights": np.mean(weights, axis=0).tolist(), "wrench_weights": profile.tolist(),
    }  # fmt: skip
    return body("dmp", frame, settings, model, 1.5 * tau + SETTLE)  # the spring at the end leaves exp(-6)


class Dmp(Skill):
    """A primitive per trial, from the tool's pose to the demonstrated goal.

    Args:
        basis: of the forcing term.
        weights: (6, W) of the forcing term.
        wrench_weights: (6, W) of the wrench profile, environment on tool at the learning point.
        goal: pose of the learning point.
        offset: (3,) centre of compliance minus learning point, tool frame.
        impedance: stiffness.
        gain: 1 to exert the wrench profile, 0 not to.
        blend: its rise time [s].
        stop: duration [s].
    """

    def __init__(
        self, basis: Basis, weights: Float, wrench_weights: Float, goal: Pose, offset: Float, impedance: Impedance, *,
        gain: float, blend: float, stop: float,
    ) -> None:  # fmt: skip
        self._basis, self._weights, self._goal, self._offset = basis, weights, goal, offset
        self._impedance, self._gain, self._blend, self._stop = impedance, gain, blend, stop
        grid = np.minimum(np.arange(round(stop / STEP) + 1) * STEP, basis.tau)
        self._wrench: Float = basis.activations(grid) @ wrench_weights.T

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Roll the primitive out from the measured pose."""
        self._began = observation.time.copy()
        home = Pose(observation.pose.position, observation.pose.rotation).at(-self._offset)
        pose = pose_of(self.rollout(state_of(home, self._goal)), self._goal)
        moved = pose.at(self._offset)
        self._position, self._rotation = moved.position, moved.rotation
        turn = rotation_vector(self._rotation[1:] @ np.swapaxes(self._rotation[:-1], -1, -2))
        rates = np.concatenate([np.diff(self._position, axis=0), turn], axis=-1) / STEP
        self._twist: Float = np.concatenate([rates, np.zeros_like(rates[:1])])

    def rollout(self, start: Float) -> Float:
        """States (T, N, 6) every `STEP`, from rest at (N, 6), by fourth-order Runge-Kutta steps."""
        count, tau = len(self._wrench), self._basis.tau
        times = np.arange(2 * count, dtype=np.float64) * (STEP / 2)
        force = (self._basis.activations(times) * self._basis.phase(times)[:, None]) @ self._weights.T

        def rate(y: Float, v: Float, f: Float) -> tuple[Float, Float]:
            return v, (ALPHA * (-BETA * y - tau * v) + f) / tau**2

        y, v = start.copy(), np.zeros_like(start)
        states = [y]
        for i in range(count - 1):
            before, middle, after = force[2 * i : 2 * i + 3]
            y1, v1 = rate(y, v, before)
            y2, v2 = rate(y + 0.5 * STEP * y1, v + 0.5 * STEP * v1, middle)
            y3, v3 = rate(y + 0.5 * STEP * y2, v + 0.5 * STEP * v2, middle)
            y4, v4 = rate(y + STEP * y3, v + STEP * v3, after)
            y = y + STEP / 6.0 * (y1 + 2.0 * y2 + 2.0 * y3 + y4)
            v = v + STEP / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
            states.append(y)
        return np.stack(states)

    def step(self, observation: Observation) -> Command:
        """The primitive's pose, twist and wrench at this time."""
        time = observation.time - self._began
        last, rows = len(self._position) - 1, np.arange(len(time))
        scaled = np.clip(time / STEP, 0.0, last)
        index = np.minimum(scaled.astype(int), last)
        after = STEP * (scaled - index)[:, None]
        twist = self._twist[index, rows]
        rotation: Float = rotation_matrix(after * twist[:, 3:]) @ self._rotation[index, rows]
        pose = Pose(self._position[index, rows] + after * twist[:, :3], rotation)
        risen = np.clip(time / self._blend, 0.0, 1.0)[:, None]
        lever = pose.position - pose.at(-self._offset).position
        wrench = move_wrench(self._wrench[index], lever)
        done = time >= self._stop
        reason = no_reasons(len(time))
        reason[done] = "the learned motion is over"
        status = np.where(done, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        return Command(pose, twist, self._impedance, -self._gain * risen * wrench, status, reason)


def build(document: Document) -> Skill:
    """A runnable DMP from its document.

    Raises:
        InputError: the document holds no usable model or phase.
    """
    phase = phase_of(document, "dmp")
    centers = array(document, "centers", None)
    count = len(centers)
    tau, alpha_z = float(array(document, "tau")), float(array(document, "alpha_z"))
    if not 0.0 < tau <= phase.stop.time or not alpha_z > 0.0:
        raise InputError(
            "model.tau", "tau and alpha_z must be positive, tau at most stop.time", "learn the skill again"
        )
    return Dmp(
        Basis(centers, array(document, "widths", count), alpha_z, tau),
        array(document, "weights", 6, count), array(document, "wrench_weights", 6, count), goal_of(document),
        point_offset(document), Impedance(phase.gains), gain=float(phase.feedforward), blend=phase.blend,
        stop=phase.stop.time,
    )  # fmt: skip


def describe(document: Document) -> list[str]:
    """The lines of its description."""
    phase, weights = phase_of(document, "dmp"), array(document, "weights", 6, None)
    goal = 1e3 * goal_of(document).position
    lines = [
        f"dynamic movement primitive of {float(array(document, 'tau')):.2f} s from wherever the tool is to the goal at "
        f"{goal[0]:+.0f}, {goal[1]:+.0f}, {goal[2]:+.0f} mm in base",
        f"{weights.shape[1]} basis functions per degree of freedom; forcing term of up to {norm(weights.T).max():.3g}",
        following_words(phase),
    ]
    return [*lines, "exert the learned wrench profile as well"] if phase.feedforward else lines


def example() -> Document:
    """A two-second primitive without forcing, to 50 mm below the example demonstration's start."""

    from skillframe.document import frame_of, new_document
    from skillframe.extend import registry

    demonstrations, count = [example_demonstration()], 3
    goal = Pose(demonstrations[0].position[-1], demonstrations[0].pose.rotation[-1])
    zero = np.zeros((6, count)).tolist()
    model = {
        **goal_model(goal), "tau": 2.0, "alpha_z": -float(np.log(0.01)), "centers": [1.0, 0.1, 0.01],
        "widths": [1.0, 10.0, 10.0], "weights": zero, "wrench_weights": zero,
    }  # fmt: skip
    made = body("dmp", frame_of(demonstrations, LearnOptions()), Following(), model, 3.0 + SETTLE)
    return new_document(registry().skill("dmp"), made, demonstrations)
