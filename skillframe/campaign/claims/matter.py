r"""Which quantity matters: ranks from the surrogate, which cost no trial, and a test of the first two, which does.

The total Sobol index of a quantity is the share of the predicted success' variance that is left once all others are
known (Homma and Saltelli 1996); Jansen's estimate (1999) with even points a, b and a with its i-th quantity from b is

    S_i = sum (f(a) - f(a_i))^2 / (2 n var f).

f is the surrogate's success probability. An index is a guess: it ranks. What is claimed comes from fresh
independent trials over the ranges and the same trials, their noise included, with one quantity held at its nominal
value: McNemar's test over the pairs, corrected by Holm over the quantities, and the interval of Agresti and Min (2005,
"Simple improved confidence intervals for comparing matched proportions", Statistics in Medicine 24) for the
difference.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import NamedTuple

import numpy as np

from skillframe.campaign.claims.border import ToTry
from skillframe.campaign.claims.engine import Looked, Say
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.campaign.statistics import Interval, holm, mcnemar
from skillframe.frames import Float

TRIALS, TOP = 128, 2
NOTHING = 0.05
"""A quantity whose index is smaller does nothing that shows; it is not tested."""
POINTS = 4096
NORMAL = 1.959963984540054
"""97.5 % quantile of the normal distribution."""


class Frozen(NamedTuple):
    """A quantity that was held at its nominal value.

    Attributes:
        name: of the quantity.
        trials: pairs of trials.
        before, after: successes as drawn, and with the quantity held.
        only_before, only_after: pairs in which only one of the two succeeded.
        p_value: of "it makes no difference", corrected over the quantities that were held.
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
    """(d,) total Sobol indices of the predicted success, all 0 where it does not vary."""
    from scipy.stats import qmc

    both = 2.0 * qmc.Sobol(2 * dimension, scramble=True, rng=np.random.default_rng(0)).random(POINTS) - 1.0
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
    """(d,) indices by trials that were looked at, all 0 where they ended alike and so there is nothing to rank."""
    if seen.works.all() or not seen.works.any():
        return np.zeros(seen.points.shape[1])
    return indices(Surrogate(seen.points, seen.works), seen.points.shape[1])


def search(
    ranked: Mapping[str, float], names: list[str], nominal: Float, seed: int, say: Say = lambda text: None
) -> Generator[ToTry, Looked, tuple[Frozen, ...]]:
    """Yields fresh trials, then the same with a quantity held, and is sent how they ended.

    Args:
        ranked: quantity to index.
        names: of the quantities, in the points' order.
        nominal: (d,) scaled.
        seed: of the draws.
        say: told how far it is.
    """
    top = sorted((name for name in names if ranked[name] >= NOTHING), key=lambda name: -ranked[name])[:TOP]
    if not top:
        return ()
    points = 2.0 * np.random.default_rng(seed).random((TRIALS, len(names))) - 1.0
    say(f"{TRIALS} fresh trials, then the same with {' and then '.join(top)} held; {TRIALS * (1 + len(top))} in all")
    drawn = yield ToTry(points, 0)
    held = []
    for name in top:
        frozen = points.copy()
        frozen[:, names.index(name)] = nominal[names.index(name)]
        held.append((name, (yield ToTry(frozen, 0))))
    return compared(drawn, held)


def compared(drawn: Looked, held: list[tuple[str, Looked]]) -> tuple[Frozen, ...]:
    """What holding each quantity changed."""
    counts = [(int(np.sum(drawn.works & ~h.works)), int(np.sum(~drawn.works & h.works))) for _, h in held]
    corrected = holm([mcnemar(lost, won) for lost, won in counts])
    return tuple(
        Frozen(
            name, len(drawn.works), int(drawn.works.sum()), int(h.works.sum()), lost, won, p,
            paired_change(won, lost, len(drawn.works)),
        )
        for (name, h), (lost, won), p in zip(held, counts, corrected, strict=True)
    )  # fmt: skip


def paired_change(won: int, lost: int, pairs: int) -> Interval:
    """95 % interval of the difference of two rates over pairs of which `won` and `lost` differ."""
    n = pairs + 2.0
    middle = (won - lost) / n
    width = NORMAL * np.sqrt(max(won + lost + 1.0 - (won - lost) ** 2 / n, 0.0)) / n
    return Interval(float(max(-1.0, middle - width)), float(min(1.0, middle + width)))
