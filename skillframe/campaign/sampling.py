"""Draws as a pure function of (campaign, trial): reproducible one by one, in any order, on any number of workers.

Every independent quantity of every trial has a generator of its own,

    SeedSequence(seed, spawn_key=(trial, h(name))),   h = first 64 bits of SHA-256 of the quantity's name,

so that adding a quantity or a skill changes no other draw, and the order of calls does not matter. Grid axes are placed
by the trial's number (see `spec`), sobol axes by the trial's point of one scrambled Sobol sequence over all of them
(scipy's linear matrix scramble with a digital shift, seeded; no two points are independent): these two designs are
joint, so adding an axis to a design changes that design and nothing else. Sobol points have periods of two, four ...
Beside a grid or values axis, which may have the same, they are therefore shuffled over the campaign's trials: else a
cell of a grid of four meets only one half of the box. Keying by name rather than by call order is our choice, because
two skills that branch differently must still see the same trial (common random numbers halve the trials that a paired
comparison needs).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.axes import Value
from skillframe.campaign.spec import CampaignSpec
from skillframe.frames import Float

Draws = dict[str, NDArray[Any]]
RUN = "run"
"""Name under which a trial's own generator (sensor noise, random skills) is keyed."""


def seed_sequence(seed: int, trial: int, name: str) -> np.random.SeedSequence:
    """The seed sequence of one quantity in one trial."""
    key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.SeedSequence(seed, spawn_key=(trial, key))


def trial_rng(seed: int, trial: int) -> np.random.Generator:
    """The generator that a trial's run gets. Each call makes a fresh one."""
    return np.random.default_rng(seed_sequence(seed, trial, RUN))


def trial_rngs(seed: int, trials: Sequence[int]) -> list[np.random.Generator]:
    """`trial_rng` of several trials."""
    return [trial_rng(seed, trial) for trial in trials]


def draws(spec: CampaignSpec, trials: Sequence[int]) -> Draws:
    """The varied quantities of some trials.

    Args:
        spec: the campaign.
        trials: n trial numbers, in any order.

    Returns:
        quantity to (n,) array: float64, or the values' own type where a choice has other values than numbers.
    """
    placed = {**_grid(spec, trials), **_sobol(spec, trials)}
    return {name: placed[name] if name in placed else _independent(spec, name, trials) for name in spec.vary}


def _column(values: list[Value]) -> NDArray[Any]:
    alike = len({type(value) for value in values}) <= 1
    return np.array(values) if alike else np.array(values, dtype=object)


def _independent(spec: CampaignSpec, name: str, trials: Sequence[int]) -> NDArray[Any]:
    axis = spec.vary[name]
    if axis.kind == "values":
        return _column([axis.numbers[trial] for trial in trials])
    rngs = (np.random.default_rng(seed_sequence(spec.seed, trial, name)) for trial in trials)
    return _column([axis.draw(rng) for rng in rngs])


def _grid(spec: CampaignSpec, trials: Sequence[int]) -> Draws:
    """Cell (trial mod cells), the axis that comes first by name running fastest."""
    result: Draws = {}
    stride = 1
    for name in sorted(n for n, axis in spec.vary.items() if axis.kind == "grid"):
        numbers = spec.vary[name].numbers
        result[name] = _column([numbers[trial // stride % len(numbers)] for trial in trials])
        stride *= len(numbers)
    return result


def _sobol(spec: CampaignSpec, trials: Sequence[int]) -> Draws:
    names = sorted(n for n, axis in spec.vary.items() if axis.kind == "sobol")
    if not names or not len(trials):
        return {name: np.zeros(0) for name in names}
    places = _sobol_places(spec, trials)
    points = _sobol_points(spec.seed, len(names), int(places.max()))[places]
    ends = [(float(spec.vary[n].numbers[0]), float(spec.vary[n].numbers[1])) for n in names]
    return {
        name: low + (high - low) * points[:, i] for i, (name, (low, high)) in enumerate(zip(names, ends, strict=True))
    }


def _sobol_places(spec: CampaignSpec, trials: Sequence[int]) -> NDArray[np.intp]:
    """Which point each trial takes: its own number, but shuffled over the campaign beside axes that run in order."""
    own = np.asarray(trials, dtype=np.intp)
    if not spec.plan.in_order:
        return own
    order = np.random.default_rng(seed_sequence(spec.seed, 0, "sobol order")).permutation(spec.trials)
    places: NDArray[np.intp] = order[own]
    return places


def _sobol_points(seed: int, dimension: int, last: int) -> Float:
    """At least points 0 .. last of the scrambled sequence, (m, dimension), generated in powers of two."""
    from scipy.stats import qmc

    scramble = np.random.default_rng(seed_sequence(seed, 0, "sobol"))
    points: Float = qmc.Sobol(dimension, scramble=True, rng=scramble).random_base2(max(1, last.bit_length()))
    return points
