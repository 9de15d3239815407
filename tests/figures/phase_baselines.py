"""What phases are held against: force threshold, kernel change points, and a Gaussian hidden Markov model.

- Stops (zero velocity) are the plug-in's own `zvc`.
- Force threshold: cut where |F| crosses 5 N for three windows of 50 ms or more.
- Kernel change points, linear kernel: the exact least-cost cuts of the plug-in on OUR soft features, given our penalty;
  it can say where something changes, not which intervals are the same phase.
- Gaussian HMM: full covariances on standardised raw [v, w, F, T], transitions from counts, the number of phases GIVEN,
  started from equal shares of time, plain EM (Rabiner 1989).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from skillframe_segmenter import chain, changepoints, runs, zvc
from skillframe_segmenter.features import features, scales
from skillframe_segmenter.windows import Windows, cut_all

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm

Cuts = list[list[float]]
FORCE_N, ROUNDS, FLOOR, STAY = 5.0, 40, 1e-3, 0.95


def stops(demonstrations: Sequence[Demonstration], phases: int) -> Cuts:
    """Zero-velocity crossing."""
    return [row["boundaries"] for row in zvc.fit(demonstrations, None, {})["demonstrations"]]


def force_threshold(demonstrations: Sequence[Demonstration], phases: int) -> Cuts:
    """Crossings of 5 N."""
    cut, _ = cut_all(demonstrations, None, "base")
    return [_times(w, runs.without_short((norm(w.wrench[:, :3]) > FORCE_N).astype(np.intp), 3)) for w in cut]


def kernel_change_points(demonstrations: Sequence[Demonstration], phases: int) -> Cuts:
    """Least-cost cuts on our features."""
    cut, _ = cut_all(demonstrations, None, "base")
    seen = [features(w, s) for w, s in zip(cut, scales(cut), strict=True)]
    signals = [np.hstack([f.motion, 0.5 * f.contact]) for f in seen]
    return [w.edges(changepoints.cuts(x)) for w, x in zip(cut, signals, strict=True)]


def gaussian_hmm(demonstrations: Sequence[Demonstration], phases: int) -> Cuts:
    """Most likely paths of a Gaussian HMM with the number of phases given."""
    cut, _ = cut_all(demonstrations, None, "base")
    raw = [np.hstack([w.motion, w.wrench]) for w in cut]
    mean, spread = np.concatenate(raw).mean(axis=0), np.concatenate(raw).std(axis=0)
    signals = [(x - mean) / np.maximum(spread, 1e-9) for x in raw]
    posterior = [np.eye(phases)[(np.arange(len(x)) * phases) // len(x)] for x in signals]
    initial, stay = np.eye(phases)[0], (STAY - (1 - STAY) / max(phases - 1, 1)) * np.eye(phases)
    transition = stay + (1 - STAY) / max(phases - 1, 1)
    for _ in range(ROUNDS):
        density = _densities(signals, posterior)
        smoothed = [chain.smooth(initial, d[None], np.broadcast_to(transition, (1, len(d) - 1, phases, phases)))
                    for d in density]  # fmt: skip
        joint = sum(
            chain.pairs(s, d[None], np.broadcast_to(transition, (1, len(d) - 1, phases, phases))).sum(axis=(0, 1))
            for s, d in zip(smoothed, density, strict=True)
        )
        posterior = [s.posterior[0] for s in smoothed]
        initial = np.mean([p[0] for p in posterior], axis=0)
        transition = (joint + 1e-6) / (joint + 1e-6).sum(axis=1, keepdims=True)
    paths = [
        chain.most_likely_path(initial, d, np.broadcast_to(transition, (len(d) - 1, phases, phases)))
        for d in _densities(signals, posterior)
    ]
    return [_times(w, path) for w, path in zip(cut, paths, strict=True)]


def _densities(signals: Sequence[Float], posterior: Sequence[Float]) -> list[Float]:
    x, weight = np.concatenate(signals), np.concatenate(posterior)
    columns = []
    for k in range(weight.shape[1]):
        w = weight[:, k] / weight[:, k].sum()
        mean = w @ x
        covariance = ((x - mean) * w[:, None]).T @ (x - mean) + FLOOR * np.eye(x.shape[1])
        lower = np.linalg.cholesky(covariance)
        white = np.linalg.solve(lower, (x - mean).T)
        columns.append(-0.5 * (white * white).sum(axis=0) - np.log(np.diag(lower)).sum())
    return np.split(np.column_stack(columns), np.cumsum([len(s) for s in signals])[:-1])


def _times(cut: Windows, labels: np.ndarray) -> list[float]:
    return cut.edges([int(i) for i in runs.starts_of_runs(labels)[1:]])


BASELINES: dict[str, Callable[[Sequence[Demonstration], int], Cuts]] = {
    "stops (zvc)": stops,
    "force 5 N": force_threshold,
    "kernel change points": kernel_change_points,
    "Gaussian HMM, K given": gaussian_hmm,
}
