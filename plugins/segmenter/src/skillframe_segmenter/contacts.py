"""Cuts where contact begins and ends, for tasks whose phases the model cannot separate.

Strokes or pecks may have no other recurring phases. The audit finds touches to 10 ms; free intervals are one phase,
intervals in contact the other. They are used where contact changes more than four times a recording, the model's phases
are no better than chance (`explained`), and these are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skillframe.demonstration import Demonstration, contact_evidence
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe_segmenter.agreement import check_agreement
from skillframe_segmenter.explained import CERTAIN, MANY, explained
from skillframe_segmenter.segmentation import refitted
from skillframe_segmenter.settings import PHASE_MIN_S

Fit = Callable[[Sequence[Demonstration], int | None, Mapping[str, Any]], Document]


def at_contact(
    found: Document, demonstrations: Sequence[Demonstration], fit: Fit, cutting: Mapping[str, Any]
) -> Document:
    """The segmentation, or one cut at contact where the model explains nothing and contact does.

    Args:
        found: by the model.
        demonstrations: the same.
        fit: of the segmenter.
        cutting: its settings, with `at` and `axes`.
    """
    at, axes = cutting["at"], cutting["axes"]
    told = explained(found["demonstrations"], demonstrations, at, axes)
    if told["p"] <= CERTAIN or told["touches"]["changes"] <= MANY * len(demonstrations):
        return found
    rows = [_row(row, d) for row, d in zip(found["demonstrations"], demonstrations, strict=True)]
    if explained(rows, demonstrations, at, axes)["p"] > CERTAIN:
        return found
    try:
        check_agreement(rows, demonstrations)
        two = fit(demonstrations, 2, cutting)
        if len(two["phase_model"]["phase_of"]) != 2:
            return found
        apart = {**two, "phase_model": {**two["phase_model"], "phase_of": [0, 1]}}
        return refitted(apart, demonstrations, rows, set(range(len(rows))), 2, cutting)
    except InputError:  # too short for a window, or another order: contact is no better
        return found


def _row(row: Document, demonstration: Demonstration) -> Document:
    """A demonstration cut where contact changes, without phases that are too short."""
    start, end = float(row["start"]), float(row["end"])
    spans: list[tuple[float, float]] = []
    for begin, stop, _ in contact_evidence(demonstration).contacts:
        if spans and begin - spans[-1][1] < PHASE_MIN_S:
            begin = spans.pop()[0]
        spans.append((begin, stop))
    spans = [span for span in spans if span[1] - span[0] >= PHASE_MIN_S]
    cuts = [t for span in spans for t in span if start + PHASE_MIN_S <= t <= end - PHASE_MIN_S]
    first = int(bool(spans) and spans[0][0] < start + PHASE_MIN_S)
    return {**row, "boundaries": cuts, "labels": [(k + first) % 2 for k in range(len(cuts) + 1)]}
