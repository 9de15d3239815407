r"""Expectation maximisation over demonstrations of unequal length, and the number of phases.

Windows are correlated, so the emission is tempered in the E-step and the criterion, or phases would be found in the
noise of long recordings:

    eta = 0.3 clip(100 / mean windows per demonstration, 0.1, 1)          a demonstration counts as ~30 samples
    BIC = -2 L_eta + p ln(eta N),       p = K (2 m + m (m - 1) / 8) + K (K - 1)

Each number of phases starts from equal shares of time and from change points, and the better likelihood is kept.
Transitions stay at their prior until the motion has converged, then are fitted to the wrench in three rounds. Windows
that go round (see `rounds`) belong to the last phase only. The papers give no constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_segmenter import chain, changepoints, emission, transitions
from skillframe_segmenter.changepoints import Segments
from skillframe_segmenter.emission import DIMENSIONS, Observed, Phases
from skillframe_segmenter.features import Features
from skillframe_segmenter.settings import Settings

LEAK = 0.05
NEVER = -1e3  # log density of a phase that the user excluded for a window
Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """K phases in a chain.

    Attributes:
        phases: motion of each.
        initial: (K,) probabilities at the start.
        weights: (K, K, R) of the transitions.
        temper: eta.
    """

    phases: Phases
    initial: Float
    weights: Float
    temper: float

    @property
    def count(self) -> int:
        """K."""
        return len(self.initial)


class Data(NamedTuple):
    """All demonstrations, end to end, W windows in all.

    Attributes:
        seen: motions and contacts.
        regressors: (W, R) of the transitions.
        inside: (B, T) windows of each within the longest length.
        temper: eta.
        going: (W,) windows of the phase that goes round, the last; None without one.
        ruled: (W, K) added to log densities: `NEVER` where the user set another phase, or None.
    """

    seen: Observed
    regressors: Float
    inside: NDArray[np.bool_]
    temper: float
    going: NDArray[np.bool_] | None = None
    ruled: Float | None = None

    @property
    def straight(self) -> NDArray[np.bool_]:
        """(W,) windows that do not go round."""
        return np.ones(len(self.regressors), dtype=bool) if self.going is None else ~self.going

    @property
    def lengths(self) -> list[int]:
        """Windows of each demonstration."""
        return [int(n) for n in self.inside.sum(axis=1)]

    def split(self, values: NDArray[Scalar]) -> list[NDArray[Scalar]]:
        """Rows (W, ...) by demonstration."""
        return np.split(values, np.cumsum(self.lengths)[:-1])


class Expected(NamedTuple):
    """Probabilities, and the log densities (B, T, K) that they are from."""

    smoothed: chain.Smoothed
    densities: Float


class Fit(NamedTuple):
    """A fitted model, the posterior (W, K), tempered log-likelihood, criterion and E-step."""

    model: Model
    posterior: Float
    log_likelihood: float
    criterion: float
    expected: Expected


def gather(
    demonstrations: Sequence[Features], regressors: Sequence[Float], settings: Settings,
    going: Sequence[NDArray[np.bool_]] | None = None,
) -> Data:  # fmt: skip
    """Demonstrations as one set of data, with the windows `going` round, if that is a phase."""
    lengths = np.array([len(d.motion) for d in demonstrations])
    seen = emission.observe(
        np.concatenate([d.motion for d in demonstrations]), np.concatenate([d.contact for d in demonstrations])
    )
    straight = lengths if going is None else np.array([int((~each).sum()) for each in going])
    temper = settings.temper * float(np.clip(settings.temper_windows / max(straight.mean(), 1.0), 0.1, 1.0))
    inside = np.arange(lengths.max()) < lengths[:, None]
    return Data(seen, np.concatenate(regressors), inside, temper, None if going is None else np.concatenate(going))


def best(data: Data, segments: Segments, phases: int, settings: Settings) -> Fit:
    """The better of the two starts for a number of phases, motion only. `segments` exclude what goes round."""
    straight = data.straight
    others = phases - (data.going is not None)
    starts = [by_time([int(x.sum()) for x in data.split(straight)], others)]
    found = changepoints.grouped(segments, others)
    if found is not None and others > 1:
        starts.append(found)
    if data.going is not None:
        starts = [_placed(x, straight, phases - 1) for x in starts]
    return max((converge(data, leaky(x, phases), settings) for x in starts), key=lambda fit: fit.log_likelihood)


def by_time(lengths: Sequence[int], phases: int) -> NDArray[np.intp]:
    """Labels that cut every demonstration into equal stretches."""
    return np.concatenate([(np.arange(n) * phases) // max(n, 1) for n in lengths])


def leaky(labels: NDArray[np.intp], phases: int) -> Float:
    """Responsibilities (W, K) of hard labels, with `LEAK` for the others."""
    posterior = np.full((len(labels), phases), LEAK / phases)
    posterior[np.arange(len(labels)), labels] += 1.0 - LEAK
    return posterior


def _placed(labels: NDArray[np.intp], where: NDArray[np.bool_], other: int) -> NDArray[np.intp]:
    """Labels of some windows among all, the rest `other`."""
    result = np.full(len(where), other, dtype=np.intp)
    result[where] = labels
    return result


def converge(data: Data, posterior: Float, settings: Settings) -> Fit:
    """EM with constant transitions from responsibilities (W, K)."""
    count, phases = posterior.shape
    weights = transitions.prior_weights(phases, data.regressors.shape[1], settings.stay_s)
    constant = transitions.probabilities(weights, np.eye(data.regressors.shape[1])[-1])
    steps = _steps(data, np.broadcast_to(constant, (count, phases, phases)))
    log_likelihood, before = -np.inf, -np.inf
    for _ in range(60):
        model, residual = _maximise(data, posterior, weights)
        expected = _expect(data, model, steps, residual)
        posterior = expected.smoothed.posterior[data.inside]
        before, log_likelihood = log_likelihood, float(expected.smoothed.log_likelihood.sum())
        if abs(log_likelihood - before) < 1e-4 * abs(log_likelihood):
            break
    return _fit(data, model, posterior, log_likelihood, expected)


def with_transitions(data: Data, fit: Fit, settings: Settings) -> Fit:
    """The fit after the rounds that fit transitions."""
    model, prior = fit.model, transitions.prior_weights(fit.model.count, data.regressors.shape[1], settings.stay_s)
    posterior, log_likelihood = fit.posterior, fit.log_likelihood
    if model.count == 1:
        return fit
    entered = data.inside[:, 1:]
    inner = np.concatenate([np.arange(len(d)) > 0 for d in data.split(data.regressors)])
    steps = _steps(data, transitions.probabilities(model.weights, data.regressors))
    expected = fit.expected
    for _ in range(3):
        joint = chain.pairs(*expected, steps)[entered]
        weights = transitions.improve(model.weights, prior, data.regressors[inner], joint)
        model, residual = _maximise(data, posterior, weights)
        steps = _steps(data, transitions.probabilities(weights, data.regressors))
        expected = _expect(data, model, steps, residual)
        posterior = expected.smoothed.posterior[data.inside]
        log_likelihood = float(expected.smoothed.log_likelihood.sum())
    return _fit(data, model, posterior, log_likelihood, expected)


def log_densities(data: Data, model: Model, residual: Float | None = None) -> Float:
    """(W, K) tempered log densities with the user's exclusions, from residuals of `emission.fitted`."""
    result = model.temper * emission.log_likelihood(data.seen, model.phases, residual)
    if data.going is not None:
        result += NEVER * (data.going[:, None] != (np.arange(model.count) == model.count - 1))
    return result if data.ruled is None else result + data.ruled


