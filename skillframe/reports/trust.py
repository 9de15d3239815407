"""The chapter's middle: how far the skill can be trusted. Map, curves, comparison in pairs, failures, peak forces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from skillframe.campaign.validity import Basis
from skillframe.frames import Float
from skillframe.reports.convergence import cell_map, influence
from skillframe.reports.markup import Markup, figure, join, note, number, percent, table, tag
from skillframe.reports.motors import motors_table
from skillframe.reports.peaks import DEFINED, PEAK, WORDS, said
from skillframe.reports.quantities import quantity
from skillframe.reports.results import Results
from skillframe.reports.scores import scores_table
from skillframe.reports.sources import Chapter
from skillframe.reports.svg import Axes, padded, picture, text
from skillframe.reports.theory import regions, theory_sentence
from skillframe.reports.what_if import what_if

MOST_TRIALS_NAMED = 6
PEAKS = "peak_force_n"
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def trust_section(chapter: Chapter) -> Markup:
    """Where it works."""
    results = chapter.results
    if results is None:
        return note("There is no results.csv here, so nothing is known about how often it works.")
    if not results.rows:
        return note("results.csv holds no rows yet.")
    return join(
        [
            _map(chapter, results),
            _comparison(results),
            _failures(results, chapter.folder),
            note(guessed) if (guessed := str(chapter.summary.get("guessed_masses", ""))) else "",
            _forces(chapter, results),
            motors_table(chapter, results),
            scores_table(chapter, results),
        ]
    )


def _map(chapter: Chapter, results: Results) -> Markup:
    ranked = influence(results)
    if not ranked:
        return note("Nothing varied between the trials, so there is no map.")
    limits = regions(chapter.scene, results.varied)
    pair = [name for name in results.varied if name in ranked[:2]]
    parts = [
        tag("p", _how_to_read(results, pair, ranked), class_="lead"),
        theory_sentence(limits, results.varied),
    ]
    if len(pair) == 2:
        maps = [cell_map(results, skill, pair, limits) for skill in results.skills]
        parts += [tag("div", *maps, class_="grid"), _colour_key()]
    return join([*parts, _skill_key(results), what_if(results, limits)])


def _how_to_read(results: Results, pair: Sequence[str], ranked: Sequence[str]) -> str:
    same = (
        "every skill met the same draws, trial by trial" if len(results.skills) > 1 else "every trial has its own draw"
    )
    varied = ", ".join(quantity(name).label for name in results.varied)
    chosen = f" The map shows the two that matter most of {len(ranked)}." if len(ranked) > 2 else ""
    return f"Varied from trial to trial: {varied}; {same}.{chosen}{_intervals_said(results, len(pair) == 2)}"


def _intervals_said(results: Results, mapped: bool) -> str:
    """What cells and points give, and that their intervals are not corrected for their number."""
    if results.validity.basis is Basis.NONE:
        return f" Cells and points are counts without an interval: {results.validity.why_none}."
    cells = f" A cell counts its successes and gives the {results.interval_name}." if mapped else ""
    points = f" Points in the curves carry {'the same kind of interval' if mapped else f'the {results.interval_name}'}."
    each = " Each of these intervals is 95 % by itself, without correction for their number: one in twenty may miss."
    return f"{cells}{points}{each}"


def _skill_key(results: Results) -> Markup:
    names = [
        tag("span", tag("span", "", class_=f"swatch s{i % 4 + 1}"), skill) for i, skill in enumerate(results.skills)
    ]
    return tag("p", *names, class_="keys skills")


def _colour_key() -> Markup:
    return tag(
        "p", tag("span", class_="key ramp"), " never to always succeeds · ", tag("span", "●", class_="won-key"),
        " a trial that succeeded · ", tag("span", "×", class_="lost-key"), " one that failed", class_="keys",
    )  # fmt: skip


def _comparison(results: Results) -> Markup:
    if len(results.skills) < 2:
        return Markup("")
    pairs = list(combinations(results.skills, 2))
    counts = [results.pairs(first, second) for first, second in pairs]
    chances = results.compare([(only_first, only_second) for _, only_first, only_second, _ in counts])
    rows = [
        (f"{first} – {second}", *four, "none" if p is None else p_value(p))
        for (first, second), four, p in zip(pairs, counts, chances, strict=True)
    ]
    head = ("first – second", "both", "only first", "only second", "neither", "p")
    said = results.compared_by(len(pairs))
    return join([
        tag("h3", "Side by side, on the same draws"), table(head, rows),
        tag("p", f"{said[0].upper() if said.startswith('no') else said[0]}{said[1:]}.", class_="caption"),
    ])  # fmt: skip


def p_value(p: float) -> str:
    """A p-value for people."""
    if p >= 0.001:
        return f"{p:.3f}"
    digit, exponent = f"{max(p, 1e-15):.0e}".split("e")
    power = f"10{str(int(exponent)).translate(RAISED)}"
    return f"< {power}" if p < 1e-15 else f"{digit} · {power}"


def _failures(results: Results, folder: str) -> Markup:
    blocks = []
    for skill in results.skills:
        causes = results.causes(skill)
        total = len(results.of(skill))
        if not causes:
            blocks.append(tag("div", tag("h4", skill), tag("p", f"No failure in {total} trials."), class_="card"))
            continue
        rows = [(cause, len(trials), percent(len(trials) / total), _named(trials)) for cause, trials in causes]
        blocks.append(tag("div", tag("h4", skill), table(("cause", "trials", "share", "which"), rows), class_="card"))
    replay = tag(
        "p",
        "To see one again, bit by bit: ",
        tag("code", f"skillframe campaign replay {folder} TRIAL"),
        class_="caption",
    )
    again = "" if results.real else replay
    return join([tag("h3", "What went wrong"), tag("div", *blocks, class_="grid"), again])


def _named(trials: Sequence[int]) -> str:
    more = ", …" if len(trials) > MOST_TRIALS_NAMED else ""
    return ", ".join(map(str, trials[:MOST_TRIALS_NAMED])) + more


def _forces(chapter: Chapter, results: Results) -> Markup:
    forces = {s: np.array([r.values.get("peak_force_n", math.nan) for r in results.of(s)]) for s in results.skills}
    finite = {s: f[np.isfinite(f)] for s, f in forces.items()}
    if not any(len(f) for f in finite.values()):
        return note("The table holds no peak forces.")
    known = [(skill, float(np.median(f)), float(f.max())) for skill, f in finite.items() if len(f)]
    said = [
        f"{skill}: median peak {number(middle)} N, highest {number(top)} N{_others(results, skill)}"
        for skill, middle, top in known
    ]
    drawn = figure(
        "",
        "; ".join(said) + "." + _held(results, chapter.force_limit),
        _histogram(list(finite.values()), chapter.force_limit),
        class_="plot wide",
    )
    return join([tag("h3", "How hard it pushed"), _skill_key(results), drawn])


def _others(results: Results, skill: str) -> str:
    """The highest forces besides the peak, where the table has them: over 10 ms, and by the estimate."""
    columns = {name: [row.values.get(name, math.nan) for row in results.of(skill)] for name in WORDS if name != PEAKS}
    finite = {name: [v for v in values if math.isfinite(v)] for name, values in columns.items()}
    parts = said({name: max(values) for name, values in finite.items() if values}, number)
    return f" ({', '.join(parts)})" if parts else ""


def _held(results: Results, limit: float | None) -> str:
    """What the limit is held against, and how many successes peaked above it."""
    if limit is None:
        return ""
    if all(math.isnan(row.values.get("peak_force_10ms_n", math.nan)) for row in results.rows):
        return f" {DEFINED} Limits are held against the filtered force, which has lower ones."
    text = f" {DEFINED} A trial fails if the estimate is above the limit, or in the simulator the mean"
    text += " over 10 ms is above it or a peak above twice the limit."
    marked = [row for row in results.rows if row.success and row.values.get("peak_force_n", 0.0) > limit]
    if marked:
        top = max(row.values["peak_force_n"] for row in marked)
        text += f" {len(marked)} successes peaked above {limit:g} N for under 10 ms, at most {number(top)} N."
    return text


def _histogram(forces: Sequence[Float], limit: float | None) -> Markup:
    """Outlines of the skills' histograms over each other, in common bins."""
    edges = np.linspace(0.0, max(float(np.concatenate(forces).max()), 1e-3), 25)
    counts = [np.histogram(f, edges)[0] for f in forces]
    axes = Axes(
        width=600, height=260, x=padded(0.0, edges[-1], 0.01), y=(0.0, 1.08 * max(int(c.max()) for c in counts)),
        x_label=f"{PEAK} [N]", y_label="trials",
    )  # fmt: skip
    outlines = [np.concatenate([[0.0], np.repeat(c, 2), [0.0]]) for c in counts]
    lines = [axes.line(np.repeat(edges, 2), y, f"histogram s{i % 4 + 1}") for i, y in enumerate(outlines)]
    return picture(
        axes, "Peak contact force in the simulator, of all trials", axes.frame(), *lines, _force_limit(axes, limit)
    )


def _force_limit(axes: Axes, limit: float | None) -> Markup:
    if limit is None or not axes.inside(limit, vertical=False):
        return Markup("")
    x = round(float(axes.across(limit)), 1)
    line = tag("line", x1=x, x2=x, y1=axes.top, y2=axes.bottom, class_="limit")
    return join([line, text(x - 4, axes.top + 10, f"limit {limit:g} N", "limit-text", "end")])
