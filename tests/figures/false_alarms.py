"""Warnings and refusals of sound recordings: `python -m tests.figures.false_alarms FIRST_SEED`.

Forty sound slides (`tests.sound_slides`), read, audited, conditioned and learned as a person would. Of each warning it
is counted how many slides got it although it is not true of them, and of how many it is true. With
`SKILLFRAME_RECORDINGS` the warnings of every real recording follow, which a person has to judge.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

from skillframe_recordings.audit import audit
from skillframe_recordings.conditioning.offline import remove_bias

from skillframe.api.learning import learn_with
from skillframe.demonstration.contact import Contact
from skillframe.demonstration.phases import several_phases
from skillframe.errors import SkillframeError, SkillframeWarning
from skillframe.extend import LearnOptions
from skillframe.extend.reading import read_demonstration
from tests.figures.recorded import every_recording
from tests.sound_slides import Slide, slide

SLIDES = 40
TRUE_WHERE_TARED = ("weight", "drift", "wrench frame", "wrench sign", "bias", "contact")
"""Warnings that are true, or may be, where the tool's weight is in the wrench and was set to zero at the start."""
KINDS = (
    "gaps", "jitter", "rate", "quaternion", "position", "pose", "wrench", "force", "torque", "spikes", "wrench frame",
    "wrench sign", "weight", "stall", "step", "copy", "saturation", "jump", "bias", "drift", "contact", "vibration",
    "clocks", "motion", "several phases", "refused",
)  # fmt: skip


def said(each: Slide, folder: Path) -> list[str]:
    """Every warning and refusal of one slide on its way from file to skill."""
    path = folder / "slide.csv"
    each.write(str(path))
    try:
        d = read_demonstration(path, wrench_frame=each.frame)
        found = audit(d)
        texts = list(found.warnings)
        if several_phases(d, [Contact(*c) for c in found.contacts]):
            texts.append("several phases: segment is advised")
        remove_bias(d)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkillframeWarning)
            learn_with([d], "lmc", LearnOptions())
    except SkillframeError as error:
        return [f"refused: {error}"]
    return texts


def kind_of(text: str) -> str:
    """The kind of a warning: what stands before its first colon."""
    name = text.split(":")[0]
    return name if name in KINDS else "wrench" if name.split()[0] in ("fx", "fy", "fz", "tx", "ty", "tz") else name


def counted(first: int, verbose: bool = False) -> tuple[Counter[str], Counter[str]]:
    """How many of 40 slides got each kind of warning falsely, and rightly."""
    false, true = Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + SLIDES):
            each = slide(seed)
            texts = said(each, Path(folder))
            for kind in sorted({kind_of(text) for text in texts}):
                right = bool(each.weight) and kind in TRUE_WHERE_TARED
                (true if right else false)[kind] += 1
            if verbose:
                for text in texts:
                    print(seed, each.kind, "|", text.replace(folder, ""), flush=True)
    return false, true


def main() -> None:
    """Print both tables."""
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    false, true = counted(first, verbose="-v" in sys.argv)
    print(f"| warning | false, of {SLIDES} | true |\n|---|---|---|")
    for kind in sorted({*KINDS, *false, *true}, key=lambda k: (-false[k], k)):
        print(f"| {kind} | {false[kind]} | {true[kind]} |")
    for name, d in every_recording().items():
        found = audit(d)
        for text in found.warnings or ["none"]:
            print(f"| {name} | {text} |", flush=True)


if __name__ == "__main__":
    main()
