r"""Success rate of a real robot from few real trials, each paired with a simulated one, and many simulated ones.

A real trial succeeds (y = 1) or fails (y = 0). A simulated trial of the same samples gives f, and a campaign the
simulation's rate m over the same distribution. For any weight w,

    x = y - w (f - m)                                                                                           (1)

has the mean theta, the real rate, and a smaller variance than y where simulation and robot fail at the same samples
(prediction-powered inference: Angelopoulos et al. 2023, Science 382; for robots: SureSim, arXiv 2510.04354). With
c = theta - w m, which is above -w, and a bet 0 < b < 1,

    M_n = prod_i ( 1 + b (y_i - w f_i - c) / (c + w) )                                                          (2)

is a nonnegative martingale of mean 1, as no factor is negative (betting: Waudby-Smith and Ramdas 2024, J. R. Stat.
Soc. B 86). So is its mean over `WEIGHTS` and `BETS`, fixed beforehand. It falls in theta and rises in m. By Ville's
inequality the least theta at which it is below 2 / alpha, for the lower end of an interval of m, is a lower bound at
all n at once. The upper bound is the lower bound of failing. w = 0 leaves the simulation out, so that a wrong one costs
little. The simulation is not assumed to be right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign import (
    Axis,
    CampaignSpec,
    ChunkJob,
    Interval,
    Stop,
    clopper_pearson,
    confidence_sequence,
    evaluate,
    is_trial,
    load,
)
from skillframe.errors import InputError
from skillframe_certify.engine import ends_of, rows_of_campaign
from skillframe_certify.real_trials import Real

WEIGHTS, BETS = np.linspace(0.0, 1.0, 5), np.geomspace(0.02, 0.98, 12)
SHARE = 0.1
"""Share of the level that the simulation's own rate may be wrong with."""
CHUNK = 100  # pairs that are simulated together
_PAIRS = np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])  # y and f


class Joined(NamedTuple):
    """Rate of the real robot.

    Attributes:
        counts: of pairs: both succeed, the robot alone, the simulation alone, none.
        simulated: successes and trials of the campaign.
        interval: of the real rate, from real and simulated trials.
        alone: of the real rate, from the real trials alone.
    """

    counts: tuple[int, int, int, int]
    simulated: tuple[int, int]
    interval: Interval
    alone: Interval

    @property
    def worth(self) -> float:
        """Number of real trials whose own interval would be as narrow, if the width falls as their root."""
        return sum(self.counts) * (self.alone.width / self.interval.width) ** 2


def joined(counts: tuple[int, int, int, int], simulated: tuple[int, int], alpha: float = 0.05) -> Joined:
    """Interval of level 1 - alpha that holds at all numbers of pairs at once, for a fixed number of simulated trials.

    Args:
        counts: of pairs: both succeed, the robot alone, the simulation alone, none.
        simulated: successes and trials of a campaign of independent samples.
        alpha: probability that the real rate is ever outside.
    """
    both, real, only, none = counts
    rate = clopper_pearson(*simulated, SHARE * alpha)
    rest = (1.0 - SHARE) * alpha / 2.0
    low = _lower(np.array([both, real, only, none]), rate.low, rest)
    high = 1.0 - _lower(np.array([none, only, real, both]), 1.0 - rate.high, rest)
    return Joined(counts, simulated, Interval(low, high), confidence_sequence(both + real, sum(counts), alpha))


def _lower(counts: NDArray[np.int64], simulated: float, alpha: float) -> float:
    """The least theta at which the mean of (2) is below 1 / alpha. Counts (4,) are as of `log_mean`."""
    from scipy.optimize import brentq

    def excess(theta: float) -> float:
        return log_mean(counts, theta, simulated) + math.log(alpha)

    least, most = 1e-9, 1.0 - 1e-9
    if excess(least) <= 0.0:
        return 0.0
    return float(brentq(excess, least, most, xtol=1e-9)) if excess(most) < 0.0 else 1.0


