"""summary.json: rates with intervals that hold, comparisons in pairs, and what the figures depend on."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

from skillframe.campaign.packed import RowView
from skillframe.campaign.race import Race
from skillframe.campaign.rows import LEFT_OUT, SCORE, Row
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import correction, holm
from skillframe.campaign.store import FORMAT, VERSION
from skillframe.campaign.validity import Basis, Validity, unbroken, validity_of
from skillframe.campaign.verdict import judged
from skillframe.errors import InputError
from skillframe.execution.scores import about
from skillframe.execution.tracemeta import SHARES
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.robot.guesses import guess_note
from skillframe.robot.spec import load_robot

SUMMARY = "summary.json"
PEAKS = ("peak_force_n", "peak_force_10ms_n", "peak_force_filtered_n", *SHARES)


def rates(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> dict[str, dict[str, Any]]:
    """Per skill: trials, successes, rate, `interval_95` (null if there is none), method, and how often which failure.

    Besides, how often which code of `ended_by`, and the largest forces and shares of the motors. Which interval it is,
    and why there may be none, `validity` says. An unfinished campaign counts each skill's trials up to the first one
    that is missing; `uncounted` is the number of its rows beyond. `unended` counts successes whose skill had not
    ended by itself when the time was up. A skill that a race left out says after how many trials, `left_out_after`.
    """
    validity = validity_of(spec.plan, complete=complete)
    return {label: _rate(_of(rows, label, complete), rows, label, validity) for label in spec.labels}


def _of(rows: Sequence[Row], label: str, complete: bool) -> Sequence[Row]:
    """The rows of a skill that count."""
    mine = {place: row["trial"] for place, row in enumerate(rows) if row["skill"] == label}
    reach = unbroken(mine.values())
    return RowView(rows.__getitem__, [place for place, trial in mine.items() if complete or trial < reach])


def _rate(counted: Sequence[Row], rows: Sequence[Row], label: str, validity: Validity) -> dict[str, Any]:
    n, s, unended = len(counted), 0, 0
    failures, ended, largest = Counter[str](), Counter[str](), dict[str, float | None].fromkeys(PEAKS)
    for row in counted:  # once, for each is made anew
        s += row["success"]
        unended += row["success"] and row.get("ended_itself") is False
        if not row["success"]:
            failures[row["failure"]] += 1
        if "ended_by" in row:  # rows of 0.1 do not say
            ended[row["ended_by"]] += 1
        for name in PEAKS:
            largest[name] = _larger(largest[name], row.get(name))
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
        "uncounted": sum(row["skill"] == label for row in rows) - n,
        **({LEFT_OUT: counted[0][LEFT_OUT]} if counted and LEFT_OUT in counted[0] else {}),
    }


def _larger(found: float | None, value: Any) -> float | None:
    """The larger of what was found and a finite number."""
    if not isinstance(value, float) or not math.isfinite(value):
        return found
    return value if found is None or value > found else found


def scores(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> dict[str, dict[str, Any]]:
    """Per score its unit, its summary, and by skill how many trials have it, its median, smallest and largest value.

    The trials are those that count for the rates. A skill without any such trial has nulls.
    """
    return {
        name: about(name) | {"skills": {label: _spread(_of(rows, label, complete), name) for label in spec.labels}}
        for name in spec.scores
    }


def _spread(rows: Sequence[Row], name: str) -> dict[str, float | int | None]:
    values = [row[SCORE + name] for row in rows if not math.isnan(row[SCORE + name])]
    if not values:
        return {"trials": 0, "median": None, "smallest": None, "largest": None}
    return {"trials": len(values), "median": median(values), "smallest": min(values), "largest": max(values)}


def comparisons(
    spec: CampaignSpec, rows: Sequence[Row], complete: bool, race: Race | None = None
) -> list[dict[str, Any]]:
    """Every pair of skills on the trials that both ran. `p_value` is corrected for the number of pairs.

    The p-values of a race are the smallest ones at its looks.
    """
    validity = validity_of(spec.plan, complete=complete)
    outcome = {label: {r["trial"]: r["success"] for r in _of(rows, label, complete)} for label in spec.labels}
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
    """The whole of summary.json.

    Args:
        spec: the campaign.
        rows: its rows, ordered.
        sessions: the notes of `RowLog`; the last one's workers and versions are the summary's.
        complete: all trials ran, or the campaign stopped early as asked.
        stop_after: last trial of a campaign that stopped early.
        hashes: of the campaign and of its files.
        race: of a campaign that is one.
    """
    opened = [session for session in sessions if "environment" in session]
    last = opened[-1] if opened else {}
    figures = rates(spec, rows, complete)
    guess = _guessed(spec, rows)
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
        **_verdict(spec, figures, complete),
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


def _verdict(spec: CampaignSpec, figures: Mapping[str, Mapping[str, Any]], complete: bool) -> dict[str, Any]:
    """`verdict`, where the campaign requires something: of which skill, what, and what came of it."""
    if spec.expect.rate is None:
        return {}
    label = spec.expect.skill or spec.labels[0]
    word, why = judged(spec.expect.rate, figures[label], complete=complete)
    return {"verdict": {"skill": label, "required_rate": spec.expect.rate, "verdict": word, "why": why}}


def _guessed(spec: CampaignSpec, rows: Sequence[Row]) -> str:
    """What to say of the robot's guessed masses where a trial failed, else ""."""
    failed = any(not row["success"] for row in rows)
    return guess_note(load_robot(str(spec.folder / spec.robot))) if failed else ""


def write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json, whole or not at all."""
    text = json.dumps(summary, indent=2, sort_keys=True, ensure_ascii=False) + "\n"
    write_whole(folder / SUMMARY, text.encode())


def read_summary(folder: Path) -> dict[str, Any]:
    """The summary of a campaign's folder.

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
    """A sentence if a complete campaign does not reach its threshold, else "". `Expect.by` says what has to."""
    label, required = spec.expect.skill or spec.labels[0], spec.expect.rate
    if required is None or not summary["complete"]:
        return ""
    figures = summary["skills"][label]
    if spec.expect.by == "interval":
        word, why = judged(required, figures, complete=True)
        return "" if word == "pass" else f"{label}: {word}: {why}"
    rate = figures["rate"]
    return "" if rate >= required else f"{label}: success rate {rate:.3f} is below the threshold of {required:g}"
