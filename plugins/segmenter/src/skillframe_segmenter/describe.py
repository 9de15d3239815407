"""A policy in words and as a picture: its tree, what each phase does, and where the demonstrations were cut."""

from __future__ import annotations

from skillframe.extend.records import Document, Illustration
from skillframe.extend.registry import registry
from skillframe_segmenter.document import PolicyDocument, read
from skillframe_segmenter.explained import words as explained_words
from skillframe_segmenter.pictures import cuts
from skillframe_segmenter.placed import is_placed, learned_of
from skillframe_segmenter.policy import successor_words

SIGNALS = {
    "places": "each in the frame of its place, and run where that is; one follows another when it is done",
    "wrench_hmm": "the contact wrench asks for the next phase, or a phase comes to rest",
    "pose_hmm": "the pose asks for the next phase, or a phase comes to rest",
}


def describe(document: Document) -> list[str]:
    """The policy in words, its tree first."""
    policy = read(document)
    kind = document["phase_model"].get("type", "?")
    count = len(policy.skills)
    lines = [
        f"policy of {count} phase{'s' * (count != 1)}; {SIGNALS.get(kind, 'a phase gives way when it comes to rest')}"
    ]
    turning = document["phase_model"].get("round")
    said = [
        _at_place(document, i) if is_placed(phase) else words
        for i, (phase, words) in enumerate(zip(document["phases"], _words(policy), strict=True))
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
    """The frame of a phase that belongs to a place."""
    phase = document["phases"][index]
    return f" in the frame of {phase['place']}" if is_placed(phase) else ""


def _words(policy: PolicyDocument) -> list[list[str]]:
    return [_of(sub) for sub in policy.skills]


def _of(document: Document) -> list[str]:
    kind = registry().skill(document["type"])
    return kind.describe(document) if kind.describe is not None else [kind.summary]


def _at_place(document: Document, index: int) -> list[str]:
    """What is done at a place: its motions in one line, then what each says beside."""
    place, words = document["phases"][index]["place"], [_of(sub) for sub in read(learned_of(document, index)).skills]
    lines = [" | ".join(each[0] for each in words)]
    return lines + [text.replace("base axes", f"axes of {place}") for each in words for text in each[1:]]


def explain(document: Document) -> list[Illustration]:
    """Where the demonstrations were cut, then the pictures of each phase."""
    pictures = [
        Illustration(
            "Phases", "Where each demonstration was cut; equal colours and numbers are one phase.",
            cuts(document.get("demonstrations", [])),
        )
    ]  # fmt: skip
    for i, sub in enumerate(read(document).skills):
        kind = registry().skill(sub["type"])
        for picture in kind.explain(sub) if kind.explain is not None else []:
            pictures.append(picture._replace(title=f"Phase {i + 1}: {picture.title}"))
    return pictures
