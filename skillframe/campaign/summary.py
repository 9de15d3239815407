"""summary.json: rates with intervals, paired comparisons, and what the figures depend on."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

from skillframe.campaign.folder import SUMMARY
from skillframe.campaign.race import Race
from skillframe.campaign.row_format import RowView
from skillframe.campaign.rows import LEFT_OUT, SCORE, Row, is_trial
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import Basis, Validity, correction, holm, judged, unbroken, validity_of
from skillframe.campaign.store import FORMAT, VERSION
from skillframe.errors import InputError
from skillframe.execution.trace import SHARES, about
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.robot.link_checks import guess_note
from skillframe.robot.spec import load_robot

PEAKS = ("peak_force_n", "peak_force_10ms_n", "peak_force_filtered_n", *SHARES)


def rates(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> dict[str, dict[str, Any]]:
    """Per skill: trials, successes, rate, `interval_95` (or null), method, and the count of each failure.

    Also the count of each `ended_by`, and the largest forces and shares of the motors. An unfinished campaign counts
    each skill's trials up to the first missing one; `uncounted` is the number of rows beyond. `unended` counts
    successes whose skill had not ended by itself, `refused` the starts in penetration, which are in no other figure.
    `left_out_after` is the number of trials of a skill that a race left out.
    """
    validity = validity_of(spec.plan, complete=complete)
    return {label: _rate(_of(rows, label, complete), rows, label, validity) for label in spec.labels}


def _of(rows: Sequence[Row], label: str, complete: bool) -> Sequence[Row]:
    mine = {place: row["trial"] for place, row in enumerate(rows) if row["skill"] == label}
    reach = unbroken(mine.values())
    return RowView(rows.__getitem__, [place for place, trial in mine.items() if complete or trial < reach])


def _rate(counted: Sequence[Row], rows: Sequence[Row], label: str, validity: Validity) -> dict[str, Any]:
    n, s, unended, inside = 0, 0, 0, list[str]()
    failures, ended, largest = Counter[str](), Counter[str](), dict[str, float | None].fromkeys(PEAKS)
    for row in counted:  # one pass, as each row is unpacked anew
        if not is_trial(row):
            inside.append(f"trial {row['trial']} {row['failure']}")
            continue
        n += 1
        s += row["success"]
        unended += row["success"] and row.get("ended_itself") is False
        if not row["success"]:
            failures[row["failure"]] += 1
        if "ended_by" in row:  # absent in version 0.1
            ended[row["ended_by"]] += 1
        for name in PEAKS:
            found, value = largest[name], row.get(name)
            if isinstance(value, float) and math.isfinite(value) and (found is None or value > found):
                largest[name] = value
    interval = validity.interval(s, n)
    return {
        "skill": label,
        "trials": n,
        "successes": s,
        "unended": unended,
        "rate": s / n if n else None,
        "interval_95": None if interval is None else list(interval),
        "method": validity.interval_method,
        "failures": dict(sorted(failures.items())),
        "ended_by": dict(sorted(ended.items())),
        "largest": largest,
        "uncounted": sum(row["skill"] == label for row in rows) - len(counted),
        "refused": len(inside),
        **({"refused_first": inside[0]} if inside else {}),
        **({LEFT_OUT: counted[0][LEFT_OUT]} if counted and LEFT_OUT in counted[0] else {}),
    }


def scores(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> dict[str, dict[str, Any]]:
    """Per score its unit and summary, and per skill the number of trials, median, smallest and largest value (or null).

    The trials are those that count for the rates.
    """
    return {
        name: about(name) | {"skills": {label: _spread(_of(rows, label, complete), name) for label in spec.labels}}
        for name in spec.scores
    }


def _spread(rows: Sequence[Row], name: str) -> dict[str, float | int | None]:
    values = [row[SCORE + name] for row in rows if is_trial(row) and not math.isnan(row[SCORE + name])]
    if not values:
        return {"trials": 0, "median": None, "smallest": None, "largest": None}
    return {"trials": len(values), "median": median(values), "smallest": min(values), "largest": max(values)}


def comparisons(
    spec: CampaignSpec, rows: Sequence[Row], complete: bool, race: Race | None = None
) -> list[dict[str, Any]]:
    """Every pair of skills on the trials that both ran. `p_value` is corrected for the number of pairs.

    For a race, the p-values are the smallest at its looks.
    """
    validity = validity_of(spec.plan, complete=complete)
    ended = {label: filter(is_trial, _of(rows, label, complete)) for label in spec.labels}
    outcome = {label: {row["trial"]: row["success"] for row in ended[label]} for label in spec.labels}
    pairs = [_comparison(a, b, outcome, validity) for a, b in combinations(spec.labels, 2)]
    if race is not None:
        for pair in pairs:
            pair["p_value_uncorrected"] = race.minima[pair["first"], pair["second"]]
    if validity.basis is not Basis.NONE:
        for pair, corrected in zip(pairs, holm([p["p_value_uncorrected"] for p in pairs]), strict=True):
            pair |= {"p_value": corrected, "correction": correction(len(pairs))}
    return pairs


def _comparison(a: str, b: str, outcome: Mapping[str, Mapping[int, bool]], validity: Validity) -> dict[str, Any]:
    pairs = [(outcome[a][t], outcome[b][t]) for t in outcome[a] if t in outcome[b]]
    first, second = pairs.count((True, False)), pairs.count((False, True))
    return {
        "first": a,
        "second": b,
        "trials": len(pairs),
        "both": pairs.count((True, True)),
        "only_first": first,
        "only_second": second,
        "neither": pairs.count((False, False)),
        "p_value": None,
        "p_value_uncorrected": validity.p_value(first, second),
        "correction": None,
        "method": validity.test_method,
    }


def summarize(
    spec: CampaignSpec, rows: Sequence[Row], sessions: Sequence[Mapping[str, Any]], *, complete: bool,
    stop_after: int | None, hashes: Mapping[str, Any], race: Race | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The content of summary.json."""
    opened = [session for session in sessions if "environment" in session]
    last = opened[-1] if opened else {}
    figures = rates(spec, rows, complete)
    failed = any(not row["success"] for row in rows if is_trial(row))
    guess = guess_note(load_robot(str(spec.folder / spec.robot))) if failed else ""
    verdict: dict[str, Any] = {}
    if spec.expect.rate is not None:
        label = spec.expect.skill or spec.labels[0]
        word, why = judged(spec.expect.rate, figures[label], complete=complete)
        verdict = {"verdict": {"skill": label, "required_rate": spec.expect.rate, "verdict": word, "why": why}}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": spec.name,
        "seed": spec.seed,
        "robot": spec.robot,
        "world": spec.world_name,
        "planned_trials": spec.trials,
        "complete": complete,
        "stopped_after_trial": stop_after,
        "skills": figures,
        **verdict,
        "comparisons": comparisons(spec, rows, complete, race),
        **({"race": race.outcome()} if race else {}),
        **({"scores": scores(spec, rows, complete)} if spec.scores else {}),
        **({"guessed_masses": guess} if guess else {}),
        "wall_s": sum(s.get("wall_s", 0.0) for s in sessions),
        "workers": last.get("workers"),
        "versions": last.get("environment", {}),
        "sessions": len(opened),
        "hashes": dict(hashes),
    }


