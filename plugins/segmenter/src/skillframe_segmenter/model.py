"""The phase model of a policy file, which follows the phases online."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.config import coerce
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import Float
from skillframe_segmenter.emission import DIMENSIONS, Phases
from skillframe_segmenter.features import Scales
from skillframe_segmenter.gate import Gate
from skillframe_segmenter.pose_gate import PoseGate
from skillframe_segmenter.settings import WINDOW_S

VERSION = 2
WHERE = "phase_model"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose0:
    """Reference of poses that drive transitions: mean position and orientation, and their spread."""

    position: Float
    rotation: Float
    spread: Float


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseModel:
    """K micro-phases that make up P phases.

    Attributes:
        at: (3,) observed point of the tool frame.
        axes: "base" or "phase_start".
        scales: of soft normalisation, for new demonstrations and runs.
        temper: eta.
        phase_of: (K,) phase of each micro-phase.
        phases: motion of each micro-phase.
        initial: (K,); weights: (K, K, R) of the transitions.
        gate: wrench or pose of each, which alone decides in execution.
        successors: (P, P + 1) counts of successions, the last column the end.
        switch_posterior, switch_windows: online, a phase takes over when it is this probable for so many windows.
        origin: reference of poses; None where the wrench drives the transitions.
    """

    at: Float
    axes: str
    scales: Scales
    temper: float
    phase_of: NDArray[np.intp]
    phases: Phases
    initial: Float
    weights: Float
    gate: Gate | PoseGate
    successors: Float
    switch_posterior: float
    switch_windows: int
    origin: Pose0 | None = None

    @property
    def count(self) -> int:
        """P."""
        return len(self.successors)

    @property
    def membership(self) -> Float:
        """(K, P) ones where a micro-phase belongs to a phase."""
        return np.eye(self.count)[self.phase_of]


def to_document(model: PhaseModel, kind: str) -> Document:
    """The model as JSON values."""
    document: Document = {
        "type": kind, "version": VERSION, "window_s": WINDOW_S, "at": model.at.tolist(), "axes": model.axes,
        "scales": model.scales._asdict(), "temper": model.temper, "phase_of": model.phase_of.tolist(),
        "direction": model.phases.direction.tolist(), "covariance": model.phases.covariance.tolist(),
        "initial": model.initial.tolist(), "transition_weights": model.weights.tolist(),
        "gate": {each.name: getattr(model.gate, each.name).tolist() for each in fields(model.gate)},
        "successors": model.successors.tolist(), "switch_posterior": model.switch_posterior,
        "switch_windows": model.switch_windows,
    }  # fmt: skip
    if model.origin is not None:
        document["origin"] = {name: getattr(model.origin, name).tolist() for name in ("position", "rotation", "spread")}
    return document


def from_document(document: Document) -> PhaseModel:
    """The model of a document.

    Raises:
        InputError: a key that is missing or has a wrong value, or sizes that do not agree.
    """
    if document.get("version") != VERSION or document.get("window_s") != WINDOW_S:
        raise InputError(f"{WHERE}.version", "is not one that this plug-in can follow online", "segment again")
    phase_of = np.array(_get(document, "phase_of", list[int]), dtype=np.intp)
    k, r = len(phase_of), 7 if "origin" in document else 9
    successors = np.array(_get(document, "successors", list[list[float]]), dtype=float)
    p = len(successors)
    _demand(k > 0 and set(phase_of.tolist()) == set(range(p)), "phase_of", f"should name the phases 0 to {p - 1}")
    _demand(successors.shape == (p, p + 1), "successors", f"should be {p} rows of {p + 1}")
    scales: dict[str, float] = _get(document, "scales", dict[str, float])
    _demand(set(scales) == set(Scales._fields) and min(scales.values()) > 0.0, "scales", "should hold four lengths > 0")
    values: dict[str, Any] = _get(document, "gate", dict[str, Any])
    chain = _array(values, "share", (k,)), _array(values, "transition", (k, k))
    gate: Gate | PoseGate
    if "origin" in document:
        gate, place = PoseGate(_array(values, "weights", (k, r)), *chain), _get(document, "origin", dict[str, Any])
        origin = Pose0(
            position=_array(place, "position", (3,)), rotation=_array(place, "rotation", (3, 3)),
            spread=_array(place, "spread", (2,)),
        )  # fmt: skip
    else:
        gate, origin = Gate(_array(values, "mean", (k, DIMENSIONS)), _covariance(values, k), *chain), None
    return PhaseModel(
        at=_array(document, "at", (3,)), axes=_get(document, "axes", str), scales=Scales(**scales),
        temper=_get(document, "temper", float), phase_of=phase_of,
        phases=Phases(_array(document, "direction", (k, DIMENSIONS)), _covariance(document, k)),
        initial=_array(document, "initial", (k,)), weights=_array(document, "transition_weights", (k, k, r)),
        gate=gate, successors=successors, switch_posterior=_get(document, "switch_posterior", float),
        switch_windows=_get(document, "switch_windows", int), origin=origin,
    )  # fmt: skip


def _get(document: Document, key: str, hint: Any) -> Any:
    if key not in document:
        raise InputError(WHERE, f"lacks the key {key!r}", "segment the demonstrations again")
    return coerce(document[key], hint, f"{WHERE}.{key}")


def _array(document: Document, key: str, shape: tuple[int, ...]) -> Float:
    try:
        values = np.array(document.get(key), dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    _demand(values.shape == shape, key, f"should be numbers of shape {shape}")
    return values


def _covariance(document: Document, count: int) -> Float:
    values = _array(document, "covariance", (count, DIMENSIONS, DIMENSIONS))
    definite = bool(np.isfinite(values).all()) and bool((np.linalg.eigvalsh(values) > 0.0).all())
    _demand(definite, "covariance", "should be positive definite")
    return values


def _demand(fine: bool, key: str, problem: str) -> None:
    if not fine:
        raise InputError(f"{WHERE}.{key}", problem, "segment the demonstrations again")
