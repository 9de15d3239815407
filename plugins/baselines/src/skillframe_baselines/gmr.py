r"""Gaussian mixture regression: pose and wrench as the mean of a mixture over (t, y, F) given the time.

    y(t), F(t) = E[y, F | t] = sum_k h_k(t) (mu_k + Sigma_k,x t / Sigma_k,tt (t - mu_k,t)),   h_k ~ pi_k N(t; ...)

after Calinon, Guenter and Billard (2007), with the wrench F beside the pose y (`common`), on aligned demonstrations
(`align`). The mean motion is played as an absolute replay, since a motion over time alone has no start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, quaternion_from_matrix
from skillframe.skill import Skill
from skillframe_baselines import align, gmm
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
)
from skillframe_baselines.replay import Motion, Replay, motion

LEAST = np.array([0.05, *[1e-3] * 3, *[1e-2] * 3, *[0.5] * 3, *[0.05] * 3])
"""Least deviations that count as variation: s, m, rad, N, Nm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GmrSettings(Following):
    """Settings of the learner.

    Attributes:
        least_components, most_components: BIC chooses among these; fewer than five separate demonstrations rather than
            moments.
    """

    least_components: int = 5
    most_components: int = 16


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a GMR's document.

    Raises:
        InputError: no demonstration, or unsuitable demonstrations or settings.
    """
    settings, frame = settings_and_frame("gmr", GmrSettings, demonstrations, options)
    if not 1 <= settings.least_components <= settings.most_components:
        raise InputError("gmr settings", "need 1 <= least_components <= most_components", "correct them")
    common = align.aligned(align.recorded(demonstrations, np.array(frame["learned_at"])))
    rows = np.concatenate(
        [np.column_stack([common.time, y, w]) for y, w in zip(common.state, common.wrench, strict=True)]
    )
    samples = rows[np.argsort(rows[:, 0], kind="stable")]
    center, scale = samples.mean(0), np.maximum(samples.std(0), LEAST)
    mixture = gmm.scaled_back(
        gmm.select((samples - center) / scale, settings.most_components, settings.least_components), center, scale
    )
    duration = float(common.time[-1])
    model: dict[str, Any] = {**goal_model(common.goal), "duration": duration}
    model |= {name: getattr(mixture, name).tolist() for name in mixture._fields}
    return body("gmr", frame, settings, model, duration + SETTLE)


def mixture_of(document: Document) -> gmm.Mixture:
    """The mixture over (t, y, F) of a document.

    Raises:
        InputError: it is missing, or a covariance is not positive definite.
    """
    priors = array(document, "priors", None)
    count = len(priors)
    mixture = gmm.Mixture(priors, array(document, "means", count, 13), array(document, "covariances", count, 13, 13))
    if priors.min() <= 0.0 or any(np.linalg.eigvalsh(c).min() <= 0.0 for c in mixture.covariances):
        raise InputError("model", "priors and covariances must be positive (definite)", "learn the skill again")
    return mixture


def mean_motion(document: Document) -> Motion:
    """Conditional mean as a motion of the centre of compliance, at 100 Hz."""
    duration = float(array(document, "duration"))
    if not duration > 0.0:
        raise InputError("model.duration", "must be positive", "learn the skill again")
    time = np.linspace(0.0, duration, int(np.ceil(duration * RATE)) + 1)
    mean: Float = gmm.conditional_mean(mixture_of(document), time[:, None])
    pose = pose_of(mean[:, :6], goal_of(document))
    trajectory = {
        "time": time, "position": pose.position, "quaternion": quaternion_from_matrix(pose.rotation),
        "wrench": mean[:, 6:],
    }  # fmt: skip
    return motion(trajectory, point_offset(document))


def build(document: Document) -> Skill:
    """A runnable GMR from its document.

    Raises:
        InputError: the document holds no usable model or phase.
    """
    phase = phase_of(document, "gmr")
    return Replay(
        mean_motion(document), absolute=True, turned=False, stiffness=phase.gains, feedforward=phase.feedforward,
        blend=phase.blend, stop=phase.stop.time,
    )  # fmt: skip


def describe(document: Document) -> list[str]:
    """The lines of its description."""
    phase, mixture = phase_of(document, "gmr"), mixture_of(document)
    count = len(mixture.priors)
    lines = [
        f"the mean motion of a mixture of {count} Gaussian{'s' * (count > 1)} over time, pose and wrench, "
        f"{float(array(document, 'duration')):.2f} s; the error of the start is blended away",
        following_words(phase),
    ]
    return [*lines, "exert the mean wrench as well"] if phase.feedforward else lines
