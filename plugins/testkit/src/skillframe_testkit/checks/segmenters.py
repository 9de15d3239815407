"""Checks of a segmenter: ordered boundaries inside each demonstration, and a label for each interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

from skillframe.demonstration import Demonstration
from skillframe.extend import Document, SegmenterType
from skillframe_testkit.checks.examples import example_demonstrations
from skillframe_testkit.checks.problems import attempt, json_problems


def check_segmenter(
    segmenter: SegmenterType, demonstrations: Sequence[Demonstration] | None = None, phases: int = 2
) -> list[str]:
    """Problems of a segmenter, with given or example demonstrations."""
    demos = example_demonstrations() if demonstrations is None else list(demonstrations)

    def on(count: int | None) -> Callable[[], Iterator[str]]:
        return lambda: _fit_problems(segmenter, demos, count)

    return attempt("number of phases found", on(None)) + attempt(f"{phases} phases required", on(phases))


def _fit_problems(segmenter: SegmenterType, demos: Sequence[Demonstration], count: int | None) -> Iterator[str]:
    document = segmenter.fit(demos, count, {})
    yield from json_problems(document)
    if segmenter.fit(demos, count, {}) != document:
        yield "fitting the same demonstrations twice gives different results"
    yield from segmentation_problems(document, demos, count)


def segmentation_problems(document: Document, demos: Sequence[Demonstration], count: int | None) -> Iterator[str]:
    """Problems of a document's segmentation of these demonstrations."""
    rows: list[dict[str, Any]] = document.get("demonstrations", [])
    if "phase_model" not in document:
        yield "there is no 'phase_model'"
    if len(rows) != len(demos):
        yield f"'demonstrations' has {len(rows)} entries for {len(demos)} demonstrations"
        return
    for i, (row, demo) in enumerate(zip(rows, demos, strict=True)):
        cuts, labels = row["boundaries"], row["labels"]
        inside = all(demo.time[0] < cut < demo.time[-1] for cut in cuts)
        if not inside or any(b <= a for a, b in pairwise(cuts)):
            yield f"demonstration {i}: boundaries {cuts} are not inner times in increasing order"
        if len(labels) != len(cuts) + 1:
            yield f"demonstration {i}: {len(labels)} labels for {len(cuts) + 1} intervals"
        if count is not None and not set(labels) <= set(range(count)):
            yield f"demonstration {i}: labels {labels} are not below {count}"
