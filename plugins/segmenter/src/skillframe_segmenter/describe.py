"""Description of a policy in words and pictures: its tree, its phases, and the cuts of the demonstrations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from skillframe.extend import Document, Illustration, registry
from skillframe_segmenter.document import read
from skillframe_segmenter.drawing import svg
from skillframe_segmenter.explained import words as explained_words
from skillframe_segmenter.placed import is_placed, learned_of
from skillframe_segmenter.policy import successor_words

COLOURS = ("#2e6fba", "#c98a1b", "#3a9d6e", "#d1495b", "#7a52a8", "#4f8f9d", "#8a7a5b", "#b0457b")
SIGNALS = {
    "places": "each in the frame of its place, and run where that is; one follows another when it is done",
    "wrench_hmm": "the contact wrench indicates the next phase, or a phase comes to rest",
    "pose_hmm": "the pose indicates the next phase, or a phase comes to rest",
}


def describe(document: Document) -> list[str]:
    """The lines, the tree first."""
    policy = read(document)
    kind = document["phase_model"].get("type", "?")
    count = len(policy.skills)
    lines = [f"policy of {count} phase{'s' * (count != 1)}; {SIGNALS.get(kind, 'a phase ends when it comes to rest')}"]
    turning = document["phase_model"].get("round")
    said = [
        _at_place(document, i) if is_placed(phase) else words
        for i, (phase, words) in enumerate(zip(document["phases"], [_of(sub) for sub in policy.skills], strict=True))
    ]
    for i, words in enumerate(said):
        corner = "└─" if i + 1 == count else "├─"
        lines.append(
            f"{corner} phase {i + 1}{_where(document, i)}: {words[0]}; then {successor_words(policy.successors, i)}"
        )
    if turning is not None:
        lines.append(
            f"phase {turning + 1} is not an LMC: it goes round and round, and no linear motion comes back against its "
            f"own direction{'; run, it will not repeat what was shown' * (policy.skills[turning]['type'] == 'lmc')}"
        )
    again = f"retried at most {policy.recoveries} time{'s' * (policy.recoveries != 1)}"
    lines.append(f"a phase that fails (its force, time or travel limit) is {again if policy.recoveries else 'the end'}")
    lines += explained_words(document["explained"]) if "explained" in document else []
    for row in document.get("demonstrations", []):
        cuts = ", ".join(f"{t:.2f} s" for t in row["boundaries"]) or "nowhere"
        lines.append(
            f"{row['file'] or 'demonstration'}: cut at {cuts}; phases {' '.join(str(k + 1) for k in row['labels'])}"
        )
    for i, words in enumerate(said):
        lines += [f"phase {i + 1}: {line}" for line in words[1:]]
    return lines


def _where(document: Document, index: int) -> str:
    phase = document["phases"][index]
    return f" in the frame of {phase['place']}" if is_placed(phase) else ""


def _of(document: Document) -> list[str]:
    kind = registry().skill(document["type"])
    return kind.describe(document) if kind.describe is not None else [kind.summary]


def _at_place(document: Document, index: int) -> list[str]:
    place, words = document["phases"][index]["place"], [_of(sub) for sub in read(learned_of(document, index)).skills]
    lines = [" | ".join(each[0] for each in words)]
    return lines + [text.replace("base axes", f"axes of {place}") for each in words for text in each[1:]]


def explain(document: Document) -> list[Illustration]:
    """The cuts of the demonstrations, then the pictures of each phase."""
    pictures = [
        Illustration(
            "Phases", "Where each demonstration was cut; equal colours and numbers are one phase.",
            drawn_cuts(document.get("demonstrations", [])),
        )
    ]  # fmt: skip
    for i, sub in enumerate(read(document).skills):
        kind = registry().skill(sub["type"])
        for picture in kind.explain(sub) if kind.explain is not None else []:
            pictures.append(picture._replace(title=f"Phase {i + 1}: {picture.title}"))
    return pictures


def drawn_cuts(rows: Sequence[Mapping[str, Any]]) -> str:
    """Cuts of demonstrations, with `boundaries` [s] and `labels` as in the policy file, as an `<svg>` element."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, 0.9 + 0.34 * max(len(rows), 1)))  # inches; 0.34 a bar
    canvas = figure.add_subplot()
    for i, row in enumerate(rows):
        first, last = row.get("start", 0.0), row.get("end", max(row["boundaries"], default=1.0))
        for (start, stop), label in zip(pairwise([first, *row["boundaries"], last]), row["labels"], strict=True):
            canvas.barh(i, stop - start, left=start, height=0.72, color=COLOURS[label % len(COLOURS)])
            canvas.text(0.5 * (start + stop), i, f"{label + 1}", color="white", ha="center", va="center")
    canvas.set_yticks(range(len(rows)), [f"demonstration {i + 1}" for i in range(len(rows))])
    canvas.invert_yaxis()
    canvas.tick_params(axis="y", length=0)
    canvas.spines["left"].set_visible(False)
    canvas.set_xlabel("time [s]")
    return svg(figure)