def _maximise(data: Data, posterior: Float, weights: Float) -> tuple[Model, Float]:
    """Model of responsibilities (W, K), and residual motions (K, 6, W)."""
    k = posterior.shape[1]
    firsts = posterior[np.concatenate([[0], np.cumsum(data.lengths)[:-1]])]
    initial = 0.5 / k + 0.5 * firsts.mean(axis=0)
    if data.going is None:
        phases, residual = emission.fitted(data.seen, posterior)
    else:  # what goes round does not share its covariance
        parts = [emission.fitted(data.seen, mine) for mine in (posterior[:, :-1], posterior[:, -1:])]
        phases = Phases(*(np.concatenate(pair) for pair in zip(*(part for part, _ in parts), strict=True)))
        residual = np.concatenate([part for _, part in parts])
    return Model(phases=phases, initial=initial, weights=weights, temper=data.temper), residual


def _expect(data: Data, model: Model, steps: Float, residual: Float) -> Expected:
    densities = np.zeros((model.count, *data.inside.shape))
    densities[:, data.inside] = log_densities(data, model, residual).T
    densities = np.moveaxis(densities, 0, -1)
    return Expected(chain.smooth(model.initial, densities, steps), densities)


def _steps(data: Data, probabilities: Float) -> Float:
    """(B, T - 1, K, K) transitions into windows, from one row per window, the identity in padding."""
    k = probabilities.shape[-1]
    result = np.empty((k, k, *data.inside.shape))
    result[...] = np.eye(k)[:, :, None, None]
    result[:, :, data.inside] = np.moveaxis(probabilities, 0, -1)
    return np.moveaxis(result[..., 1:], (0, 1), (-2, -1))


def _fit(data: Data, model: Model, posterior: Float, log_likelihood: float, expected: Expected) -> Fit:
    k, m = model.count, DIMENSIONS
    parameters = k * (2 * m + 0.25 * m * (m - 1) / 2) + k * (k - 1)
    samples = max(data.temper * float(data.straight.sum()), 2.0)
    criterion = float(parameters * np.log(samples) - 2.0 * log_likelihood)
    return Fit(model, posterior, log_likelihood, criterion, expected)


def paths(data: Data, model: Model) -> list[NDArray[np.intp]]:
    """Most likely path of every demonstration."""
    densities = data.split(log_densities(data, model))
    steps = data.split(transitions.probabilities(model.weights, data.regressors))
    return [
        chain.most_likely_path(model.initial, density, step[1:]) for density, step in zip(densities, steps, strict=True)
    ]
