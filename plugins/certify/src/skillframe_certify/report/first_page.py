"""The certificate as a report's first page, printable on one A4 page.

A failed test reads "not certified" with its counts. The verdict is "fail" only if the upper end of the failed box's 95
% interval is below the rate, else "undecided".
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from skillframe_reports.margins import margins_of
from skillframe_reports.markup import Markup, join, number, percent, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.scope import standing
from skillframe_reports.setup_section import facts
from skillframe_reports.sources import Chapter
from skillframe_reports.theory import regions

import skillframe
from skillframe.campaign import RanAgain, clopper_pearson, name_of, said_again
from skillframe_certify.binding import SYSTEM
from skillframe_certify.certificate import CHOSEN
from skillframe_certify.report.answers import Asked
from skillframe_certify.report.border_map import border_map, box_of
from skillframe_certify.rounds import BORDER
from skillframe_certify.searches import BREAK, MATTER

ELSE = "not simulated: real sensors, hands, wear, temperature, people"


class Stand(NamedTuple):
    """Verdict on a claim: pass, fail or undecided, and why."""

    word: str
    why: str


def stand(asked: Asked) -> Stand:
    """Return the verdict on the last claim. An invalid certificate fails."""
    told = asked.predicate
    if asked.wrong:
        return Stand("fail", f"certificate.json does not follow from its trials: {'; '.join(asked.wrong)}")
    if told is None:
        return Stand("undecided", "the claim is written, its trials are not all there" if asked.claim else
                     "nothing is claimed yet")  # fmt: skip
    if told["certified"]:
        return Stand("pass", "the box passed a test that was fixed before its trials were sampled")
    if not told.get("tested"):
        return Stand("fail", "no box was found in which nearly all trials are likely to succeed")
    failed = told["tested"][-1]
    counts = f"not certified: {failed['failures']} of {failed['trials']} fresh trials failed in the smallest box"
    high = clopper_pearson(failed["trials"] - failed["failures"], failed["trials"]).high
    if high < told["rate"]:
        return Stand("fail", f"{counts}; its success rate is below {percent(told['rate'])} (95 % sure)")
    return Stand("undecided", f"{counts}; whether the success rate reaches {percent(told['rate'])} is undecided")


def certificate_page(chapter: Chapter) -> Markup:
    """Return the first page. The chapter's `asked` is an `Asked`."""
    asked: Asked = chapter.content
    found = stand(asked)
    results = chapter.results
    known = facts(chapter, results.skills[0]) if results and results.rows else []
    shape = "trials sampled independently and uniformly over the box"
    predicate: dict[str, Any] = dict(asked.predicate or {})
    check = tag("code", f"skillframe certify check {asked.folder}")
    files = ", ".join(f"{name} {digest[:12]}" for name, digest in asked.hashes)
    code = ", ".join(f"{each['name']} {each['version']} {each['sha256'][:12]}" for each in predicate.get("plugins", ()))
    told: list[tuple[str, object]] = [
        ("Claim", _claim(chapter, asked)), ("Evidence", _evidence(chapter, asked)),
        ("Smallest failure", _breaks(asked)), ("Sensitivity", _matters(asked)), ("Closest to limits", _limits(chapter)),
        ("Assumed", "; ".join([shape, *(f"{label.lower()}: {text}" for label, text in known if text)])),
        ("Held constant", f"{'; '.join(standing(chapter))}; {ELSE}"), ("Not covered", _not_said(asked)),
        ("Computed from", join([f"{code or f'skillframe {skillframe.__version__}'}; {files}. To check: ", check])),
    ]  # fmt: skip
    words = {"pass": "certified", "fail": "does not hold" if asked.wrong else "fail", "undecided": "undecided"}
    head = tag(
        "div", tag("p", words[found.word], class_="verdict-word"), tag("p", found.why), class_=f"verdict {found.word}"
    )
    beside, below = (
        tag("dl", *(join([tag("dt", label), tag("dd", text)]) for label, text in part if text))
        for part in (told[:5], told[5:])
    )
    drawn = border_map(asked, regions(chapter.scene, asked.names))
    signed = (
        ""
        if asked.wrong
        else tag("p", "Signed: ", tag("span", "", class_="line"), " Date: ", tag("span", "", class_="line short"))
    )
    return tag(
        "section", tag("h2", f"Certificate: {chapter.name}"), head,
        tag("div", beside, drawn, class_="certified"), below, signed, class_="certificate",
        aria_label="Certificate",
    )  # fmt: skip