def log_mean(counts: NDArray[np.int64], theta: float, simulated: float) -> float:
    """Logarithm of the mean of (2) over weights and bets.

    Args:
        counts: (4,) pairs with (y, f) = (1, 1), (1, 0), (0, 1), (0, 0).
        theta: assumed real rate.
        simulated: the simulation's rate, m.
    """
    c = theta - WEIGHTS * simulated
    gain = (_PAIRS[:, :1] - WEIGHTS * _PAIRS[:, 1:] - c) / (c + WEIGHTS)
    logs = counts @ np.log1p(BETS[:, None, None] * gain)
    most = logs.max()
    return float(most + math.log(np.exp(logs - most).mean()))


def join(folder: Path, real: Sequence[Real]) -> Joined:
    """Join real trials with a campaign: simulate a pair of each, and read the campaign's own rate.

    Args:
        folder: of a finished campaign of one skill, whose `[vary]` is the distribution of the real trials' samples.
        real: trials of one skill. Their samples are those of the campaign's quantities that were set, in SI; a pair
            draws the others.

    Raises:
        InputError: the campaign is unfinished, of several skills or no sample; samples are unknown or out of range; a
            pair starts in collision.
    """
    spec = load(folder)
    if len(spec.skills) != 1:
        raise InputError(folder, f"ran {len(spec.skills)} skills", "give a campaign of the skill that ran on the robot")
    if spec.plan.in_order or spec.plan.sobol:
        raise InputError(folder, "has samples that are not independent", "vary by uniform, normal or choice")
    _check_samples(spec, real)
    works, none = ends_of(rows_of_campaign(folder))
    pairs = _pairs(spec, real)
    won = np.array([each.success for each in real])
    counts = [int(np.sum((won == y) & (pairs == f))) for y in (True, False) for f in (True, False)]
    return joined((counts[0], counts[1], counts[2], counts[3]), (int(works.sum()), int((~none).sum())))


def _check_samples(spec: CampaignSpec, real: Sequence[Real]) -> None:
    for each in real:
        where = f"trial {each.trial} of {each.skill}"
        if not set(each.draws) <= set(spec.vary):
            told, asked = (", ".join(names) or "none" for names in (each.draws, spec.vary))
            raise InputError(where, f"gives the samples {told}; the campaign varies {asked}",
                             "enter the campaign's quantities that were set, in SI units")  # fmt: skip
        for name, value in each.draws.items():
            axis = spec.vary[name]
            if not can_draw(axis, value):
                raise InputError(where, f"{name} = {value:g} is no sample of {axis.plain()}",
                                 "give the campaign of the trials' own distribution, and SI units")  # fmt: skip


def can_draw(axis: Axis, value: float) -> bool:
    """Whether an independent axis can give a value, a normal one within six standard deviations."""
    if axis.kind == "choice":
        return value in axis.numbers
    first, second = map(float, axis.numbers)
    return abs(value - first) <= 6.0 * second if axis.kind == "normal" else first <= value <= second


def _pairs(spec: CampaignSpec, real: Sequence[Real]) -> NDArray[np.bool_]:
    """Whether each trial's simulated pair succeeds, (n,). The same numbers of trials give the same pairs."""
    axes = {name: Axis(kind="values", numbers=tuple(each.draws[name] for each in real)) for name in real[0].draws}
    seed = spec.seed + 1  # other noise than the campaign's own trials
    paired = replace(spec, vary={**spec.vary, **axes}, trials=len(real), seed=seed, stop=Stop(), race=None, scores=())
    works = []
    for first in range(0, len(real), CHUNK):
        trials = tuple(range(first, min(first + CHUNK, len(real))))
        job = ChunkJob(spec=paired.plain(), folder=str(spec.folder), skill=0, trials=trials)
        for number, row in zip(trials, evaluate.evaluate(job), strict=True):
            if not is_trial(row):
                raise InputError(f"trial {real[number].trial} of {real[number].skill}",
                                 "starts in collision in simulation", "check its samples")  # fmt: skip
            works.append(bool(row["success"]))
    return np.array(works)
