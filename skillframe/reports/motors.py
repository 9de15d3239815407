"""How near the joints came to their limits: shares of torque, speed and range, of trials and of one run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median_low
from typing import Any

from skillframe.execution.tracemeta import SHARE_JOINTS, SHARES
from skillframe.reports.markup import Markup, join, note, table, tag
from skillframe.reports.results import ResultRow, Results
from skillframe.reports.sources import Chapter

KINDS = ("torque", "speed", "range")
HEAD = ("share of the limit", "skill", "worst", "joint", "trial", "typical", "joint", "trial")
CAPTION = (
    "Torque: what the law asked a joint for, over the URDF's effort; above 100 % the motor could not follow. Speed: "
    "over the URDF's velocity. Range: distance of a joint from the middle of its range over half the range, 0 % in the "
    "middle, 100 % at an end. Each trial counts with its peak, of the joint that had the largest share; typical is the "
    "median of all trials, failed ones too."
)
RUN_WORDS = (
    "torque at most {} of its limit", "speed at most {} of its limit",
    "range at most {} from its middle to an end",
)  # fmt: skip


def motors_table(chapter: Chapter, results: Results) -> Markup:
    """Worst and typical trial of each share and skill, and what the URDF does not limit. "" if nothing is known."""
    rows = [row for kind in range(len(KINDS)) for skill in results.skills if (row := _row(results, skill, kind))]
    told = chapter.scene.get("notes")
    said = [note(f"{text[:1].upper()}{text[1:]}.") for text in (told if isinstance(told, list) else []) if text]
    if not rows:
        return join([tag("h3", "What the motors were asked for"), *said]) if said else Markup("")
    return join([
        tag("h3", "What the motors were asked for"), *said, table(HEAD, rows, numeric=2),
        tag("p", CAPTION, class_="caption"),
    ])  # fmt: skip


def _row(results: Results, skill: str, kind: int) -> tuple[object, ...] | None:
    """The cells of one share, or None where no trial has it."""
    share = SHARES[kind]
    known = [row for row in results.of(skill) if math.isfinite(row.values.get(share, math.nan))]
    if not known:
        return None
    worst = max(known, key=lambda row: row.values[share])
    middle = median_low(sorted((row.values[share], row.trial) for row in known))
    typical = next(row for row in known if (row.values[share], row.trial) == middle)
    return (KINDS[kind], skill, *_cells(worst, kind), *_cells(typical, kind))


def _cells(row: ResultRow, kind: int) -> tuple[object, ...]:
    return _share(row.values[SHARES[kind]]), row.words.get(SHARE_JOINTS[kind], ""), row.trial


def _share(value: float) -> str:
    """A share as per cent, with a decimal where it is small."""
    return f"{100.0 * value:.0f} %" if value >= 0.095 else f"{100.0 * value:.1f} %"


def said_of_motors(meta: Mapping[str, Any]) -> list[str]:
    """The shares of a run in words, each with its joint, from the metadata of its trace."""
    parts = zip(RUN_WORDS, SHARES, SHARE_JOINTS, strict=True)
    found = [(text, meta.get(share), meta.get(joint)) for text, share, joint in parts]
    return [
        text.format(f"{share:.0%}") + (f" ({joint})" if joint else "")
        for text, share, joint in found
        if isinstance(share, int | float)
    ]
