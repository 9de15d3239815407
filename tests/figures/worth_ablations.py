"""Every rule of the learner left out in turn: what `worth --ablations` adds beside LMC, from the same demonstrations.

A rule is left out by replacing the function or constant that holds it while LMC learns. Rows whose push and axes are
those of the whole learner, to a degree, are not run: they share its result.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.special import ndtr
from skillframe_lmc import axes, learner, pieces, posterior

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, cross, norm, unit
from tests.figures.worth_methods import lmc_row
from tests.figures.worth_skills import Row

SAME_DEG, SAME_STIFFNESS = 1.0, 0.02
Replaced = tuple[Any, str, Any]  # module, name, what stands for it


def _pairs(points: Float, kept: Any, step: float) -> Any:
    pairs = np.column_stack([kept[:-1], kept[1:]])
    return pairs[norm(points[pairs[:, 1]] - points[pairs[:, 0]]) > 0.0]


def _by_length(given: pieces.Pieces, whole: float) -> posterior.Witnesses:
    """Every piece weighs its length: a long floor is as many witnesses as it has metres."""
    return posterior._merged(given, given.length / whole)


def _hard_near_edge(D: Float, given: pieces.Pieces) -> Any:
    """Before the near edge a push explains as little as beyond the far one."""
    result = EXPLAINED(D, given)
    touch = given.contact
    v = given.motion[touch]
    across = cross(unit(cross(v, given.edge[touch])), v)
    angle = np.arctan2(D @ across.T, D @ v.T)
    result[:, touch] *= ndtr(angle / posterior.EDGE)
    return result


EXPLAINED, DECIDE = posterior.explained, posterior.decide


def _peak(seen: posterior.Witnesses, exists: float) -> posterior.Choice:
    """The most probable push in place of the middle of the plateau."""
    with replaced((posterior, "depth", lambda most, seen: 1e-6)):
        return DECIDE(seen, exists)


LEFT_OUT: dict[str, Sequence[Replaced]] = {
    "loops": [(pieces, "_without_loops", _pairs)],
    "releases": [(pieces, "typical_speed", lambda *_: np.inf)],
    "median of three": [(pieces, "_median_of_three", lambda load: load)],
    "power edge": [(pieces, "MOST_TILT", 0.0)],
    "hand's push in turns": [(posterior, "HELD", 1e6)],
    "soft near edge": [(posterior, "explained", _hard_near_edge)],
    "one witness a contact": [(learner, "witnesses", _by_length)],
    "balance of demonstrations": [(posterior, "_balance", lambda alike, given, weight: 1.0)],
    "middle of the plateau": [(learner, "decide", _peak)],
    "axis square to turn and push": [(axes.CompliantAxes, "square_to", lambda self, turn, push: self)],
    "soft across": [(learner, "gains", lambda free, k, tool, soft, side: GAINS(free, k, tool, None, side))],
}
GAINS = learner.gains


@contextmanager
def replaced(*given: Replaced) -> Iterator[None]:
    """While open, each module's name stands for something else."""
    before = [(module, name, getattr(module, name)) for module, name, _ in given]
    try:
        for module, name, value in given:
            setattr(module, name, value)
        yield
    finally:
        for module, name, value in before:
            setattr(module, name, value)


def ablated(shown: Sequence[Demonstration], whole: Row) -> dict[str, Row]:
    """Rows by the rule left out; the very row `whole` where leaving it out changes nothing."""
    rows = {}
    for name, given in LEFT_OUT.items():
        with replaced(*given):
            row = lmc_row(shown)
        rows[f"without {name}"] = whole if _same(row, whole) else row
    return rows


def _same(row: Row, whole: Row) -> bool:
    stiffness = norm(row.stiffness - whole.stiffness).max() <= SAME_STIFFNESS * norm(whole.stiffness).max()
    return bool(stiffness) and max(_apart(row.push, whole.push), _apart(row.turn, whole.turn)) < SAME_DEG


def _apart(one: Float, other: Float) -> float:
    """Angle between two directions [deg]; 180 where one does not exist."""
    if not one.any() or not other.any():
        return 0.0 if one.any() == other.any() else 180.0
    return float(np.degrees(np.arccos(np.clip(unit(one) @ unit(other), -1.0, 1.0))))
