r"""SEDS: a stable dynamical system of the pose, followed from wherever the tool is to the demonstrated goal.

    x' = sum_k h_k(x) A_k x,    h_k ~ pi_k N(x; mu_k, Sigma_k),    A_k + A_k^T < 0

(Khansari-Zadeh and Billard 2011), x the state of `common` divided by its spread over the demonstrations, the goal at
0. The system is integrated from the measured start and gives the desired pose and twist; the measured pose is not fed
back, because under a contact it stands still and the system would never push (our choice, the one that lets SEDS exert
a force at all). Where it flows faster than any demonstration moved, its velocity is scaled down, which keeps its paths
and its Lyapunov function. It has no notion of force, so no wrench profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skillframe.config import build as configured
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, MissingDependency
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float, Pose, move_twist, norm, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_baselines import align
from skillframe_baselines.common import (
    Following,
    array,
    body,
    following_words,
    frame_in_base,
    goal_model,
    goal_of,
    phase_of,
    point_offset,
    pose_of,
    positive,
    state_of,
)  # fmt: skip
from skillframe_baselines.document import RATE, SETTLE

SLOWEST = 0.2  # 1/s, eps: the least rate at which every component approaches the goal (our choice)
LONGEST_STEP = 0.005  # s of integration
SAMPLES = 150  # per demonstration, for the fit
LEAST = np.array([0.005] * 3 + [0.05] * 3)  # m, rad: least spread that a coordinate is divided by
NEAR = np.array([5e-4] * 3 + [5e-3] * 3)  # m, rad: within this of the goal it has arrived
PATIENCE = 5.0  # times the demonstrations' duration, after which it ends where it is


@dataclass(frozen=True, slots=True, kw_only=True)
class SedsSettings(Following):
    """Settings of the learner.

    Attributes:
        most_components: BIC chooses among 1 to this many.
    """

    most_components: int = 4


class Dynamics(NamedTuple):
    """Priors (K,), means (K, d), covariances (K, d, d) and matrices (K, d, d) of scaled states, the goal at 0."""

    priors: Float
    means: Float
    covariances: Float
    matrices: Float


class Flow:
    """The velocity of dynamics, prepared for the loop."""

    def __init__(self, dynamics: Dynamics) -> None:
        self._means, self._matrices = dynamics.means, dynamics.matrices
        self._whiten = np.linalg.inv(np.linalg.cholesky(dynamics.covariances))
        determinant = np.log(np.einsum("kii->ki", self._whiten)).sum(1)
        self._constant: Float = np.log(dynamics.priors) + determinant

    def __call__(self, states: Float) -> Float:
        """Velocities (N, d) at states (N, d) [1/s]."""
        white = np.einsum("kij,nkj->nki", self._whiten, states[:, None] - self._means)
        logs = self._constant - 0.5 * (white**2).sum(-1)
        shares = np.exp(logs - logs.max(1, keepdims=True))
        shares /= shares.sum(1, keepdims=True)
        result: Float = np.einsum("nk,kij,nj->ni", shares, self._matrices, states)
        return result


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The body of a SEDS document.

    Raises:
        InputError: no demonstration, or demonstrations or settings that do not suit.
        MissingDependency: `casadi` is not installed.
    """
    try:
        from skillframe_baselines.seds_fit import fit
    except ModuleNotFoundError as error:
        if error.name != "casadi":
            raise
        raise MissingDependency("casadi", "learning a seds", "pip install 'skillframe-baselines[seds]'") from None
    settings = configured(SedsSettings, options.settings, "seds settings")
    frame = frame_in_base("seds", demonstrations, options)
    positive(settings, "seds")
    if settings.most_components < 1:
        raise InputError("seds settings.most_components", "must be 1 or more", "correct it")
    recorded = align.recorded(demonstrations, np.array(frame["learned_at"]))
    scale = np.maximum(np.sqrt(np.mean(np.concatenate(recorded.state) ** 2, axis=0)), LEAST)
    chosen = [_samples(state / scale) for state in recorded.state]
    states, velocities = (np.concatenate([part[i] for part in chosen]) for i in (0, 1))
    dynamics = fit(states, velocities, settings.most_components)
    fastest = max(float(norm(np.gradient(s / scale, axis=0) * RATE).max()) for s in recorded.state)
    model = {**goal_model(recorded.goal), "scale": scale.tolist(), "fastest": fastest}
    model |= {name: getattr(dynamics, name).tolist() for name in dynamics._fields}
    longest = max(float(time[-1]) for time in recorded.time)
    return body("seds", frame, settings, model, PATIENCE * longest + SETTLE)


def _samples(states: Float) -> tuple[Float, Float]:
    """States (n, d) and velocities, at most `SAMPLES` of them, evenly over time."""
    velocities = np.gradient(states, axis=0) * RATE
    index = np.unique(np.linspace(0, len(states) - 1, SAMPLES).round().astype(int))
    return states[index], velocities[index]


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
        scale: (6,) what states are divided by.
        fastest: largest norm of the scaled velocity [1/s].
        goal: pose of the learning point.
        offset: (3,) centre of compliance minus learning point, tool frame.
        impedance: how it is followed.
        stop: seconds after which it ends where it is.
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
        """Scaled velocities (N, 6), no faster than any demonstration."""
        flow = self._flow(states)
        result: Float = flow * np.minimum(1.0, self._fastest / np.maximum(norm(flow), 1e-12))[:, None]
        return result

    def advanced(self, states: Float, seconds: Float) -> Float:
        """Scaled states (N, 6) after `seconds` (N,), by Runge-Kutta steps of second order, each at most 5 ms."""
        steps = max(int(np.ceil(float(seconds.max(initial=0.0)) / LONGEST_STEP - 1e-9)), 1)
        step = (seconds / steps)[:, None]
        for _ in range(steps):
            middle = states + 0.5 * step * self.velocity(states)
            states = states + step * self.velocity(middle)
        return states

    def step(self, observation: Observation) -> Command:
        """Where the system has flowed to, for each trial."""
        self._state = self.advanced(self._state, observation.time - self._before)
        self._before = observation.time.copy()
        pose = pose_of(self._state * self._scale, self._goal)
        twist = self._twist(pose)
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

    def _twist(self, pose: Pose) -> Float:
        """Twist (N, 6) of the learning point: the turn between now and 1 ms on, per second."""
        rate = self.velocity(self._state) * self._scale
        ahead = rotation_matrix((self._state * self._scale + 1e-3 * rate)[:, 3:]) @ self._goal.rotation
        turning = rotation_vector(ahead @ np.swapaxes(pose.rotation, -1, -2)) / 1e-3
        return np.concatenate([rate[:, :3], turning], axis=1)


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


def check(document: Document) -> None:
    """Refuse a document that cannot be built, naming the key. Raises `InputError`."""
    build(document)


def describe(document: Document) -> list[str]:
    """A SEDS in words."""
    phase, dynamics = phase_of(document, "seds"), dynamics_of(document)
    count = len(dynamics.priors)
    slowest = -0.5 * float(np.linalg.eigvalsh(dynamics.matrices + np.swapaxes(dynamics.matrices, 1, 2)).max())
    return [
        f"a stable dynamical system of {count} linear one{'s' * (count > 1)}; from anywhere it comes nearer to the "
        f"demonstrated goal, at {slowest:.2g} per second or faster",
        following_words(phase),
        "no wrench profile: the method knows no force",
    ]
