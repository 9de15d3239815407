"""Policy part of the skill file: `phases`, each with its kind of skill, and the `phase_model`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.config import coerce
from skillframe.errors import InputError
from skillframe.extend import Document, registry
from skillframe.frames import Float
from skillframe_segmenter.model import PhaseModel, from_document
from skillframe_segmenter.placed import is_placed, learned_of, placement_of

FOLLOWED = ("wrench_hmm", "pose_hmm")
SHARED = ("phases", "phase_model", "demonstrations", "type", "type_version", "recoveries", "explained", "phase_min_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyDocument:
    """A checked policy.

    Attributes:
        skills: a whole skill document for each phase.
        model: to follow the phases online; None where phases end by themselves only.
        successors: (P, P + 1) counts of successions, the last column the end, see `to_the_common_end`.
        recoveries: failures of a phase that are recovered from.
    """

    skills: list[Document]
    model: PhaseModel | None
    successors: Float
    recoveries: int


def read(document: Document) -> PolicyDocument:
    """The policy of a document.

    Raises:
        InputError: phases and phase model do not match, or a key that is missing or has a wrong value.
        UnknownName: a phase's kind of skill is not installed.
    """
    phases = document.get("phases", [])
    if not phases:
        raise InputError("phases", "a policy needs at least one phase", "segment the demonstrations again")
    model = _get(document, "phase_model", dict[str, Any])
    followed = from_document(model) if _get(model, "type", str, "phase_model.") in FOLLOWED else None
    successors = np.array(coerce(model.get("successors"), list[list[float]], "phase_model.successors"))
    if successors.shape != (len(phases), len(phases) + 1):
        raise InputError(
            "phase_model", f"knows {len(successors)} phases, but the file holds {len(phases)}",
            "its phases were edited by hand or mixed up; segment the demonstrations again",
        )  # fmt: skip
    rows = coerce(document.get("demonstrations", []), list[dict[str, Any]], "demonstrations")
    labels = [coerce(row.get("labels", []), list[int], f"demonstrations[{i}].labels") for i, row in enumerate(rows)]
    for i, each in enumerate(labels):
        if any(not 0 <= label < len(phases) for label in each):
            raise InputError(
                f"demonstrations[{i}].labels", f"names a phase beyond the {len(phases)} that the file holds",
                "segment the demonstrations again",
            )  # fmt: skip
    successors = to_the_common_end(successors, labels)
    recoveries = _get(document, "recoveries", int)
    if recoveries < 0:
        raise InputError("recoveries", "should not be negative", "0 takes the first failure")
    for i, phase in enumerate(phases):
        if is_placed(phase):
            placement_of(document, i)
    return PolicyDocument(
        skills=[skill_of(document, i) for i in range(len(phases))], model=followed, successors=successors,
        recoveries=recoveries,
    )  # fmt: skip


def to_the_common_end(successors: Float, labels: Sequence[Sequence[int]]) -> Float:
    """Successions without those after the common end.

    If more than half of the demonstrations ended in one phase, the task is done there; a teacher who lingers or leaves
    may add phases, which a run must not repeat. All ways before that are kept.

    Args:
        successors: (P, P + 1) counts, the last column the end.
        labels: phases of each demonstration in order.

    Returns:
        (P, P + 1) counts.
    """
    ends = [each[-1] for each in labels if each]
    common = next((k for k in ends if 2 * ends.count(k) > len(ends)), None)
    result = successors.copy()
    for each in labels:
        if common is not None and common in each and each[-1] != common:
            after = each[len(each) - list(reversed(each)).index(common)]
            result[common, after] = max(result[common, after] - 1.0, 0.0)
            result[common, -1] += 1.0
    return result


def check(document: Document) -> None:
    """Raise `InputError` if a policy's document or a skill of its phases is invalid."""
    for i, sub in enumerate(read(document).skills):
        kind = registry().skill(sub["type"])
        if kind.check is not None:
            try:
                kind.check(sub)
            except InputError as error:
                where = error.where.replace("phases[0]", f"phases[{i}]")
                raise InputError(where, error.problem, error.fix) from None


def skill_of(document: Document, index: int) -> Document:
    """Phase `index` as a skill document of its own."""
    phase = document["phases"][index]
    if is_placed(phase):
        return learned_of(document, index)
    kind = _get(phase, "skill", str, f"phases[{index}].")
    shared = {key: value for key, value in document.items() if key not in SHARED}
    own = {k: v for k, v in phase.items() if k not in ("skill", "beside")}
    return {**shared, **coerce(phase.get("beside", {}), dict[str, Any], f"phases[{index}].beside"), "type": kind,
            "phases": [own]}  # fmt: skip


def _get(values: Document, key: str, hint: Any, where: str = "") -> Any:
    if key not in values:
        raise InputError(f"{where}{key}", "is missing", "segment the demonstrations again")
    return coerce(values[key], hint, f"{where}{key}")
