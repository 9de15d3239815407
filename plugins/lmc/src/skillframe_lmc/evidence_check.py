"""Check of the evidence in a skill file, which words and pictures use and a run does not.

A file written by hand may lack it.
"""

from __future__ import annotations

from typing import Any

from skillframe.config import coerce
from skillframe.errors import InputError

Vector = tuple[float, float, float]

KINDS: dict[str, Any] = {
    "held": bool,
    "message": str,
    "explained": float | None,
    "pyramid_angle_rad": float | None,
    "feasible_solid_angle_sr": float | None,
    "work_teacher_j": float,
    "work_environment_j": float,
    "criterion": list[float],
    "whole": float,
    "demonstrations": list[dict[str, Any]],
}
ROWS: dict[str, Any] = {
    "motion": list[Vector], "push": list[Vector], "edge": list[Vector], "contact": list[bool], "length": list[float],
    "turning": list[float],
}  # fmt: skip
SHOWN = {**ROWS, "mean_direction": Vector}


def check_evidence(evidence: dict[str, Any], where: str) -> dict[str, Any]:
    """The same evidence.

    Args:
        evidence: of one part, as in the file.
        where: its key, for messages.

    Raises:
        InputError: a wrong type, or incomplete; names the key.
    """
    shown = bool(evidence.get("demonstrations"))
    _check(evidence, KINDS, where, required=shown)
    if evidence.get("explained") is not None and evidence.get("feasible_solid_angle_sr") is None:
        raise InputError(where, "holds explained without feasible_solid_angle_sr", "learn the skill again")
    for i, seen in enumerate(evidence["demonstrations"] if shown else []):
        spot = f"{where}.demonstrations[{i}]"
        _check(seen, SHOWN, spot, required=True)
        if len({len(seen[key]) for key in ROWS}) > 1:
            raise InputError(spot, f"holds {', '.join(ROWS)} of different lengths", "learn the skill again")
    return evidence


def _check(values: dict[str, Any], kinds: dict[str, Any], where: str, *, required: bool) -> None:
    for key, kind in kinds.items():
        if key in values:
            coerce(values[key], kind, f"{where}.{key}")
        elif required:
            raise InputError(where, f"lacks the key {key!r}", "add it, or learn the skill again")
