"""Campaigns whose truth is known in closed form: the project's own draws, stop rule and summary, and no simulator.

The outcome of a trial is a coin of probability HIGH where both of its coordinates lie below their limits, else LOW. The
slow coordinate is the grid axis that changes last, or the one given axis; so the truth of the whole depends on what the
first trials never see. The second skill is the mirror image along the slow coordinate, and equally good.
"""

import heapq
from dataclasses import replace
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from skillframe.campaign import race, statistics, summary
from skillframe.campaign.sampling import Axis, draws, trial_rngs
from skillframe.campaign.spec import CampaignSpec, Stop

TRIALS, WIDTH = 120, 0.35
SLOW, FAST = "world.slow", "world.fast"
LIMIT, WIDER = 0.7, 0.9
QUICK_S, LONG_S = 1.0, 5.0  # a success ends early, a failure runs into the time limit
for name in ("clopper_pearson", "confidence_sequence", "mcnemar", "mcnemar_sequential"):
    setattr(statistics, name, cache(getattr(statistics, name)))  # the same few counts over thousands of campaigns
race.confidence_sequence = statistics.confidence_sequence


def uniform():
    return Axis(kind="uniform", numbers=(0.0, 1.0))


def sobol():
    return Axis(kind="sobol", numbers=(0.0, 1.0))


def grid(count):
    return Axis(kind="grid", numbers=tuple((np.arange(count) + 0.5) / count))


def values():
    return Axis(kind="values", numbers=tuple((np.arange(TRIALS) + 0.5) / TRIALS))


def choice():
    return Axis(kind="choice", numbers=tuple((np.arange(10) + 0.5) / 10))


def normal():
    return Axis(kind="normal", numbers=(0.5, 0.2))


KINDS = {
    "nothing varies": {},
    "uniform": {SLOW: uniform()},
    "normal": {SLOW: normal()},
    "choice": {SLOW: choice()},
    "values": {SLOW: values()},
    "grid": {SLOW: grid(60)},
    "grid, two runs of each cell": {SLOW: grid(30), FAST: grid(2)},
    "grid, two axes": {SLOW: grid(10), FAST: grid(12)},
    "sobol": {SLOW: sobol()},
    "sobol, two axes": {SLOW: sobol(), FAST: sobol()},
    "uniform x normal": {SLOW: uniform(), FAST: normal()},
    "choice x sobol": {SLOW: choice(), FAST: sobol()},
    "grid x uniform": {SLOW: grid(10), FAST: uniform()},
    "grid x sobol": {SLOW: grid(10), FAST: sobol()},
    "grid x choice": {SLOW: grid(10), FAST: choice()},
    "grid x values": {SLOW: values(), FAST: grid(2)},
    "values x uniform": {SLOW: values(), FAST: uniform()},
    "grid that does not divide the trials": {SLOW: grid(80)},
}
IN_ORDER = {kind for kind, vary in KINDS.items() if {"grid", "values"} & {axis.kind for axis in vary.values()}}
WAYS = ("complete", "stopped", "interrupted", "out of order", "cluster")


class Made(NamedTuple):
    """One synthetic campaign."""

    spec: CampaignSpec
    truth: float
    success: np.ndarray  # (2, n) of the two skills


def share_below(axis, limit):
    """Probability that the axis' value is below a limit, of its own law."""
    if axis is None:
        return 1.0
    if axis.kind in ("uniform", "sobol"):
        return limit
    if axis.kind == "normal":
        return float(norm.cdf(limit, *axis.numbers))
    return float(np.mean(np.array(axis.numbers) < limit))


