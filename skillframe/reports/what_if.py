"""What if a quantity were otherwise? Success, peak force and end error over each quantity that varied, one by one.

Whether a quantity matters is tested by Kruskal and Wallis (J. Am. Stat. Assoc. 47, 1952): do trials of its lowest,
lower, higher and highest quarter come from one distribution? Draws of the other quantities go on beside it, so that a
yes is about this quantity among the others as they were drawn. Holm's method over all tests of the section. Of success
nothing is tested below `FEWEST` failures and as many successes, where the test's approximation is poor (our choices).
Force and error are of trials that began.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from skillframe.campaign.statistics import holm
from skillframe.campaign.validity import Basis
from skillframe.frames import Float
from skillframe.reports.convergence import CURVE_BINS, TRIALS_PER_CELL, edges_of, influence, rate_curves, values_of
from skillframe.reports.markup import Markup, figure, join, note, number, tag
from skillframe.reports.quantities import ShownQuantity, quantity
from skillframe.reports.results import ResultRow, Results
from skillframe.reports.svg import Axes, padded, picture
from skillframe.reports.theory import Region

MOST, FEWEST, LEAST_TRIALS, ALPHA = 12, 20, 40, 0.05
GROUPS, FEW_VALUES = 4, 8
LOW, HIGH = 0.1, 0.9


class Measure(NamedTuple):
    """A column over which something may matter: its words, its unit for people, and the factor to that."""

    column: str
    words: str
    unit: str
    factor: float

    @property
    def axis(self) -> str:
        """Words with unit."""
        return f"{self.words} [{self.unit}]"


MEASURES = (
    Measure("peak_force_n", "peak force", "N", 1.0),
    Measure("final_error_m", "error at the end", "mm", 1e3),
)


class Effect(NamedTuple):
    """What was seen of one quantity in one skill's trials.

    Attributes:
        skill: its label; what: "success", or a measure's words.
        p_value: not corrected, or None where it is not tested, for the reason in `untested`.
        untested: a phrase.
        low, high: what the groups with the least and the most of it gave, as phrases.
    """

    skill: str
    what: str
    p_value: float | None
    untested: str
    low: str
    high: str


def what_if(results: Results, limits: Sequence[Region]) -> Markup:
    """The section: a row of curves and a sentence for each quantity, the most telling first."""
    names = influence(results)[:MOST]
    if not names:
        return Markup("")
    found = {name: [*_effects(results, quantity(name))] for name in names}
    tested = [effect for effects in found.values() for effect in effects if effect.p_value is not None]
    corrected = dict(zip(map(id, tested), holm([e.p_value or 0.0 for e in tested]), strict=True))
    parts: list[object] = [tag("h3", "What if"), tag("p", _how_to_read(results, len(tested)), class_="lead")]
    for name in names:
        curves = [rate_curves(results, name, limits), *(_curves(results, quantity(name), each) for each in MEASURES)]
        words = [_told(effect, corrected.get(id(effect)), len(results.skills) > 1) for effect in found[name]]
        label = quantity(name).label
        parts += [
            tag("h4", f"{label[0].upper()}{label[1:]}"),
            tag("p", *_apart(words)),
            tag("div", *curves, class_="grid three"),
        ]
    if left_out := influence(results)[MOST:]:
        parts.append(note(f"Less telling and not drawn: {', '.join(quantity(name).label for name in left_out)}."))
    return join(parts)


def _apart(words: Sequence[str]) -> Iterator[str]:
    return (f"{each} " for each in words if each)


def _how_to_read(results: Results, tests: int) -> str:
    drawn = (
        "Each quantity by itself, while the others went on as they were drawn. Points are medians, bars hold 80 % of "
    )
    drawn += "the trials; of success they are rates with their intervals."
    if not tests:
        return drawn
    how = f", Holm over {tests} tests" if tests > 1 else ""
    return f"{drawn} A quantity matters where p is below {ALPHA:g} (Kruskal and Wallis{how})."


def _groups(values: Float) -> list[tuple[Float, tuple[float, float]]]:
    """Which of (n,) values are in each group, from the lowest on, and the range of each."""
    known = np.unique(values[np.isfinite(values)])
    if len(known) <= FEW_VALUES:
        return [(values == value, (float(value), float(value))) for value in known]
    edges = np.quantile(values[np.isfinite(values)], np.linspace(0.0, 1.0, GROUPS + 1))
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, GROUPS - 1)
    which = np.where(np.isfinite(values), which, -1)
    return [(which == k, (float(low), float(high))) for k, (low, high) in enumerate(pairwise(edges))]


def _effects(results: Results, name: ShownQuantity) -> Iterator[Effect]:
    for skill in results.skills:
        rows = results.of(skill)
        groups = [each for each in _groups(values_of(rows, name)) if each[0].any()]
        if len(groups) < 2:
            continue
        wins = np.array([row.success for row in rows], dtype=float)
        least = min(wins.sum(), len(wins) - wins.sum())
        rare = "failures" if wins.mean() > 0.5 else "successes"
        poor = f"{least:.0f} {rare} are too few to tell" if least < FEWEST else ""
        rates = [(float(wins[i].mean()), f"{wins[i].sum():.0f} of {i.sum()}", span) for i, span in groups]
        yield _effect(results, skill, "success", wins, groups, poor, [(*r[:2], _span(r[2], name)) for r in rates])
        for measure in MEASURES:
            values = _measured(rows, measure)
            medians = [(float(np.nanmedian(values[i])), span) for i, span in groups if np.isfinite(values[i]).any()]
            if len(medians) < 2:
                continue
            said = [(m, f"{number(m)} {measure.unit}", _span(span, name)) for m, span in medians]
            yield _effect(results, skill, measure.words, values, groups, "", said)


def _effect(
    results: Results, skill: str, what: str, values: Float, groups: Sequence[tuple[Float, tuple[float, float]]],
    poor: str, said: Sequence[tuple[float, str, str]],
) -> Effect:  # fmt: skip
    low, high = min(said, key=lambda each: each[0]), max(said, key=lambda each: each[0])
    if results.validity.basis is not Basis.FIXED:
        poor = "not tested, because the number of trials was not fixed, or they are not independent"
    elif len(values) < LEAST_TRIALS:
        poor = f"{len(values)} trials are too few to tell"
    parts = [each[np.isfinite(each)] for i, _ in groups if len(each := values[i])]
    p_value = None if poor else _kruskal([part for part in parts if len(part)])
    return Effect(skill, what, p_value, poor, f"{low[1]} {low[2]}", f"{high[1]} {high[2]}")


def _kruskal(parts: Sequence[Float]) -> float:
    """Chance of such differences between groups of one distribution. It is 1 where all values are equal."""
    from scipy import stats  # not needed for a page without a table

    whole = np.concatenate(parts)
    return 1.0 if len(parts) < 2 or np.ptp(whole) == 0.0 else float(stats.kruskal(*parts).pvalue)


def _span(span: tuple[float, float], name: ShownQuantity) -> str:
    unit = f" {name.unit}".rstrip()
    low, high = number(span[0]), number(span[1])
    return f"at {low}{unit}" if low == high else f"at {low} to {high}{unit}"


def _told(effect: Effect, p_value: float | None, named: bool) -> str:
    """A sentence, empty where nothing was seen of a measure."""
    who = f"{effect.skill}: " if named else ""
    what = f"{who}{effect.what}"
    if p_value is None:
        return f"{what[0].upper()}{what[1:]}: {effect.untested}." if effect.what == "success" else ""
    if p_value > ALPHA:
        return f"{what[0].upper()}{what[1:]}: no effect seen (p = {p_value:.2g})."
    middle = "" if effect.what == "success" else "a median of "
    return f"{what[0].upper()}{what[1:]} changes with it (p = {p_value:.2g}): {middle}{effect.low}, {effect.high}."


def _measured(rows: Sequence[ResultRow], measure: Measure) -> Float:
    """(n,) in units for people, NaN for a trial that ended before its start, as a machine's may in the swing."""
    began = np.array([row.values.get("duration_s", math.nan) != 0.0 for row in rows])
    return np.where(
        began, measure.factor * np.array([row.values.get(measure.column, math.nan) for row in rows]), np.nan
    )


