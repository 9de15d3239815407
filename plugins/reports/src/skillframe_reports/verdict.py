"""Verdict of a campaign: requirement, result, and its basis."""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

from skillframe.campaign import Verdict, verdict_of
from skillframe_reports.margins import margins_table
from skillframe_reports.markup import Markup, join, note, percent, tag
from skillframe_reports.results import Rate, Results
from skillframe_reports.scope import scope_cards
from skillframe_reports.setup_section import facts, table_of, taught_by
from skillframe_reports.sources import Chapter

ENDS = {
    (True, True): "goal reached and ended by itself",
    (True, False): "goal reached, not ended by itself",
    (False, True): "ended by itself, goal not reached",
    (False, False): "neither",
}


class Requirement(NamedTuple):
    """Requirement of a campaign file.

    Attributes:
        skill: label of the skill.
        rate: lowest acceptable success rate; None if nothing is required.
    """

    skill: str
    rate: float | None


def required(chapter: Chapter, results: Results) -> Requirement:
    """Return `[expect]` of the campaign file, else the first skill without a requirement."""
    expect = table_of(chapter.spec, "expect")
    rate = expect.get("rate")
    skill = str(expect.get("skill") or results.skills[0])
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 <= rate <= 1.0:
        return Requirement(skill, None)
    return Requirement(skill, float(rate))


def complete(chapter: Chapter, results: Results) -> bool:
    """Return whether all planned trials are there, or the campaign stopped early as planned."""
    stopped = chapter.summary.get("stopped_after_trial") is not None or "race" in chapter.summary
    return results.complete or (stopped and chapter.summary.get("complete") is True)


def verdict(chapter: Chapter, results: Results) -> Verdict:
    """Return the verdict on the required skill."""
    skill, rate = required(chapter, results)
    obstacle = "results.csv was changed after the campaign had written it" if chapter.edited else ""
    if skill not in results.skills:
        obstacle = f"the table holds no trial of {skill}"
    interval = results.rate(skill).interval
    return verdict_of(rate, interval, complete=complete(chapter, results), obstacle=obstacle)


def banner(chapter: Chapter) -> Markup:
    """Return requirement, result and verdict, empty without trials or requirement."""
    results = chapter.results
    if results is None or not results.rows:
        return Markup("")
    found, (skill, rate) = verdict(chapter, results), required(chapter, results)
    if rate is None:
        return Markup("")
    asked = f"{skill} succeeds in at least {percent(rate)} of trials"
    counted = results.rate(skill)
    share = (
        f"{counted.successes} of {counted.trials} trials, {percent(counted.share)}" if counted.trials else "no trial"
    ) + results.mark(skill)
    lines: list[tuple[str, object]] = [
        ("Required", asked), ("Result", f"{skill}: {share}; {_interval(results, counted)}"),
        ("Verdict", join([tag("strong", found.word), f": {found.why}"])),
    ]  # fmt: skip
    if not complete(chapter, results) and chapter.planned:
        lines.append(("Progress", f"{len(results.rows)} of {chapter.planned} runs are counted"))
    listed = tag("dl", *(join([tag("dt", label), tag("dd", text)]) for label, text in lines))
    return tag(
        "section", tag("p", found.word, class_="verdict-word", aria_hidden="true"), listed,
        class_=f"verdict {found.word}", aria_label="Verdict",
    )  # fmt: skip


def _interval(results: Results, counted: Rate) -> str:
    """The interval with an additional decimal, as a requirement may be near its end."""
    if counted.interval is None:
        return results.interval_name
    low, high = (f"{100.0 * bound:.1f}".removesuffix(".0") for bound in counted.interval)
    return results.said_of(f"{low}-{high} %") + results.condition


def verdict_section(chapter: Chapter) -> Markup:
    """Return the basis of the verdict: skill, ends of trials, limits, scope."""
    results = chapter.results
    if results is None or not results.rows:
        return note("There is no trial yet, so there is nothing to rest a verdict on.")
    skill, _ = required(chapter, results)
    skill = skill if skill in results.skills else results.skills[0]
    told = [("Skill", skill), *facts(chapter, skill), ("How its trials ended", ends(results, skill))]
    listed = tag(
        "dl", *(join([tag("dt", label), tag("dd", text)]) for label, text in told if text), class_="facts card"
    )
    return join([
        listed, margins_table(chapter, results, skill),
        scope_cards(chapter, results, taught_by(chapter, skill)[1]),
    ])  # fmt: skip


def ends(results: Results, skill: str) -> str:
    """Return counts of reached goals and regular ends, or "" if unknown."""
    pairs = [
        (r.values.get("goal_reached", math.nan), r.values.get("ended_itself", math.nan)) for r in results.of(skill)
    ]
    known = [(goal == 1.0, itself == 1.0) for goal, itself in pairs if math.isfinite(goal) and math.isfinite(itself)]
    counts = Counter(known)
    return "; ".join(f"{text}: {counts[kind]}" for kind, text in ENDS.items() if counts[kind])