def refused_text(figures: Mapping[str, Any]) -> str:
    """Sentence on refused starts, or "". `figures` as from `rates`."""
    count = figures.get("refused", 0)
    if not count:
        return ""
    share = f"{count} of {count + figures['trials']} starts ({count / (count + figures['trials']):.1%})"
    return (
        f"{share} are refused and count neither as successes nor as failures: the rate is of the other starts of the "
        f"declared ranges alone. The first: {figures['refused_first']}. Narrow the ranges"
    )


def write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json as a whole."""
    text = json.dumps(summary, indent=2, sort_keys=True, ensure_ascii=False) + "\n"
    write_whole(folder / SUMMARY, text.encode())


def read_summary(folder: Path) -> dict[str, Any]:
    """Read summary.json of a campaign's folder.

    Raises:
        InputError: there is none, or it is damaged.
    """
    path = folder / SUMMARY
    again = f"type skillframe campaign resume {folder}"
    content = read_json(path, again)
    if not isinstance(content, dict):
        raise InputError(path, "holds no JSON object", again)
    return content


def below_bar(spec: CampaignSpec, summary: Mapping[str, Any]) -> str:
    """A sentence if a complete campaign misses its threshold by `Expect.by`, otherwise ""."""
    label, required = spec.expect.skill or spec.labels[0], spec.expect.rate
    if required is None or not summary["complete"]:
        return ""
    figures = summary["skills"][label]
    if spec.expect.by == "interval":
        word, why = judged(required, figures, complete=True)
        return "" if word == "pass" else f"{label}: {word}: {why}"
    rate = figures["rate"]
    if rate is None:
        return f"{label}: no trial, for all {figures['refused']} starts are inside something"
    return "" if rate >= required else f"{label}: success rate {rate:.3f} is below the threshold of {required:g}"
