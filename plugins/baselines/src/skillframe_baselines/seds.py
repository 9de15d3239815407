r"""SEDS: a stable dynamical system of the pose, followed to the demonstrated goal.

    x' = sum_k h_k(x) A_k x,    h_k ~ pi_k N(x; mu_k, Sigma_k),    A_k + A_k^T < 0

(Khansari-Zadeh and Billard 2011), x the state of `common` over its spread, the goal at 0. It is integrated from the
measured start without feedback of the pose, because a tool blocked by contact would otherwise never push. Velocities
above those demonstrated are scaled down, which keeps the paths and the Lyapunov function. It has no wrench profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError, MissingDependency
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, Pose, move_twist, norm, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_baselines import align
from skillframe_baselines.common import (
    RATE,
    SETTLE,
    Following,
    array,
    body,
    following_words,
    goal_model,
    goal_of,
    phase_of,
    point_offset,
    pose_of,
    settings_and_frame,
    state_of,
)
from skillframe_baselines.dynamics import Dynamics, Flow

NEAR = np.array([5e-4] * 3 + [5e-3] * 3)  # m, rad: tolerance of the goal


@dataclass(frozen=True, slots=True, kw_only=True)
class SedsSettings(Following):
    """Settings of the learner.

    Attributes:
        most_components: BIC chooses among 1 to this many.
    """

    most_components: int = 4


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a SEDS document.

    Raises:
        InputError: no demonstration, or unsuitable demonstrations or settings.
        MissingDependency: `casadi` is not installed.
    """
    try:
        from skillframe_baselines.seds_fit import fit
    except ModuleNotFoundError as error:
        if error.name != "casadi":
            raise
        raise MissingDependency("casadi", "learning a seds", "pip install 'skillframe-baselines[seds]'") from None
    settings, frame = settings_and_frame("seds", SedsSettings, demonstrations, options)
    if settings.most_components < 1:
        raise InputError("seds settings.most_components", "must be 1 or more", "correct it")
    recorded = align.recorded(demonstrations, np.array(frame["learned_at"]))
    scale, states, velocities = samples_of(recorded)
    dynamics = fit(states, velocities, settings.most_components)
    fastest = max(float(norm(np.gradient(s / scale, axis=0) * RATE).max()) for s in recorded.state)
    model = {**goal_model(recorded.goal), "scale": scale.tolist(), "fastest": fastest}
    model |= {name: getattr(dynamics, name).tolist() for name in dynamics._fields}
    longest = max(float(time[-1]) for time in recorded.time)
    return body("seds", frame, settings, model, 5.0 * longest + SETTLE)


def samples_of(recorded: align.Recorded) -> tuple[Float, Float, Float]:
    """Scale (6,), scaled states (n, 6) and their velocities [1/s]."""
    least = np.array([0.005] * 3 + [0.05] * 3)  # m, rad: least spread of a coordinate
    scale = np.maximum(np.sqrt(np.mean(np.concatenate(recorded.state) ** 2, axis=0)), least)
    states, velocities = list[Float](), list[Float]()
    for state in recorded.state:  # at most 150 samples of each demonstration, evenly over time
        index = np.unique(np.linspace(0, len(state) - 1, 150).round().astype(int))
        states.append((state / scale)[index])
        velocities.append((np.gradient(state / scale, axis=0) * RATE)[index])
    return scale, np.concatenate(states), np.concatenate(velocities)


def dynamics_of(document: Document) -> Dynamics:
    """The dynamics of a document.

    Raises:
        InputError: a part is missing, or the system is not stable.
    """
    priors = array(document, "priors", None)
    count = len(priors)
    matrices = array(document, "matrices", count, 6, 6)
    covariances = array(document, "covariances", count, 6, 6)
    if np.linalg.eigvalsh(matrices + np.swapaxes(matrices, 1, 2)).max() >= 0.0:
        raise InputError("model.matrices", "are not stable: A + A^T has an eigenvalue >= 0", "learn the skill again")
    if priors.min() <= 0.0 or np.linalg.eigvalsh(covariances).min() <= 0.0:
        raise InputError("model", "priors and covariances must be positive (definite)", "learn the skill again")
    return Dynamics(priors, array(document, "means", count, 6), covariances, matrices)


