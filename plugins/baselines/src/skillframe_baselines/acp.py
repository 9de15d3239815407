r"""Estimator of an adaptive compliance policy: compliant along the demonstrated force, stiff across it.

With f the demonstrated force on the environment at a time, e = f / |f| and x the mean pose then,

    k(|f|) = k_stiff up to f_low, k_soft from f_high on, linear between              (1)
    K = k_stiff (I - e e^T) + k e e^T                                                (2)
    x_v = x + (1/k) (f - (f.v) v)                                                    (3)

v is the direction of motion, along which force is taken for friction (`friction_out`). At x, stiffness K towards the
virtual target x_v exerts f.

Hou et al. (2024), "Adaptive Compliance Policy" (arXiv:2410.09309); (1) and the removal in (3) follow their code. Their
network infers x, x_v and k from images and forces; here its training labels are played over a common clock (`align`).
Rotation is stiff.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, Pose, norm, quaternion_from_matrix
from skillframe.skill import Command, Impedance, Observation, Skill
from skillframe_baselines import align
from skillframe_baselines.common import (
    SETTLE,
    Following,
    array,
    body,
    goal_model,
    goal_of,
    phase_of,
    point_offset,
    pose_of,
    settings_and_frame,
)
from skillframe_baselines.replay import Motion, Replay, motion


@dataclass(frozen=True, slots=True, kw_only=True)
class AcpSettings(Following):
    """Settings of the learner, with `stiffness_translation` as k_stiff, and a stiff mean motion without `feedforward`.

    Attributes:
        soft: k_soft [N/m].
        force_low, force_high: forces between which the stiffness falls [N].
        friction_out: leave the force along the motion out of the virtual target.
    """

    soft: float = 200.0
    force_low: float = 0.5
    force_high: float = 5.0
    friction_out: bool = True


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a document: mean motion and wrench over time, and the estimator's constants.

    Raises:
        InputError: no demonstration, or unsuitable demonstrations or settings.
    """
    settings, frame = settings_and_frame("acp", AcpSettings, demonstrations, options)
    common = align.aligned(align.recorded(demonstrations, np.array(frame["learned_at"])))
    model: dict[str, Any] = {
        **goal_model(common.goal), "duration": float(common.time[-1]), "states": common.state.mean(0).tolist(),
        "wrenches": common.wrench.mean(0).tolist(), "soft": settings.soft,
        "forces": [settings.force_low, settings.force_high], "friction_out": float(settings.friction_out),
    }  # fmt: skip
    document = body("acp", frame, settings, model, float(common.time[-1]) + SETTLE)
    build(document)
    return document


class Estimator:
    """Equations (1) to (3), for N trials at once.

    Args:
        stiff, soft: k_stiff and k_soft [N/m].
        low, high: forces between which the stiffness falls [N].
        friction_out: leave the force along the motion out of the virtual target.
    """

    def __init__(self, stiff: float, soft: float, low: float, high: float, friction_out: bool) -> None:
        self.stiff, self.soft, self.low, self.high, self.friction_out = stiff, soft, low, high, friction_out

    def stiffness(self, force: Float) -> tuple[Float, Float]:
        """K (N, 3, 3) and k (N,) [N/m] of forces (N, 3) on the environment."""
        size = norm(force)
        k: Float = np.interp(size, [self.low, self.high], [self.stiff, self.soft])
        along = force / np.maximum(size, 1e-12)[:, None]
        outer = along[:, :, None] * along[:, None, :]
        return self.stiff * np.eye(3) - (self.stiff - k)[:, None, None] * outer, k

    def ahead(self, force: Float, k: Float, velocity: Float) -> Float:
        """Virtual target less reference (N, 3) [m], of forces (N, 3) and velocities (N, 3)."""
        speed, stands = norm(velocity)[:, None], 1e-3  # m/s; a slower reference has no direction of motion
        way = np.where(speed > stands, velocity / np.maximum(speed, stands), 0.0)
        kept = force - (force * way).sum(-1, keepdims=True) * way if self.friction_out else force
        result: Float = kept / k[:, None]
        return result


