"""Reliability of a skill: map, curves, paired comparison, failures and peak forces."""

from __future__ import annotations

import math
from itertools import combinations
from statistics import median_low

import numpy as np

from skillframe.campaign import Basis
from skillframe.execution import DEFINED, PEAK, SHARE_JOINTS, SHARES, WORDS, peak_forces
from skillframe_reports.convergence import cell_map, influence
from skillframe_reports.markup import Markup, figure, join, note, number, percent, table, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.results import ResultRow, Results
from skillframe_reports.scores import scores_table
from skillframe_reports.sources import Chapter
from skillframe_reports.svg import Axes, padded, picture, text
from skillframe_reports.theory import regions, theory_sentence
from skillframe_reports.what_if import what_if

SHARES_CAPTION = (
    "Torque: commanded by the controller, over the URDF's effort; above 100 % the motor could not follow. Speed: "
    "over the URDF's velocity. Range: distance of a joint from the middle of its range over half the range, 0 % in the "
    "middle, 100 % at an end. Each trial counts with its peak, of the joint that had the largest share; typical is the "
    "median of all trials, failed ones too."
)


def trust_section(chapter: Chapter) -> Markup:
    """Return where the skill works."""
    results = chapter.results
    if results is None:
        return note("There is no results.csv here, so nothing is known about how often it works.")
    if not results.rows:
        return note("results.csv holds no rows yet.")
    blocks = []
    for skill in results.skills:
        causes = results.causes(skill)
        total = len(results.of(skill))
        if not causes:
            blocks.append(tag("div", tag("h4", skill), tag("p", f"No failure in {total} trials."), class_="card"))
            continue
        rows = []
        for cause, trials in causes:
            which = ", ".join(map(str, trials[:6])) + (", …" if len(trials) > 6 else "")
            rows.append((cause, len(trials), percent(len(trials) / total), which))
        blocks.append(tag("div", tag("h4", skill), table(("cause", "trials", "share", "which"), rows), class_="card"))
    command = tag("code", f"skillframe campaign replay {chapter.folder} TRIAL")
    again = "" if results.real else tag("p", "To see one again, bit by bit: ", command, class_="caption")
    return join(
        [
            _map(chapter, results),
            _comparison(results),
            join([tag("h3", "What went wrong"), tag("div", *blocks, class_="grid"), again]),
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
    same = (
        "every skill ran the same samples, trial by trial"
        if len(results.skills) > 1
        else "every trial has its own sample"
    )
    varied = ", ".join(quantity(name).label for name in results.varied)
    chosen = f" The map shows the two that matter most of {len(ranked)}." if len(ranked) > 2 else ""
    parts = [
        tag(
            "p",
            f"Varied from trial to trial: {varied}; {same}.{chosen}{_intervals_said(results, len(pair) == 2)}",
            class_="lead",
        ),
        theory_sentence(limits, results.varied),
    ]
    if len(pair) == 2:
        maps = [cell_map(results, skill, pair, limits) for skill in results.skills]
        key = tag(
            "p", tag("span", class_="key ramp"), " never to always succeeds · ", tag("span", "●", class_="won-key"),
            " a trial that succeeded · ", tag("span", "×", class_="lost-key"), " one that failed", class_="keys",
        )  # fmt: skip
        parts += [tag("div", *maps, class_="grid"), key]
    return join([*parts, _skill_key(results), what_if(results, limits)])


def _intervals_said(results: Results, mapped: bool) -> str:
    """A sentence on the intervals of cells and points, which are not corrected for their number."""
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
        tag("h3", "Side by side, on the same samples"), table(head, rows),
        tag("p", f"{said[0].upper() if said.startswith('no') else said[0]}{said[1:]}.", class_="caption"),
    ])  # fmt: skip


