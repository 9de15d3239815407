"""summary.json: rates with intervals that hold, comparisons in pairs, and what the figures depend on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from skillframe.campaign import statistics
from skillframe.campaign.rows import Row
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.store import FORMAT, VERSION, write_text
from skillframe.errors import InputError

SUMMARY = "summary.json"


def rates(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> dict[str, dict[str, Any]]:
    """Per skill: trials, successes, rate, `interval_95`, method, and how often which failure.

    The interval is Clopper-Pearson's where the number of trials was fixed and all of them ran; a campaign that can stop
    early, or is looked at before its end, gets the confidence sequence.
    """
    return {
        label: _rate([r for r in rows if r["skill"] == label], label, _fixed(spec, complete)) for label in spec.labels
    }


def _fixed(spec: CampaignSpec, complete: bool) -> bool:
    return complete and spec.stop.interval_width is None


def _rate(rows: Sequence[Row], label: str, fixed: bool) -> dict[str, Any]:
    n, s = len(rows), sum(row["success"] for row in rows)
    interval = statistics.clopper_pearson if fixed else statistics.confidence_sequence
    failures = [row["failure"] for row in rows if not row["success"]]
    return {
        "skill": label,
        "trials": n,
        "successes": s,
        "rate": s / n if n else None,
        "interval_95": list(interval(s, n)) if n else [0.0, 1.0],
        "method": statistics.CLOPPER_PEARSON if fixed else statistics.SEQUENCE,
        "failures": {text: failures.count(text) for text in sorted(set(failures))},
    }


def comparisons(spec: CampaignSpec, rows: Sequence[Row], complete: bool) -> list[dict[str, Any]]:
    """Every pair of skills on the trials that both ran."""
    outcome = {label: {r["trial"]: r["success"] for r in rows if r["skill"] == label} for label in spec.labels}
    return [_comparison(a, b, outcome, _fixed(spec, complete)) for a, b in combinations(spec.labels, 2)]


def _comparison(a: str, b: str, outcome: Mapping[str, Mapping[int, bool]], fixed: bool) -> dict[str, Any]:
    pairs = [(outcome[a][t], outcome[b][t]) for t in outcome[a] if t in outcome[b]]
    first, second = pairs.count((True, False)), pairs.count((False, True))
    test = statistics.mcnemar if fixed else statistics.mcnemar_sequential
    return {
        "first": a,
        "second": b,
        "trials": len(pairs),
        "both": pairs.count((True, True)),
        "only_first": first,
        "only_second": second,
        "neither": pairs.count((False, False)),
        "p_value": test(first, second),
        "method": statistics.MCNEMAR if fixed else statistics.MCNEMAR_SEQUENTIAL,
    }


def summarize(
    spec: CampaignSpec, rows: Sequence[Row], sessions: Sequence[Mapping[str, Any]], *, complete: bool,
    stop_after: int | None, hashes: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """The whole of summary.json.

    Args:
        spec: the campaign.
        rows: its rows, ordered.
        sessions: the notes of `RowLog`; the last one's workers and versions are the summary's.
        complete: all trials ran, or the campaign stopped early as asked.
        stop_after: last trial of a campaign that stopped early.
        hashes: of the campaign and of its files.
    """
    opened = [session for session in sessions if "environment" in session]
    last = opened[-1] if opened else {}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": spec.name,
        "seed": spec.seed,
        "robot": spec.robot,
        "world": spec.world,
        "planned_trials": spec.trials,
        "complete": complete,
        "stopped_after_trial": stop_after,
        "skills": rates(spec, rows, complete),
        "comparisons": comparisons(spec, rows, complete),
        "wall_s": sum(s.get("wall_s", 0.0) for s in sessions),
        "workers": last.get("workers"),
        "versions": last.get("environment", {}),
        "sessions": len(opened),
        "hashes": dict(hashes),
    }


def write_summary(folder: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json, whole or not at all."""
    write_text(folder / SUMMARY, json.dumps(summary, indent=2, sort_keys=True, ensure_ascii=False) + "\n")


def read_summary(folder: Path) -> dict[str, Any]:
    """The summary of a campaign's folder.

    Raises:
        InputError: there is none, or it is damaged.
    """
    path = folder / SUMMARY
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "no such file", f"type skillframe campaign resume {folder}") from None
    except ValueError as error:
        raise InputError(path, f"is not JSON ({error})", f"type skillframe campaign resume {folder}") from None
    return content


def below_bar(spec: CampaignSpec, summary: Mapping[str, Any]) -> str:
    """A sentence if a complete campaign's rate is below its stated bar, else ""."""
    label = spec.expect.skill or spec.labels[0]
    rate = summary["skills"][label]["rate"]
    if spec.expect.rate is None or not summary["complete"] or rate >= spec.expect.rate:
        return ""
    return f"{label}: success rate {rate:.3f} is below the bar of {spec.expect.rate:g}"
