"""What a skill file keeps as evidence, checked when it is read: words and pictures are made from it, a run is not.

All of it may be missing, from a file written by hand. What is there must be of its kind, and demonstrations come with
what is drawn beside them.
"""

from __future__ import annotations

from typing import Any

from skillframe.config import coerce
from skillframe.errors import InputError

Vector = tuple[float, float, float]

KINDS: dict[str, Any] = {
    "held": bool,
    "message": str,
    "pyramid_angle_rad": float | None,
    "feasible_solid_angle_sr": float | None,
    "work_teacher_j": float,
    "work_environment_j": float,
    "criterion": list[float],
    "demonstrations": list[dict[str, Any]],
}
SHOWN = {"motion": list[Vector], "push": list[Vector], "contact": list[bool], "mean_direction": Vector}


def check_evidence(evidence: dict[str, Any], where: str) -> dict[str, Any]:
    """The same evidence.

    Args:
        evidence: of one part, as in the file.
        where: its key, for messages.

    Raises:
        InputError: something is not of its kind, or only half there; names the key.
    """
    shown = bool(evidence.get("demonstrations"))
    _check(evidence, KINDS, where, required=shown)
    if evidence.get("pyramid_angle_rad") is not None and evidence.get("feasible_solid_angle_sr") is None:
        raise InputError(where, "holds pyramid_angle_rad without feasible_solid_angle_sr", "learn the skill again")
    for i, seen in enumerate(evidence["demonstrations"] if shown else []):
        spot = f"{where}.demonstrations[{i}]"
        _check(seen, SHOWN, spot, required=True)
        if len({len(seen[key]) for key in ("motion", "push", "contact")}) > 1:
            raise InputError(spot, "holds motion, push and contact of different lengths", "learn the skill again")
    return evidence


def _check(values: dict[str, Any], kinds: dict[str, Any], where: str, *, required: bool) -> None:
    for key, kind in kinds.items():
        if key in values:
            coerce(values[key], kind, f"{where}.{key}")
        elif required:
            raise InputError(where, f"lacks the key {key!r}", "add it, or learn the skill again")
