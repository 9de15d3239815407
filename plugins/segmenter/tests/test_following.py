"""Which phase is it now: what the filter weighs by formula, and that it never goes back a way that nobody has shown."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
from scipy.stats import multivariate_normal
from skillframe_segmenter.features import soft_pair
from skillframe_segmenter.model import from_document
from skillframe_segmenter.observer import NOBODY, Debounce, Filter, follow
from skillframe_segmenter.segmentation import segment

from tests.figures import quasistatic as made


@cache
def learned():
    """A policy's model of lowering and sliding, and what taught it."""
    taught = [t.demonstration for t in made.demonstrations("ls", 12)]
    return from_document(segment(taught, None, {}, "wrench_hmm")["phase_model"]), taught


def test_a_motion_counts_two_and_a_half_times_and_a_wrench_a_third_of_that():
    """The first window: p(k) is initial(k) [N(u; M d_k, S_k) N(a; m_k, C_k)^(1/3)]^(2.5 eta), over their sum."""
    model = learned()[0]
    rng = np.random.default_rng(4)
    motion, wrench = 0.01 * rng.normal(size=(1, 6)), rng.normal(size=(1, 6))
    u, a = (
        soft_pair(motion, model.scales.speed, model.scales.turning)[0],
        soft_pair(wrench, model.scales.force, model.scales.torque)[0],
    )
    free = np.zeros((6, 6))
    for part in (slice(0, 3), slice(3, 6)):
        n = a[part] - (a[part] @ u[part]) / max(u[part] @ u[part], 0.25) * u[part]
        free[part, part] = np.eye(3) - np.outer(n, n)
    log = np.array([
        multivariate_normal.logpdf(u, free @ direction, covariance)
        + multivariate_normal.logpdf(a, mean, felt) / 3.0
        for direction, covariance, mean, felt in zip(
            model.phases.direction, model.phases.covariance, model.gate.mean, model.gate.covariance, strict=True
        )
    ])  # fmt: skip
    # a temper and a start with which the phases' shares differ by e at most, so that every factor shows
    model = replace(model, temper=0.4 / np.ptp(log), initial=np.full(len(log), 1.0 / len(log)))
    weight = model.initial * np.exp(2.5 * model.temper * (log - log.max()))
    found = Filter(model).step(motion, wrench)[0]
    np.testing.assert_allclose(found, weight / weight.sum() @ model.membership, rtol=1e-9)


def test_one_odd_window_makes_no_switch_and_two_alike_do():
    """Two trials side by side. A window that is not sure starts the count again."""
    debounce = Debounce(SimpleNamespace(switch_posterior=0.8, switch_windows=2), 2)
    sure = [np.eye(2)[[k, 1 - k]] * 0.8 + 0.1 for k in (0, 1, 0, 0)]
    asked = [debounce.decide(posterior).tolist() for posterior in sure]
    assert asked == [[NOBODY, NOBODY]] * 3 + [[0, 1]]
    assert debounce.decide(np.full((2, 2), 0.5)).tolist() == [NOBODY, NOBODY]
    assert debounce.decide(sure[0]).tolist() == [NOBODY, NOBODY]


def twice(one):
    """A demonstration that begins again where it has ended."""
    step = one.time[-1] - one.time[0] + one.time[1] - one.time[0]
    whole = {name: np.concatenate([getattr(one, name)] * 2) for name in ("quaternion", "wrench")}
    shift = one.position[-1] - one.position[0]
    return replace(
        one, time=np.concatenate([one.time, one.time + step]),
        position=np.concatenate([one.position, one.position + shift]), **whole,
    )  # fmt: skip


def test_there_is_no_way_back_that_nobody_has_shown():
    """Lowered, slid, and then lowered again: the second lowering is heard only where a demonstration did so."""
    model, taught = learned()
    again = twice(taught[0])
    for by in ("filter", "gate"):
        assert [phase for _, phase in follow(model, again, by)] == [0, 1]
    shown = model.successors.copy()
    shown[1, 0] = 1.0
    for by in ("filter", "gate"):
        assert [phase for _, phase in follow(replace(model, successors=shown), again, by)] == [0, 1, 0, 1]