def _curves(results: Results, name: ShownQuantity, measure: Measure) -> Markup:
    """Median and 80 % of a measure over a quantity, all skills on the same axes, or nothing where it is not known."""
    every = _measured(results.rows, measure)
    if not np.isfinite(every).any():
        return Markup("")
    borders = edges_of(values_of(results.rows, name), TRIALS_PER_CELL * CURVE_BINS**2)
    bins = {skill: [*_bins(results.of(skill), name, measure, borders)] for skill in results.skills}
    highest = max((high for each in bins.values() for *_, high in each), default=1.0)
    axes = Axes(
        x=padded(borders[0], borders[-1], 0.02), y=(0.0, 1.05 * highest or 1.0), x_label=name.axis, y_label=measure.axis
    )
    lines = [_line(axes, bins[skill], i, borders) for i, skill in enumerate(results.skills)]
    title = f"{measure.words[0].upper()}{measure.words[1:]} over {name.label}"
    return figure(title, "", picture(axes, title, axes.frame(), *lines), class_="plot")


def _bins(
    rows: Sequence[ResultRow], name: ShownQuantity, measure: Measure, borders: Float
) -> Iterator[tuple[float, float, float, float]]:
    """Middle of each bin that holds something, and the 10 %, 50 % and 90 % quantile there."""
    at, values = values_of(rows, name), _measured(rows, measure)
    which = np.clip(np.searchsorted(borders, at, side="right") - 1, 0, len(borders) - 2)
    for k, (low, high) in enumerate(pairwise(borders)):
        inside = values[(which == k) & np.isfinite(at) & np.isfinite(values)]
        if len(inside):
            least, middle, most = (float(x) for x in np.quantile(inside, [LOW, 0.5, HIGH]))
            yield 0.5 * float(low + high), least, middle, most


def _line(axes: Axes, bins: Sequence[tuple[float, float, float, float]], index: int, borders: Float) -> Markup:
    stroke, shift = f"s{index % 4 + 1}", (index - 0.5) * 0.06 * float(borders[1] - borders[0])
    xs, middles = np.array([each[0] + shift for each in bins]), np.array([each[2] for each in bins])
    marks = []
    for x, (_, low, middle, high) in zip(xs.tolist(), bins, strict=True):
        px, py, top, foot = (round(float(v), 1) for v in (axes.across(x), axes.up(middle), axes.up(high), axes.up(low)))
        tip = tag("title", f"median {number(middle)}, 80 % within {number(low)} to {number(high)}")
        marks.append(tag("line", x1=px, x2=px, y1=foot, y2=top, class_=f"bar {stroke}"))
        marks.append(tag("circle", tip, cx=px, cy=py, r=3.4, class_=f"point {stroke}"))
    return join([axes.line(xs, middles, f"line {stroke}"), *marks])