@lru_cache(maxsize=1000)
def drawn(kind, seed):
    """The campaign, where each skill finds the conditions good, (2, n), and a number in [0, 1) for each, (2, n)."""
    vary, skills = KINDS[kind], ("a.skill.json", "b.skill.json")
    spec = CampaignSpec(name=kind, seed=seed, trials=TRIALS, robot="r", world="w", skills=skills, vary=vary)
    values = draws(spec, range(TRIALS))
    slow = values.get(SLOW, np.zeros(TRIALS))
    inside = values.get(FAST, np.zeros(TRIALS)) < WIDER
    mirror = 1.0 - slow if SLOW in vary else slow  # every axis here is symmetric about 1/2
    coins = np.array([rng.random(2) for rng in trial_rngs(seed, range(TRIALS))]).T
    return spec, np.array([inside & (slow < LIMIT), inside & (mirror < LIMIT)]), coins


@lru_cache(maxsize=1000)
def make(kind, seed, low=0.05, high=0.95):
    """A campaign of two skills of the same truth."""
    spec, good, coins = drawn(kind, seed)
    share = share_below(spec.vary.get(SLOW), LIMIT) * share_below(spec.vary.get(FAST), WIDER)
    return Made(spec, low + (high - low) * share, coins < np.where(good, high, low))


def rows_of(made, done):
    """Rows as a campaign stores them. Done is a list of (trial, skill)."""
    labels, success = made.spec.labels, made.success.tolist()
    return [{"trial": t, "skill": labels[k], "success": success[k][t], "failure": "stuck"} for t, k in sorted(done)]


def finished(made, workers, chunk, at):
    """(trial, skill) of the chunks that ended before a share of the time that all of them take.

    Chunks start in order and end as they end: one with failures takes longer.
    """
    trials = made.spec.trials
    jobs = [(range(f, min(f + chunk, trials)), k) for f in range(0, trials, chunk) for k in (0, 1)]
    free, ends = [0.0] * workers, []
    for part, k in jobs:
        lasts = sum(QUICK_S if made.success[k, t] else LONG_S for t in part)
        end = heapq.heappop(free) + lasts
        heapq.heappush(free, end)
        ends.append(end)
    moment = at(max(ends))
    return [(t, k) for (part, k), end in zip(jobs, ends, strict=True) if end <= moment for t in part]


def seen(kind, seed, way, **law):
    """What a user is shown of one campaign: (truth, skills, comparisons), as in summary.json."""
    rng = np.random.default_rng([seed, 99])
    made = make(kind, seed, **law)
    spec = replace(made.spec, stop=Stop(interval_width=WIDTH if way == "stopped" else None))
    everything = [(t, k) for t in range(made.spec.trials) for k in (0, 1)]
    if way == "interrupted":
        everything = everything[: 2 * int(rng.integers(1, made.spec.trials))]
    elif way == "out of order":
        everything = finished(made, 4, int(rng.integers(1, 9)), lambda last: rng.uniform(0.0, last))
    elif way == "cluster":  # a worker per trial, and Ctrl-C before the first failure has run into its time limit
        everything = finished(made, 2 * made.spec.trials, 1, lambda last: rng.uniform(QUICK_S, 0.99 * LONG_S))
    rows = rows_of(made, everything)
    rule = race.StopRule(spec)
    rule.add(rows[i] for i in rng.permutation(len(rows)))
    if rule.after is not None:
        rows = [row for row in rows if row["trial"] <= rule.after]
    complete = rule.after is not None or len(rows) == 2 * made.spec.trials
    return made.truth, summary.rates(spec, rows, complete), summary.comparisons(spec, rows, complete)


class Count(NamedTuple):
    """Of a number of campaigns: intervals of the first skill shown and missed, p-values shown and below 0.05."""

    intervals: int
    missed: int
    p_values: int
    significant: int


def count(kind, way, seeds, **law):
    """What a number of campaigns show."""
    shown = [seen(kind, seed, way, **law) for seed in seeds]
    intervals = [(truth, skills["a.skill.json"]["interval_95"]) for truth, skills, _ in shown]
    known = [(truth, bounds) for truth, bounds in intervals if bounds is not None]
    p_values = [pairs[0]["p_value"] for _, _, pairs in shown if pairs[0]["p_value"] is not None]
    missed = sum(not bounds[0] <= truth <= bounds[1] for truth, bounds in known)
    return Count(len(known), missed, len(p_values), sum(p < 0.05 for p in p_values))
