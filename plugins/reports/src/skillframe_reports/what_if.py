"""Effect of each varied quantity on success, peak force and final error.

The test of Kruskal and Wallis (J. Am. Stat. Assoc. 47, 1952) compares trials in the quantity's quarters, while the
other quantities vary too. Holm's method corrects all tests of the section. Success needs 20 failures and
successes, below which the test's approximation is poor. Force and error exclude refused trials.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from skillframe.campaign import Basis, holm
from skillframe.frames import Float
from skillframe_reports.convergence import CURVE_BINS, TRIALS_PER_CELL, edges_of, influence, rate_curves, values_of
from skillframe_reports.markup import Markup, figure, join, note, number, tag
from skillframe_reports.quantities import ShownQuantity, quantity
from skillframe_reports.results import ResultRow, Results
from skillframe_reports.svg import Axes, Point, padded, picture
from skillframe_reports.theory import Region


class Measure(NamedTuple):
    """A column with its words, display unit and factor.

    Smaller differences than `least`, in that unit, do not count: about a wrist sensor's resolution and the simulator's
    contact depth.
    """

    column: str
    words: str
    unit: str
    factor: float
    least: float

    @property
    def axis(self) -> str:
        """Words with unit."""
        return f"{self.words} [{self.unit}]"


MEASURES = (
    Measure("peak_force_n", "peak force", "N", 1.0, 1.0),
    Measure("final_error_m", "error at the end", "mm", 1e3, 0.1),
)


class Effect(NamedTuple):
    """Effect of one quantity in one skill's trials.

    Attributes:
        skill: its label.
        what: "success", or a measure's words.
        p_value: uncorrected; None if not tested.
        untested: why it was not tested.
        low, high: results of the lowest and highest groups, as phrases.
        small: a phrase if the difference is too small to matter, or "".
    """

    skill: str
    what: str
    p_value: float | None
    untested: str
    low: str
    high: str
    small: str = ""


def what_if(results: Results, limits: Sequence[Region]) -> Markup:
    """Return the section: curves and a sentence for each quantity, most influential first."""
    ranked = influence(results)
    names = ranked[:12]
    if not names:
        return Markup("")
    found = {name: [*_effects(results, quantity(name))] for name in names}
    tested = [effect for effects in found.values() for effect in effects if effect.p_value is not None]
    corrected = dict(zip(map(id, tested), holm([e.p_value or 0.0 for e in tested]), strict=True))
    said = "Each quantity by itself, while the others vary, too. Points are medians, bars hold 80 % of "
    said += "the trials; of success they are rates with their intervals."
    if tested:
        how = f", Holm over {len(tested)} tests" if len(tested) > 1 else ""
        said += f" A change is reported where p is below 0.05 (Kruskal and Wallis{how})"
        said += ": p says how sure it is, and not how large."
    parts: list[object] = [tag("h3", "What if"), tag("p", said, class_="lead")]
    for name in names:
        curves = [rate_curves(results, name, limits), *(_curves(results, quantity(name), each) for each in MEASURES)]
        words = [_told(effect, corrected.get(id(effect)), len(results.skills) > 1) for effect in found[name]]
        label = quantity(name).label
        parts += [
            tag("h4", f"{label[0].upper()}{label[1:]}"),
            tag("p", *(f"{each} " for each in words if each)),
            tag("div", *curves, class_="grid three"),
        ]
    if left_out := ranked[12:]:
        parts.append(note(f"Less telling and not drawn: {', '.join(quantity(name).label for name in left_out)}."))
    return join(parts)


def _groups(values: Float) -> list[tuple[Float, tuple[float, float]]]:
    """Members of (n,) values in each group, lowest first, and its range."""
    known = np.unique(values[np.isfinite(values)])
    if len(known) <= 8:
        return [(values == value, (float(value), float(value))) for value in known]
    edges = np.quantile(values[np.isfinite(values)], np.linspace(0.0, 1.0, 5))  # of four groups
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
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
        poor = f"{least:.0f} {rare} are too few to decide" if least < 20 else ""
        rates = [(float(wins[i].mean()), f"{wins[i].sum():.0f} of {i.sum()}", span) for i, span in groups]
        yield _effect(results, skill, "success", wins, groups, poor, [(*r[:2], _span(r[2], name)) for r in rates])
        for measure in MEASURES:
            values = _measured(rows, measure)
            medians = [(float(np.nanmedian(values[i])), span) for i, span in groups if np.isfinite(values[i]).any()]
            if len(medians) < 2:
                continue
            said = [(m, f"{number(m)} {measure.unit}", _span(span, name)) for m, span in medians]
            small = max(medians)[0] - min(medians)[0] < measure.least
            effect = _effect(results, skill, measure.words, values, groups, "", said)
            yield effect._replace(small=f"by less than {measure.least:g} {measure.unit}" if small else "")


def _effect(
    results: Results, skill: str, what: str, values: Float, groups: Sequence[tuple[Float, tuple[float, float]]],
    poor: str, said: Sequence[tuple[float, str, str]],
) -> Effect:  # fmt: skip
    low, high = min(said, key=lambda each: each[0]), max(said, key=lambda each: each[0])
    if results.validity.basis is not Basis.FIXED:
        poor = "not tested, because the number of trials was not fixed, or they are not independent"
    elif len(values) < 40:
        poor = f"{len(values)} trials are too few to decide"
    known = [each for i, _ in groups if len(each := values[i][np.isfinite(values[i])])]
    p_value = None
    if not poor:
        from scipy import stats  # not needed for a page without a table

        alike = len(known) < 2 or np.ptp(np.concatenate(known)) == 0.0
        p_value = 1.0 if alike else float(stats.kruskal(*known).pvalue)
    return Effect(skill, what, p_value, poor, f"{low[1]} {low[2]}", f"{high[1]} {high[2]}")


def _span(span: tuple[float, float], name: ShownQuantity) -> str:
    unit = f" {name.unit}".rstrip()
    low, high = number(span[0]), number(span[1])
    return f"at {low}{unit}" if low == high else f"at {low} to {high}{unit}"


def _told(effect: Effect, p_value: float | None, named: bool) -> str:
    who = f"{effect.skill}: " if named else ""
    what = f"{who}{effect.what}"
    if p_value is None:
        return f"{what[0].upper()}{what[1:]}: {effect.untested}." if effect.what == "success" else ""
    if p_value > 0.05:
        return f"{what[0].upper()}{what[1:]}: no effect seen (p = {p_value:.2g})."
    if effect.small:
        return f"{what[0].upper()}{what[1:]} hardly changes with it: {effect.small} (p = {p_value:.2g})."
    middle = "" if effect.what == "success" else "a median of "
    return f"{what[0].upper()}{what[1:]} changes with it (p = {p_value:.2g}): {middle}{effect.low}, {effect.high}."


def _measured(rows: Sequence[ResultRow], measure: Measure) -> Float:
    """(n,) in display units, NaN for a trial that ended before its start."""
    began = np.array([row.values.get("duration_s", math.nan) != 0.0 for row in rows])
    return np.where(
        began, measure.factor * np.array([row.values.get(measure.column, math.nan) for row in rows]), np.nan
    )


def _curves(results: Results, name: ShownQuantity, measure: Measure) -> Markup:
    """Median and 80 % range of a measure over a quantity for all skills, empty if unknown."""
    every = _measured(results.rows, measure)
    if not np.isfinite(every).any():
        return Markup("")
    borders = edges_of(values_of(results.rows, name), TRIALS_PER_CELL * CURVE_BINS**2)
    bins = {skill: [*_bins(results.of(skill), name, measure, borders)] for skill in results.skills}
    highest = max((high for each in bins.values() for *_, high in each), default=1.0)
    axes = Axes(
        x=padded(borders[0], borders[-1], 0.02), y=(0.0, 1.05 * highest or 1.0), x_label=name.axis, y_label=measure.axis
    )
    lines = []
    for index, skill in enumerate(results.skills):
        shift = (index - 0.5) * 0.06 * float(borders[1] - borders[0])  # so that skills do not cover each other
        points: list[Point] = [
            (x + shift, middle, (low, high), f"median {number(middle)}, 80 % within {number(low)} to {number(high)}")
            for x, low, middle, high in bins[skill]
        ]
        lines.append(axes.series(points, f"s{index % 4 + 1}"))
    title = f"{measure.words[0].upper()}{measure.words[1:]} over {name.label}"
    return figure(title, "", picture(axes, title, axes.frame(), *lines), class_="plot")


def _bins(
    rows: Sequence[ResultRow], name: ShownQuantity, measure: Measure, borders: Float
) -> Iterator[tuple[float, float, float, float]]:
    """Middle and 10 %, 50 % and 90 % quantiles of each non-empty bin."""
    at, values = values_of(rows, name), _measured(rows, measure)
    which = np.clip(np.searchsorted(borders, at, side="right") - 1, 0, len(borders) - 2)
    for k, (low, high) in enumerate(pairwise(borders)):
        inside = values[(which == k) & np.isfinite(at) & np.isfinite(values)]
        if len(inside):
            least, middle, most = (float(x) for x in np.quantile(inside, [0.1, 0.5, 0.9]))
            yield 0.5 * float(low + high), least, middle, most
