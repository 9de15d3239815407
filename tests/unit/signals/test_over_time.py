"""The filter and smoother over time against filterpy's, which know nothing of our closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from skillframe.signals import WrenchFilter, WrenchModel, chunks, process_noise, transition


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_filter_and_smoother_over_time_are_those_of_filterpy(jitter: float) -> None:
    rng = np.random.default_rng(6)
    dt = 0.005
    time = np.cumsum(dt * (1.0 + jitter * rng.uniform(-1.0, 1.0, 120)))
    wrench = np.cumsum(rng.normal(size=(120, 6)), axis=0) * np.repeat([1.0, 0.05], 3)
    noise = np.array([0.3, 0.4, 0.5, 0.02, 0.03, 0.01])
    design = WrenchFilter(WrenchModel.from_corner(noise, np.array([3.0, 10.0, 20.0, 5.0, 8.0, 15.0]), dt), dt)
    steps = [dt, *np.diff(time)]
    fs = [np.kron(np.eye(6), transition(h)) for h in steps]
    qs = [np.zeros((12, 12)) for _ in steps]
    for q, h in zip(qs, steps, strict=True):
        for i, walk in enumerate(design.model.walk):
            q[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = process_noise(float(walk), h)
    kalman = design.kalman()
    kalman.x = np.kron(wrench[0], [1.0, 0.0])[:, None]
    means, covariances, _, _ = kalman.batch_filter(list(wrench[:, :, None]), Fs=fs, Qs=qs)
    smooth = kalman.rts_smoother(means, covariances, Fs=fs, Qs=qs)[0]
    np.testing.assert_allclose(design.filter(time, wrench), means[:, ::2, 0], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(design.smooth(time, wrench), smooth[:, ::2, 0], rtol=1e-7, atol=1e-8)  # 12x12 inverses


def test_chunks_hold_every_sample_once_with_what_surrounds_it() -> None:
    for count in (1, 10, 4000, 4001, 9000, 50_001):
        starts, rows = chunks(count)
        kept = [np.arange(a, min(count, a + 4000)) for a in starts]
        assert np.concatenate(kept).tolist() == list(range(count))
        assert all(set(own) <= set(row) for own, row in zip(map(tuple, kept), rows.tolist(), strict=True))
        assert rows.min() == 0 and rows.max() == count - 1