def p_value(p: float) -> str:
    """Return a p-value for display."""
    if p >= 0.001:
        return f"{p:.3f}"
    digit, exponent = f"{max(p, 1e-15):.0e}".split("e")
    power = f"10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    return f"< {power}" if p < 1e-15 else f"{digit} · {power}"


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
    every, limit = list(finite.values()), chapter.force_limit
    edges = np.linspace(0.0, max(float(np.concatenate(every).max()), 1e-3), 25)
    counts = [np.histogram(each, edges)[0] for each in every]
    axes = Axes(
        width=600, height=260, x=padded(0.0, edges[-1], 0.01), y=(0.0, 1.08 * max(int(c.max()) for c in counts)),
        x_label=f"{PEAK} [N]", y_label="trials",
    )  # fmt: skip
    outlines = [np.concatenate([[0.0], np.repeat(c, 2), [0.0]]) for c in counts]
    lines = [axes.line(np.repeat(edges, 2), y, f"histogram s{i % 4 + 1}") for i, y in enumerate(outlines)]
    if limit is not None and axes.inside(limit, vertical=False):
        beside = round(float(axes.across(limit)), 1) - 4
        lines.append(axes.vertical(limit, "limit"))
        lines.append(text(beside, axes.top + 10, f"limit {limit:g} N", "limit-text", "end"))
    drawn = figure(
        "",
        "; ".join(said) + "." + _held(results, limit),
        picture(axes, "Peak contact force in simulation, of all trials", axes.frame(), *lines),
        class_="plot wide",
    )
    return join([tag("h3", "How hard it pushed"), _skill_key(results), drawn])


def _others(results: Results, skill: str) -> str:
    """Maximum forces over 10 ms and by the estimate, if known."""
    names, rows = [name for name in WORDS if name != "peak_force_n"], results.of(skill)
    finite = {name: [v for row in rows if math.isfinite(v := row.values.get(name, math.nan))] for name in names}
    parts = peak_forces({name: max(values) for name, values in finite.items() if values}, number)
    return f" ({', '.join(parts)})" if parts else ""


def _held(results: Results, limit: float | None) -> str:
    if limit is None:
        return ""
    if all(math.isnan(row.values.get("peak_force_10ms_n", math.nan)) for row in results.rows):
        return f" {DEFINED} Limits are held against the filtered force, which has lower ones."
    text = f" {DEFINED} A trial fails if the estimate is above the limit, or if the simulated force's mean"
    text += " over 10 ms is above it or its peak above twice the limit."
    marked = [row for row in results.rows if row.success and row.values.get("peak_force_n", 0.0) > limit]
    if marked:
        top = max(row.values["peak_force_n"] for row in marked)
        text += f" {len(marked)} successes peaked above {limit:g} N for under 10 ms, at most {number(top)} N."
    return text


def motors_table(chapter: Chapter, results: Results) -> Markup:
    """Return the worst and typical trial of each joint share and skill, or "" if unknown."""
    rows: list[tuple[object, ...]] = []
    for kind, share, joint in zip(("torque", "speed", "range"), SHARES, SHARE_JOINTS, strict=True):
        for skill in results.skills:
            known = [row for row in results.of(skill) if math.isfinite(row.values.get(share, math.nan))]
            if known:
                worst = max(known, key=lambda row: row.values[share])
                middle = median_low(sorted((row.values[share], row.trial) for row in known))
                typical = next(row for row in known if (row.values[share], row.trial) == middle)
                cells = [_joint_cells(row, share, joint) for row in (worst, typical)]
                rows.append((kind, skill, *cells[0], *cells[1]))
    told = chapter.scene.get("notes")
    said = [note(f"{text[:1].upper()}{text[1:]}.") for text in (told if isinstance(told, list) else []) if text]
    if not rows and not said:
        return Markup("")
    head = ("share of the limit", "skill", "worst", "joint", "trial", "typical", "joint", "trial")
    listed = [table(head, rows, numeric=2), tag("p", SHARES_CAPTION, class_="caption")] if rows else []
    return join([tag("h3", "Load of the motors"), *said, *listed])


def _joint_cells(row: ResultRow, share: str, joint: str) -> tuple[object, ...]:
    value = row.values[share]
    return f"{100.0 * value:.{0 if value >= 0.095 else 1}f} %", row.words.get(joint, ""), row.trial
