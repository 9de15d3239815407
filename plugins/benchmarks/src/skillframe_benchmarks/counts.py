"""Results of assemblies, and rates over them with intervals.

Trials of one assembly are correlated, so intervals resample assemblies (percentile bootstrap, Efron 1979), not trials.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.campaign import is_trial
from skillframe_benchmarks.assembly import DONE, REFUSED, TRIALS, UNLEARNED, Level, by_level
from skillframe_benchmarks.scores import passes

OFTEN = 0.8
"""Bootstrap samples, share of successes of a solved assembly (published: 80 %), and fewest assemblies for an interval.
"""
NOT_LEARNED = "not learned"
RIM_M = 0.001
"""Distance to the hole entrance within which a part has not entered [m]."""


class Cell(NamedTuple):
    """One method at one level on one assembly.

    Attributes:
        trials, seated: counts; seated is within 1 mm of the assembled height and 2 mm sideways.
        checked: trials that pass the published check; None where its height is unknown.
        causes: counts of unseated trials by cause.
        force: median peak force, NaN if none ran [N]; seconds: median duration of seated trials, NaN without one.
        refused: starts inside the socket, not counted as trials.
    """

    trials: int
    seated: int
    checked: int | None
    causes: Mapping[str, int]
    force: float
    seconds: float
    refused: int = 0


class Found(NamedTuple):
    """One assembly.

    Attributes:
        name: of the assembly.
        refused: "step: why", or "" if it ran.
        unlearned: reason by method that learned nothing; its trials count as failed.
        parts: measures of its meshes; {} where they were refused.
        cost: processor time of each step [s].
        cells: by (level, method).
        picture: file of a picture of the parts, if any.
    """

    name: str
    refused: str
    unlearned: Mapping[str, str]
    parts: Mapping[str, Any]
    cost: Mapping[str, float]
    cells: Mapping[tuple[str, str], Cell]
    picture: Path


class Share(NamedTuple):
    """A rate over assemblies, its 95 % bootstrap interval (None of too few), and the number that reach 80 %."""

    rate: float
    low: float | None
    high: float | None
    often: int
    assemblies: int


def read(folder: Path, levels: Iterable[Level]) -> Found | None:
    """One assembly, or None while it is not done."""
    if not (folder / DONE).exists():
        return None
    refused = _json(folder / REFUSED)
    parts = _json(folder / "parts.json")
    plan, unlearned = _json(folder / DONE), _json(folder / UNLEARNED)
    cells = _cells(folder / TRIALS, plan, parts) if (folder / TRIALS / "summary.json").exists() else {}
    if unlearned:
        checked, trials = None if parts.get("way_out_m") is None else 0, plan["trials"]
        none = Cell(trials, 0, checked, {NOT_LEARNED: trials}, float("nan"), float("nan"))
        cells |= {(level.name, method): none for level in levels for method in unlearned}
    text = f"{refused['step']}: {refused['why']}" if refused else ""
    return Found(folder.name, text, unlearned, parts, _json(folder / "cost.json"), cells, folder / "parts.png")


def _json(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return found


def _cells(campaign: Path, plan: Mapping[str, Any], parts: Mapping[str, Any]) -> dict[tuple[str, str], Cell]:
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for level, rows in by_level(campaign, plan["levels"], plan["trials"]).items():
        for row in rows:
            found.setdefault((level, row["skill"].removesuffix(".skill.json")), []).append(row)
    return {key: _cell(each, parts) for key, each in found.items()}


def _cell(drawn: Sequence[Mapping[str, Any]], parts: Mapping[str, Any]) -> Cell:
    rows = [row for row in drawn if is_trial(row)]
    way_out, lost = parts.get("way_out_m"), [row for row in rows if not row["success"]]
    checked = None if way_out is None else sum(passes(*_end(row), way_out) for row in rows)
    times = [row["duration_s"] for row in rows if row["success"]]
    return Cell(
        trials=len(rows), seated=len(rows) - len(lost), checked=checked,
        causes=Counter(cause(row, parts["depth_m"]) for row in lost),
        force=float(np.median([row["peak_force_n"] for row in rows])) if rows else float("nan"),
        seconds=float(np.median(times)) if times else float("nan"), refused=len(drawn) - len(rows),
    )  # fmt: skip


def _end(row: Mapping[str, Any]) -> tuple[float, float]:
    return row["score.automate_height"], row["score.automate_distance"]


def cause(row: Mapping[str, Any], depth: float) -> str:
    """Why a trial is not seated: its end, or its final place."""
    if row["ended_by"] not in ("skill", "time"):
        return str(row["ended_by"]).replace("_", " ")
    height = _end(row)[0]
    if row["goal_reached"]:
        return "seated, not ended"
    if height > depth - RIM_M:
        return "on the rim"
    return "entered and stopped" if height > RIM_M else "beside or tilted"


def share(cells: Sequence[Cell], checked: bool = False) -> Share:
    """Mean rate of assemblies, seated or by the published check."""
    hits = [float((cell.checked or 0) if checked else cell.seated) for cell in cells]
    rates = np.array([n / cell.trials if cell.trials else float("nan") for n, cell in zip(hits, cells, strict=True)])
    low = high = None
    if len(rates) >= 5:  # fewer assemblies give no interval
        rng = np.random.default_rng(0)  # of the interval alone
        means = rng.choice(rates, (4000, len(rates))).mean(axis=1)  # bootstrap samples
        low, high = (float(each) for each in np.quantile(means, (0.025, 0.975)))
    return Share(float(rates.mean()), low, high, int((rates >= OFTEN).sum()), len(rates))
