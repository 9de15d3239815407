"""Plots of a run: what stands beside the curves where the trace is too coarse to hold it."""

import numpy as np
import pytest
from skillframe_reports.plots import run_plots

from skillframe.frames import norm
from tests.report_fakes import trace

SEEN = float(norm(trace().wrench_true[:, :3]).max())


def test_a_peak_between_two_samples_is_told_beside_the_force():
    force, *others = run_plots(trace(samples=401, peak_force_n=198.4))
    assert "peak of 198 N lies between samples, which are 10 ms apart" in str(force)
    assert "between samples" not in "".join(map(str, others))


@pytest.mark.parametrize("peak", [SEEN, np.nan, np.inf, None])
def test_a_peak_that_the_curve_shows_or_nobody_knows_is_not(peak):
    assert "between samples" not in str(run_plots(trace(peak_force_n=peak))[0])
