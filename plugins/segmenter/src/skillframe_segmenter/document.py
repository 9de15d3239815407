"""A policy's part of the skill file: `phases`, each with the kind of its skill, and the `phase_model`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.config import coerce
from skillframe.errors import InputError
from skillframe.extend.records import Document
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe_segmenter.model import PhaseModel, from_document
from skillframe_segmenter.placed import is_placed, learned_of, placement_of

FOLLOWED = ("wrench_hmm", "pose_hmm")
SHARED = ("phases", "phase_model", "demonstrations", "type", "type_version", "recoveries", "explained")


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyDocument:
    """A policy, read and checked.

    Attributes:
        skills: a whole skill document for each phase.
        model: to follow the phases online; None where phases end by themselves only.
        successors: (P, P + 1) how often each phase was followed by each; the last column is the end.
        recoveries: failures of a phase that are recovered from.
    """

    skills: list[Document]
    model: PhaseModel | None
    successors: Float
    recoveries: int


def read(document: Document) -> PolicyDocument:
    """The policy of a document.

    Raises:
        InputError: phases and phase model do not match, or a key that is missing or holds the wrong thing.
        UnknownName: a phase's kind of skill is not installed.
    """
    phases = document.get("phases", [])
    if not phases:
        raise InputError("phases", "a policy needs at least one phase", "segment the demonstrations again")
    model = _get(document, "phase_model", dict[str, Any])
    followed = from_document(model) if _get(model, "type", str, "phase_model.") in FOLLOWED else None
    successors = np.array(coerce(model.get("successors"), list[list[float]], "phase_model.successors"))
    _match(len(phases), successors)
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


def check(document: Document) -> None:
    """Raise `InputError` if a policy's document is not as it should be, its phases' skills included."""
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


def _match(phases: int, successors: Float) -> None:
    if successors.shape != (phases, phases + 1):
        known = len(successors)
        raise InputError(
            "phase_model", f"knows {known} phases, but the file holds {phases}",
            "its phases were edited by hand or mixed up; segment the demonstrations again",
        )  # fmt: skip


def _get(values: Document, key: str, hint: Any, where: str = "") -> Any:
    if key not in values:
        raise InputError(f"{where}{key}", "is missing", "segment the demonstrations again")
    return coerce(values[key], hint, f"{where}{key}")