def _claim(chapter: Chapter, asked: Asked) -> str:
    told, box = asked.predicate or {}, box_of(asked)
    rate = percent(float(told.get("rate", asked.question.rate)))
    results = chapter.results
    skill = str(told.get("skill") or (results.skills[0] if results and results.skills else "the skill"))
    robot, world = (name_of(str(told.get(key) or chapter.spec.get(key, ""))) for key in ("robot", "world"))
    where = f"{skill}, {robot} in {world}"
    sure = percent(float(told.get("confidence", asked.question.confidence)))
    shown = [(quantity(name), *ends) for name, ends in box.items()]
    spans = "; ".join(
        f"{q.label} {number(q.factor * low)} to {number(q.factor * high)} {q.unit}".strip() for q, low, high in shown
    )
    if not box:
        return f"{where}: no box is claimed. Required: at least {rate} with {sure} confidence."
    said = "succeeds" if told.get("certified") else "was claimed to succeed"
    share = f" ({percent(float(told['share_of_declared']))} of what was declared)" if told.get("certified") else ""
    return f"{where} {said} in at least {rate} of trials, with {sure} confidence, in the mean over: {spans}{share}."


def _evidence(chapter: Chapter, asked: Asked) -> str:
    told = asked.predicate or {}
    counts = [f"{each['failures']} of {each['trials']}" for each in told.get("tested", [])]
    parts = [f"failures among fresh trials, smallest box first: {', '.join(counts)}"] if counts else []
    failed = told.get("failed_trials", [])
    if failed:
        some = ", ".join(map(str, failed[:6])) + (" ..." if len(failed) > 6 else "")
        parts.append(
            f"failed trials: {some} (to replay one: skillframe campaign replay {asked.folder}/{asked.evidence} TRIAL)"
        )
    parts.append(f"exploratory trials before the claim: {int(asked.works.sum())} of {len(asked.works)} succeeded")
    if asked.claim:
        spent = percent(float(asked.claim["alpha_spent"]))
        parts.append(f"claim {asked.claim['number']} of this folder, significance spent so far: {spent}")
    if (told.get("seed_drawn_by") or (asked.claim or {}).get("entropy_from", SYSTEM)) != SYSTEM:
        parts.append(CHOSEN)
    if "ran_again" in told:
        parts.append(said_again(RanAgain(**told["ran_again"])))
    results = chapter.results
    causes = results.causes(results.skills[0]) if results and results.rows and told.get("tested") else []
    parts += [f"cause of failure: {cause} ({len(trials)})" for cause, trials in causes[:2]]
    return "; ".join(parts) + "."


def _breaks(asked: Asked) -> str:
    found = asked.found.get(BREAK)
    if found is None:
        return f"not searched; to search: skillframe certify find-failure {asked.folder}"
    if not found["confirmed"]:
        return f"none found in {found['trials']} trials over the declared ranges"
    at = ", ".join(f"{quantity(n).label} {number(quantity(n).factor * v)} {quantity(n).unit}".strip()
                   for n, v in found["point"].items())  # fmt: skip
    again = f"{found['confirmations'][-1]} of {found['fresh_trials']} fresh trials"
    return (
        f"{found['size']:.2f} of the half ranges: {at}. {again} "
        f"fail there (to replay one: skillframe campaign replay {asked.folder}/confirm/{found['round']} 0). "
        f"A smaller one that none of the {found['trials']} trials met may exist."
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
    """Maximum and 99th percentile of quantities with a limit, nearest to it first."""
    results = chapter.results
    if results is None or not results.rows:
        return ""
    rows, lines = results.of(results.skills[0]), []
    for margin in margins_of(chapter, rows)[:3]:
        values = np.array([row.values.get(margin.column, math.nan) for row in rows])
        values = margin.factor * values[np.isfinite(values)]
        limit = f" (limit {number(margin.factor * margin.limit)} {margin.unit})" if margin.limit else ""
        lines.append(
            f"{margin.what}: maximum {number(float(values.max()))}, 99th percentile "
            f"{number(float(np.quantile(values, 0.99)))} {margin.unit}{limit}"
        )
    return "; ".join(lines)


def _not_said(asked: Asked) -> str:
    found = asked.found.get(BORDER, {})
    size = found.get("smallest_island")
    island = f"; islands below {percent(float(size))} of the ranges may have been missed" if size else ""
    return (
        f"The rate is a mean over the box; its corners may be worse{island}. Everything was simulated, and nothing was "
        "measured on a real robot. There is no claim about the safety of people. The certificate does not know of "
        "other folders, of trials seen before, or of deleted claims. Plug-ins are trusted code: a certificate guards "
        "against mistakes, not against a plug-in that is written to deceive."
    )
