"""Hits and false alarms of the audit on recordings damaged on purpose: `python -m tests.figures.damage [FIRST_SEED]`.

An edit of a stretch is *found* if a stall or fault of its kind covers it to 0.05 s at both ends, *partly* if one of
its kind touches it, *missed* else. Edits of the whole are found if the audit gives a warning of their kind that it
does not give of the sound recording, or reading refuses the file. A *false alarm* is a stall, a fault, a difference
of clocks, another order of the quaternion or a tared weight that a sound recording is said to have.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

import numpy as np
from skillframe_recordings.audit import DemonstrationAudit, audit

from skillframe.demonstration.record import Demonstration
from tests.figures import edits
from tests.figures.edits import Edit, Edited
from tests.figures.recorded import recordings

SEEDS, CLOSE = 20, 0.05
STRETCHES: dict[str, tuple[Edit, str]] = {
    "stall of the wrench": (edits.stall, "stall"),
    "stall of a channel": (edits.stall_of_a_channel, "stall"),
    "saturation": (edits.saturate, "saturation"),
    "pasted wrench": (edits.paste, "copy"),
    "pasted channel": (edits.paste_a_channel, "copy"),
    "pasted pose": (edits.paste_the_pose, "copy"),
    "held pose": (edits.hold, "stall"),
    "jump of the tool point": (edits.jump, "jump"),
    "step of the bias": (edits.step, "step"),
}
WHOLES: dict[str, tuple[Edit, tuple[str, ...]]] = {
    "pose at 8 to 15 Hz": (edits.slow_pose, ("pose: moves",)),
    "weight left in": (edits.weigh, ("weight:", "bias:", "wrench frame:")),
    "weight left in, tared": (edits.weigh_tared, ("weight:", "wrench frame:")),
    "quaternion w-first": (edits.quaternion_order, ("quaternion:", "orientation:")),
    "wrench in tool axes": (edits.frame, ("wrench frame:", "wrench sign:", "orientation:")),
    "wrong sign": (edits.sign, ("wrench sign:", "wrench frame:")),
}


def spans(found: DemonstrationAudit, kind: str) -> list[tuple[float, float]]:
    """Where the audit says that something of a kind is."""
    listed = found.stalls if kind == "stall" else [f for f in found.faults if f["kind"] == kind]
    return [(f["start"], f["stop"]) for f in listed]


def judged(edited: Edited, kind: str) -> str:
    """How a damaged stretch was found."""
    there = spans(audit(edited.demonstration), kind)
    if not there:
        return "missed"
    start, stop = (min(a for a, _ in there), max(b for _, b in there)) if kind == "saturation" else min(
        there, key=lambda s: abs(s[0] - edited.start) + abs(s[1] - edited.stop)
    )  # fmt: skip
    close = abs(start - edited.start) <= CLOSE and abs(stop - edited.stop) <= CLOSE
    touches = any(a <= edited.stop + CLOSE and edited.start - CLOSE <= b for a, b in there)
    return "found" if close else "partly" if touches else "missed"


def heads(found: DemonstrationAudit) -> set[str]:
    """The warnings' first words."""
    return {text[:14] for text in found.warnings}


def told(edited: Edited, sound: DemonstrationAudit, kinds: tuple[str, ...]) -> str:
    """Whether damage to the whole was told."""
    new = [t for t in audit(edited.demonstration).warnings if t.startswith(kinds) and t[:14] not in heads(sound)]
    return "found" if new else "missed"


def clocks(edited: Edited) -> str:
    """Whether a difference of clocks was told, to 0.03 s."""
    found = audit(edited.demonstration)
    said = [t for t in found.warnings if t.startswith("clocks:")]
    if not said or found.wrench_late_s is None:
        return "missed"
    return "found" if abs(found.wrench_late_s - edited.start) <= 0.03 else "wrong"


def rows(name: str, d: Demonstration, first: int) -> dict[str, Counter[str]]:
    """Counts by edit."""
    sound, counts = audit(d), {}
    for edit, (make, kind) in STRETCHES.items():
        counts[edit] = Counter(judged(make(d, rng), kind) for rng in drawn(first, name, edit))
    counts["late wrench"] = Counter(clocks(edits.late(d, rng)) for rng in drawn(first, name, "late"))
    for edit, (make, kinds) in WHOLES.items():
        counts[edit] = Counter(told(make(d, rng), sound, kinds) for rng in drawn(first, name, edit))
    return counts


def drawn(first: int, *names: str) -> list[np.random.Generator]:
    """A generator for each seed."""
    return [np.random.default_rng([seed, *map(ord, "".join(names))]) for seed in range(first, first + SEEDS)]


def alarms(d: Demonstration) -> list[str]:
    """What a sound recording is said to have."""
    found = audit(d)
    late = [t for t in found.warnings if t.startswith(("clocks:", "quaternion:", "weight:"))]
    return [*(f"stall {s}" for s in found.stalls), *(f"{f['kind']} {f}" for f in found.faults), *late]


def main(first: int) -> None:
    """Print the table."""
    found = {name: rows(name, replace(d, meta={}), first) for name, d in recordings().items()}
    names = list(found)
    print("| edit | " + " | ".join(names) + " |")
    for edit in found[names[0]]:
        cells = []
        for name in names:
            c = found[name][edit]
            more = "".join(f", {c[k]} {k}" for k in ("partly", "wrong") if c[k])
            cells.append(f"{c['found']}{more}")
        print(f"| {edit} | " + " | ".join(cells) + " |", flush=True)
    for name, d in recordings().items():
        print(name, "false alarms:", alarms(d) or "none")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