class Acp(Skill):
    """Absolute replay of the reference with its virtual target.

    Args:
        reference: replay of the mean motion and wrench.
        estimator: of stiffness and virtual target.
        rotation: stiffness [Nm/rad].
    """

    def __init__(self, reference: Replay, estimator: Estimator, rotation: float) -> None:
        self._reference, self._estimator, self._rotation = reference, estimator, rotation

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin at the measured pose."""
        self._reference.start(observation, rngs)
        self._began, self._slot = observation.time.copy(), np.full(len(rngs), -1)
        self._k = np.zeros(len(rngs))
        self._impedance = Impedance(np.zeros((len(rngs), 6, 6)))

    def step(self, observation: Observation) -> Command:
        """Virtual target and stiffness at this time."""
        played = self._reference.step(observation)
        force, velocity = played.feedforward[:, :3], played.twist[:, :3]
        hold = 0.05  # s between changes of stiffness, each of which makes the controller design its damping
        slot = ((observation.time - self._began) / hold + 1e-9).astype(int)
        over = slot != self._slot
        if over.any():  # equations (1) and (2)
            self._slot, stiffness = slot, self._impedance.stiffness.copy()
            stiffness[over, :3, :3], self._k[over] = self._estimator.stiffness(force[over])
            stiffness[over, 3:, 3:] = self._rotation * np.eye(3)
            self._impedance = Impedance(stiffness)
        target = Pose(played.pose.position + self._estimator.ahead(force, self._k, velocity), played.pose.rotation)
        return played._replace(pose=target, impedance=self._impedance, feedforward=np.zeros_like(played.feedforward))


def reference_of(document: Document) -> Motion:
    """Mean motion and wrench of the centre of compliance.

    Raises:
        InputError: the document holds none.
    """
    states = array(document, "states", None, 6)
    pose, duration = pose_of(states, goal_of(document)), float(array(document, "duration"))
    if not duration > 0.0:
        raise InputError("model.duration", "must be positive", "learn the skill again")
    trajectory = {
        "time": np.linspace(0.0, duration, len(states)), "position": pose.position,
        "quaternion": quaternion_from_matrix(pose.rotation), "wrench": array(document, "wrenches", len(states), 6),
    }  # fmt: skip
    return motion(trajectory, point_offset(document))


def estimator_of(document: Document) -> Estimator:
    """The estimator of a document.

    Raises:
        InputError: a constant is missing or invalid.
    """
    stiff, soft = phase_of(document, "acp").stiffness.translation, float(array(document, "soft"))
    low, high = array(document, "forces", 2)
    if not (0.0 < soft <= stiff and 0.0 <= low < high):
        problem = f"needs 0 < soft <= {stiff:g} (the stiffness across) and 0 <= force_low < force_high"
        raise InputError("acp settings", problem, "correct soft, force_low and force_high")
    return Estimator(stiff, soft, float(low), float(high), bool(array(document, "friction_out")))


def build(document: Document) -> Skill:
    """A runnable skill from its document.

    Raises:
        InputError: the document holds no usable model or phase.
    """
    phase = phase_of(document, "acp")
    reference = Replay(
        reference_of(document), absolute=True, turned=False, stiffness=phase.gains, feedforward=phase.feedforward,
        blend=phase.blend, stop=phase.stop.time,
    )  # fmt: skip
    return Acp(reference, estimator_of(document), phase.stiffness.rotation)


def describe(document: Document) -> list[str]:
    """The lines of its description."""
    estimator, reference = estimator_of(document), reference_of(document)
    return [
        f"the mean motion of {reference.duration:.2f} s, pulled by the mean force (largest "
        f"{norm(reference.wrench[:, :3]).max():.0f} N); the error of the start is blended away",
        f"soft along the force ({estimator.soft:g} N/m from {estimator.high:g} N on), stiff across it "
        f"({estimator.stiff:g} N/m); the goal stays where it was demonstrated, wherever the fixture is",
    ]
