r"""Influence of each quantity: ranks from the surrogate, and a test of the first two with fresh trials.

The total Sobol index of a quantity is the share of the predicted success' variance that remains when all others are
known (Homma and Saltelli 1996). Jansen's estimate (1999), with even points a, b and a_i (a with its i-th quantity from
b), is

    S_i = sum (f(a) - f(a_i))^2 / (2 n var f),

where f is the surrogate's success probability. It only ranks. Claims come from fresh trials, paired with the same ones
with a quantity fixed: McNemar's test with Holm's correction, and the interval of Agresti and Min (2005, Statistics in
Medicine 24).
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import NamedTuple

import numpy as np

from skillframe.campaign import Interval, holm, mcnemar
from skillframe.frames import Float
from skillframe_certify.border import ToTry
from skillframe_certify.engine import Looked, Say
from skillframe_certify.surrogate import Surrogate


class Frozen(NamedTuple):
    """Effect of fixing a quantity at its nominal value.

    Attributes:
        name: of the quantity.
        trials: number of pairs.
        before, after: successes as sampled, and with the quantity fixed.
        only_before, only_after: pairs in which only one of the two succeeded.
        p_value: of "it makes no difference", corrected over the tested quantities.
        change: 95 % interval of the change of the success rate.
    """

    name: str
    trials: int
    before: int
    after: int
    only_before: int
    only_after: int
    p_value: float
    change: Interval


def indices(surrogate: Surrogate, dimension: int) -> Float:
    """Return (d,) total Sobol indices of the predicted success, all 0 if it is constant."""
    from scipy.stats import qmc

    both = 2.0 * qmc.Sobol(2 * dimension, scramble=True, rng=np.random.default_rng(0)).random(4096) - 1.0
    a, b = both[:, :dimension], both[:, dimension:]

    here = surrogate.success(a)
    spread = float(np.var(here))
    if spread < 1e-12:
        return np.zeros(dimension)
    found = np.zeros(dimension)
    for i in range(dimension):
        swapped = a.copy()
        swapped[:, i] = b[:, i]
        found[i] = np.mean((here - surrogate.success(swapped)) ** 2) / (2.0 * spread)
    return found


def ranks(seen: Looked) -> Float:
    """Return (d,) indices from trials, all 0 if they ended alike."""
    points, works = seen.points[~seen.none], seen.works[~seen.none]
    if works.all() or not works.any():
        return np.zeros(points.shape[1])
    return indices(Surrogate(points, works), points.shape[1])


def search(
    ranked: Mapping[str, float], names: list[str], nominal: Float, seed: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, tuple[Frozen, ...]]:
    """Test the first quantities: yield fresh trials, then the same with one fixed, and receive outcomes.

    Args:
        ranked: quantity to index.
        names: of the quantities, in the points' order.
        nominal: (d,) scaled.
        seed: of the samples.
        say: receives the progress.
    """
    # two quantities are tested, unless their index is below what is visible
    top = sorted((name for name in names if ranked[name] >= 0.05), key=lambda name: -ranked[name])[:2]
    if not top:
        return ()
    points = 2.0 * np.random.default_rng(seed).random((128, len(names))) - 1.0
    count = len(points)
    say(f"{count} fresh trials, then the same with {' and then '.join(top)} held; {count * (1 + len(top))} in all")
    drawn = yield ToTry(points, 0)
    held = []
    for name in top:
        frozen = points.copy()
        frozen[:, names.index(name)] = nominal[names.index(name)]
        held.append((name, (yield ToTry(frozen, 0))))
    return compared(drawn, held)


def compared(drawn: Looked, held: list[tuple[str, Looked]]) -> tuple[Frozen, ...]:
    """Return the effect of fixing each quantity."""
    kept = [~drawn.none & ~h.none for _, h in held]  # pairs of which both are trials
    counts = [
        (int(np.sum(k & drawn.works & ~h.works)), int(np.sum(k & ~drawn.works & h.works)))
        for k, (_, h) in zip(kept, held, strict=True)
    ]
    corrected = holm([mcnemar(lost, won) for lost, won in counts])
    return tuple(
        Frozen(
            name, int(k.sum()), int(drawn.works[k].sum()), int(h.works[k].sum()), lost, won, p,
            paired_change(won, lost, int(k.sum())),
        )
        for k, (name, h), (lost, won), p in zip(kept, held, counts, corrected, strict=True)
    )  # fmt: skip


def paired_change(won: int, lost: int, pairs: int) -> Interval:
    """95 % interval of the difference of two rates over pairs of which `won` and `lost` differ."""
    n = pairs + 2.0
    middle = (won - lost) / n
    normal = 1.959963984540054  # 97.5 % quantile of the normal distribution
    width = normal * np.sqrt(max(won + lost + 1.0 - (won - lost) ** 2 / n, 0.0)) / n
    return Interval(float(max(-1.0, middle - width)), float(min(1.0, middle + width)))
