"""The certificate as the report's first page: claim, evidence, border, forces, assumptions, limits, provenance.

Certified is green. What failed the test is "not certified", with the counts; only where even the upper end of the
failing box's 95 % interval lies below the rate is the verdict "fail". Between the two it is "undecided". It is
printed on one A4 page.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from skillframe import __version__
from skillframe.campaign.claims.rounds import BORDER
from skillframe.campaign.claims.searches import BREAK, MATTER
from skillframe.campaign.spec import name_of
from skillframe.campaign.statistics import clopper_pearson
from skillframe.reports.asked import Asked
from skillframe.reports.border_map import border_map, box_of
from skillframe.reports.margins import margins_of
from skillframe.reports.markup import Markup, join, number, percent, tag
from skillframe.reports.quantities import quantity
from skillframe.reports.scope import standing
from skillframe.reports.sources import Chapter
from skillframe.reports.theory import regions
from skillframe.reports.who import facts

ELSE = "real sensors, hands, wear, temperature, people"
NAMED, BESIDE = 6, 5
"""Failed trials that are named, and paragraphs that stand beside the map."""
SHORT = 12
"""Letters of a hash that are shown."""


class Stand(NamedTuple):
    """How a claim stands: pass, fail or undecided, and why."""

    word: str
    why: str


def stand(asked: Asked) -> Stand:
    """The verdict on the last claim."""
    told = asked.predicate
    if told is None:
        return Stand("undecided", "the claim is written, its trials are not all there" if asked.claim else
                     "nothing is claimed yet")  # fmt: skip
    if told["certified"]:
        return Stand("pass", "the box passed the test that was fixed before its trials were drawn")
    if not told.get("tested"):
        return Stand("fail", "there is no box in which nearly all trials are likely to succeed")
    failed = told["tested"][-1]
    counts = f"not certified: {failed['failures']} of {failed['trials']} fresh trials failed in the smallest box"
    high = clopper_pearson(failed["trials"] - failed["failures"], failed["trials"]).high
    if high < told["rate"]:
        return Stand("fail", f"{counts}; its success rate is below {percent(told['rate'])} (95 % sure)")
    return Stand("undecided", f"{counts}; neither {percent(told['rate'])} nor less is shown")


def certificate_page(chapter: Chapter) -> Markup:
    """The first page. Nothing for a campaign that no question was asked of."""
    asked = chapter.asked
    if asked is None:
        return Markup("")
    found = stand(asked)
    told: list[tuple[str, object]] = [
        ("Claim", _claim(chapter, asked)), ("Evidence", _evidence(chapter, asked)), ("Breaks at", _breaks(asked)),
        ("Matters", _matters(asked)), ("Limits met", _limits(chapter)), ("Assumed", _assumed(chapter, asked)),
        ("Not varied", f"{'; '.join(standing(chapter))}; {ELSE}"), ("It says not", _not_said(asked)),
        ("From", _provenance(asked)),
    ]  # fmt: skip
    words = {"pass": "certified", "fail": "fail", "undecided": "undecided"}
    head = tag(
        "div", tag("p", words[found.word], class_="verdict-word"), tag("p", found.why), class_=f"verdict {found.word}"
    )
    beside, below = (_list(part) for part in (told[:BESIDE], told[BESIDE:]))
    drawn = border_map(asked, regions(chapter.scene, asked.names))
    signed = tag("p", "Signed: ", tag("span", "", class_="line"), " Date: ", tag("span", "", class_="line short"))
    return tag(
        "section", tag("h2", f"Certificate: {chapter.name}"), head,
        tag("div", beside, drawn, class_="certified"), below, signed, class_="certificate",
        aria_label="Certificate",
    )  # fmt: skip


def _list(told: list[tuple[str, object]]) -> Markup:
    return tag("dl", *(join([tag("dt", label), tag("dd", text)]) for label, text in told if text))


def _span(name: str, low: float, high: float) -> str:
    q = quantity(name)
    return f"{q.label} {number(q.factor * low)} to {number(q.factor * high)} {q.unit}".strip()


def _claim(chapter: Chapter, asked: Asked) -> str:
    told, box = asked.predicate or {}, box_of(asked)
    rate = percent(float(told.get("rate", asked.question.rate)))
    results = chapter.results
    skill = str(told.get("skill") or (results.skills[0] if results and results.skills else "the skill"))
    robot, world = (name_of(str(told.get(key) or chapter.spec.get(key, ""))) for key in ("robot", "world"))
    where = f"{skill}, {robot} in {world}"
    sure = percent(float(told.get("confidence", asked.question.confidence)))
    spans = "; ".join(_span(name, *ends) for name, ends in box.items())
    if not box:
        return f"{where}: no box is claimed. Asked: at least {rate} with {sure} confidence."
    said = "succeeds" if told.get("certified") else "was claimed to succeed"
    share = f" ({percent(float(told['share_of_declared']))} of what was declared)" if told.get("certified") else ""
    return f"{where} {said} in at least {rate} of trials, with {sure} confidence, in the mean over: {spans}{share}."


def _evidence(chapter: Chapter, asked: Asked) -> str:
    told = asked.predicate or {}
    parts = [f"{each['trials']} fresh trials in a box, {each['failures']} failed" for each in told.get("tested", [])]
    failed = told.get("failed_trials", [])
    if failed:
        some = ", ".join(map(str, failed[:NAMED])) + (" ..." if len(failed) > NAMED else "")
        parts.append(f"failed: {some} (skillframe campaign replay {asked.folder}/{asked.evidence} TRIAL)")
    parts.append(f"{len(asked.works)} trials were looked at before, {int(asked.works.sum())} succeeded")
    if asked.claim:
        spent = percent(float(asked.claim["alpha_spent"]))
        parts.append(f"claim {asked.claim['number']} of this folder, which has spent {spent}")
    results = chapter.results
    causes = results.causes(results.skills[0]) if results and results.rows and told.get("tested") else []
    parts += [f"{cause}: {len(trials)}" for cause, trials in causes[:2]]
    return "; ".join(parts) + "."


def _breaks(asked: Asked) -> str:
    found = asked.found.get(BREAK)
    if found is None:
        return f"not looked for: skillframe campaign break {asked.folder}"
    if not found["confirmed"]:
        return f"nothing found in {found['trials']} trials over the declared ranges"
    at = ", ".join(f"{quantity(n).label} {number(quantity(n).factor * v)} {quantity(n).unit}".strip()
                   for n, v in found["point"].items())  # fmt: skip
    again = f"{found['confirmations'][-1]} of {found['fresh_trials']} fresh trials"
    return (
        f"{found['size']:.2f} of the half ranges: {at}. {again} "
        f"fail there (skillframe campaign replay {asked.folder}/confirm/{found['round']} 0). The smallest found in "
        f"{found['trials']} trials, not the smallest there is."
    )


def _matters(asked: Asked) -> str:
    found = asked.found.get(MATTER)
    lines = []
    for each in found["held"] if found else ():
        low, high = (100.0 * end for end in each["change"])
        before, after = (percent(each[key] / each["trials"]) for key in ("before", "after"))
        label = quantity(each["name"]).label
        lines.append(f"{label} at its nominal value: {before} becomes {after} ({low:+.0f} to {high:+.0f} points)")
    return "; ".join(lines)


def _limits(chapter: Chapter) -> str:
    """Largest and 99th percentile of what has a limit, tool against part, and the nearest limit."""
    results = chapter.results
    if results is None or not results.rows:
        return ""
    rows, lines = results.of(results.skills[0]), []
    for margin in margins_of(chapter, rows)[:3]:
        values = np.array([row.values.get(margin.column, math.nan) for row in rows])
        values = margin.factor * values[np.isfinite(values)]
        limit = f" (limit {number(margin.factor * margin.limit)} {margin.unit})" if margin.limit else ""
        lines.append(
            f"{margin.what}: at most {number(float(values.max()))}, 99 % below "
            f"{number(float(np.quantile(values, 0.99)))} {margin.unit}{limit}"
        )
    return "; ".join(lines)


def _assumed(chapter: Chapter, asked: Asked) -> str:
    results = chapter.results
    known = facts(chapter, results.skills[0]) if results and results.rows else []
    shape = "draws even over the box and independent of each other"
    return "; ".join([shape, *(f"{label.lower()}: {text}" for label, text in known if text)])


def _not_said(asked: Asked) -> str:
    found = asked.found.get(BORDER, {})
    size = found.get("smallest_island")
    island = f"; islands below {percent(float(size))} of the ranges may have been missed" if size else ""
    return (
        "the rate is a mean over the box, its corners may be worse" + island + "; simulation only, nothing was "
        "measured on a real robot or on a person; no claim about the safety of people"
    )


def _provenance(asked: Asked) -> Markup:
    told: dict[str, Any] = dict(asked.predicate or {})
    files = ", ".join(f"{name} {digest[:SHORT]}" for name, digest in asked.hashes)
    return join([
        f"skillframe {told.get('skillframe', __version__)}; {files}. To check: ",
        tag("code", f"skillframe campaign check {asked.folder}"),
    ])  # fmt: skip
