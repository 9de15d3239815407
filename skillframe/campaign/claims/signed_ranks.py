r"""Two policies by a score, on the same draws, so that one may look after every pair of trials.

If both are equally good, the difference d_t of their scores on a draw is as likely as its opposite. Then, whatever the
sizes |d_1| ... |d_t| are, the sign of d_t is fair, and so is that of its signed rank

    w_t = sign(d_t) rank(|d_t| among |d_1| ... |d_t|) / t.

For a fair sign E exp(L w) = cosh(L w) <= exp(L^2 w^2 / 2), so exp(L S - L^2 V / 2) with S = sum w and V = sum w^2 is a
supermartingale for every L (de la Pena 1999, "A general class of exponential inequalities for martingales and ratios",
Annals of Probability 27). Mixed over a normal L of variance 1 / RHO it stays one,

    M_t = sqrt(RHO / (RHO + V)) exp(S^2 / (2 (RHO + V))),

and min(1, 1 / M_t) is a p-value at all t at once (Ville). Ranks need no scale and no bound, and an outlier is one rank.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort

import numpy as np
from numpy.typing import ArrayLike

from skillframe.frames import Float

RHO = 2.5
"""Most is decided at about 60 pairs (Robbins' choice for V = 60 / 3 and 5 %); any other value is as valid."""


def signed_ranks(gains: Float) -> Float:
    """(n,) signed ranks, each among those so far and over their number, from (n,) differences. Equal ones share."""
    known: list[float] = []
    found = np.zeros(len(gains))
    for t, gain in enumerate(np.asarray(gains, dtype=float).tolist()):
        size = abs(gain)
        insort(known, size)
        rank = 0.5 * (bisect_left(known, size) + bisect_right(known, size) + 1)
        found[t] = np.sign(gain) * rank / (t + 1)
    return found


def p_value(total: ArrayLike, squares: ArrayLike) -> Float:
    """p-values of "both are equally good" from S and V, as above."""
    wide = RHO + np.asarray(squares, dtype=float)
    log = 0.5 * np.log(RHO / wide) + np.asarray(total, dtype=float) ** 2 / (2.0 * wide)
    result: Float = np.minimum(1.0, np.exp(-log))
    return result