class Seds(Skill):
    """The system integrated from the measured start.

    Args:
        flow: velocity of scaled states.
        scale: (6,) divisor of states.
        fastest: largest norm of the scaled velocity [1/s].
        goal: pose of the learning point.
        offset: (3,) centre of compliance minus learning point, tool frame.
        impedance: stiffness.
        stop: time limit [s].
    """

    def __init__(
        self, flow: Flow, scale: Float, fastest: float, goal: Pose, offset: Float, impedance: Impedance, stop: float
    ) -> None:
        self._flow, self._scale, self._fastest = flow, scale, fastest
        self._goal, self._offset, self._impedance, self._stop = goal, offset, impedance, stop

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin at the measured pose."""
        home = Pose(observation.pose.position, observation.pose.rotation).at(-self._offset)
        self._state: Float = state_of(home, self._goal) / self._scale
        self._began, self._before = observation.time.copy(), observation.time.copy()
        self._arrived = np.full(len(observation.time), np.inf)

    def velocity(self, states: Float) -> Float:
        """Scaled velocities (N, 6), within demonstrated speeds."""
        flow = self._flow(states)
        result: Float = flow * np.minimum(1.0, self._fastest / np.maximum(norm(flow), 1e-12))[:, None]
        return result

    def advanced(self, states: Float, seconds: Float) -> Float:
        """Scaled states (N, 6) after `seconds` (N,), by second-order Runge-Kutta steps of at most 5 ms."""
        steps = max(int(np.ceil(float(seconds.max(initial=0.0)) / 0.005 - 1e-9)), 1)
        step = (seconds / steps)[:, None]
        for _ in range(steps):
            middle = states + 0.5 * step * self.velocity(states)
            states = states + step * self.velocity(middle)
        return states

    def step(self, observation: Observation) -> Command:
        """State of the system at this time."""
        self._state = self.advanced(self._state, observation.time - self._before)
        self._before = observation.time.copy()
        pose = pose_of(self._state * self._scale, self._goal)
        rate = self.velocity(self._state) * self._scale
        ahead = rotation_matrix((self._state * self._scale + 1e-3 * rate)[:, 3:]) @ self._goal.rotation
        turning = rotation_vector(ahead @ np.swapaxes(pose.rotation, -1, -2)) / 1e-3  # differences over 1 ms
        twist = np.concatenate([rate[:, :3], turning], axis=1)
        moved = pose.at(self._offset)
        near = np.all(np.abs(self._state * self._scale) < NEAR, axis=1)
        self._arrived = np.where(near, np.minimum(self._arrived, observation.time), self._arrived)
        settled = observation.time >= self._arrived + SETTLE
        late = observation.time - self._began >= self._stop
        reason = no_reasons(len(near))
        reason[late] = "the time for the learned motion is over"
        reason[settled] = "the demonstrated goal is reached"
        status = np.where(settled | late, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        twist = move_twist(twist, moved.position - pose.position)
        return Command(moved, twist, self._impedance, np.zeros_like(twist), status, reason)


def build(document: Document) -> Seds:
    """A runnable SEDS from its document.

    Raises:
        InputError: the document holds no usable, stable model or phase.
    """
    phase = phase_of(document, "seds")
    scale, fastest = array(document, "scale", 6), float(array(document, "fastest"))
    if scale.min() <= 0.0 or fastest <= 0.0:
        raise InputError("model", "scale and fastest must be positive", "learn the skill again")
    return Seds(
        Flow(dynamics_of(document)), scale, fastest, goal_of(document), point_offset(document),
        Impedance(phase.gains), phase.stop.time,
    )  # fmt: skip


def describe(document: Document) -> list[str]:
    """The lines of its description."""
    phase, dynamics = phase_of(document, "seds"), dynamics_of(document)
    count = len(dynamics.priors)
    slowest = -0.5 * float(np.linalg.eigvalsh(dynamics.matrices + np.swapaxes(dynamics.matrices, 1, 2)).max())
    return [
        f"a stable dynamical system of {count} linear one{'s' * (count > 1)}; from anywhere it comes nearer to the "
        f"demonstrated goal, at {slowest:.2g} per second or faster",
        following_words(phase),
        "no wrench profile: the method knows no force",
    ]
