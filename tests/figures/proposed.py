"""What `--layout auto` says of real recordings written anew: `python -m tests.figures.proposed`.

Each recording is written as a table without a header: with its quaternion w-last and w-first, with its attitude as
angles about moving axes in the six orders, with its wrench in tool axes, and with the other sign. *Right* is what
was written, *wrong* is another reading that is given as told by the data, *open* is said to be undecided.
Deterministic: no seeds.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from skillframe_recordings.proposal.reading import propose_reading

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, rotate_spatial
from tests.figures.recorded import recordings


def written(folder: Path, d: Demonstration, attitude: Float, wrench: Float) -> Path:
    """A table without a header."""
    np.savetxt(folder / "log.csv", np.column_stack([d.time - d.time[0], d.position, attitude, wrench]), "%.9g", ",")
    return folder / "log.csv"


def verdict(path: Path, what: str, right: str) -> str:
    """Whether the sentences of one subject name what was written."""
    found = propose_reading(path)
    if any(text.startswith(what) for text in found.undecided):
        return "open"
    said = [text for text in found.because if text.startswith(what)]
    return "right" if any(right in text.split(";")[0] for text in said) else "wrong" if said else "open"


def wrench_verdict(path: Path, frame: str, sign: str) -> str:
    """Whether axes and sign are proposed as they were written."""
    proposal = propose_reading(path)
    if any(text.startswith("axes and sign") for text in (*proposal.undecided, *proposal.missing)):
        return "open"
    found = proposal.settings
    said = found.get("wrench_frame"), found.get("wrench_sign")
    if said == (frame, sign):
        return "right"
    other = {"base": "tool", "tool": "base", "environment": "teacher", "teacher": "environment"}
    return "wrong" if other[frame] == said[0] or other[sign] == said[1] else "open"


def rows(d: Demonstration, folder: Path) -> dict[str, Counter[str]]:
    """Verdicts by what was written."""
    q, first, turn = d.quaternion, d.quaternion[:, [3, 0, 1, 2]], Rotation.from_quat(d.quaternion)
    in_tool = rotate_spatial(np.swapaxes(d.pose.rotation, -1, -2), d.wrench)
    angles = {"".join(o): turn.as_euler("".join(o)) for o in permutations("XYZ")}
    moving = {o: values[:, [o.index(a) for a in "XYZ"]] for o, values in angles.items()}
    return {
        "quaternion w-last": Counter([verdict(written(folder, d, q, d.wrench), "quaternion", "xyzw")]),
        "quaternion w-first": Counter([verdict(written(folder, d, first, d.wrench), "quaternion", "wxyz")]),
        "the same, wrench in tool axes": Counter([verdict(written(folder, d, first, in_tool), "quaternion", "wxyz")]),
        "six orders of angles": Counter(
            verdict(written(folder, d, values, d.wrench), "orientation", order) for order, values in moving.items()
        ),
        "wrench in base axes": Counter([wrench_verdict(written(folder, d, q, d.wrench), "base", "environment")]),
        "wrench in tool axes": Counter([wrench_verdict(written(folder, d, q, in_tool), "tool", "environment")]),
        "of the other sign": Counter([wrench_verdict(written(folder, d, q, -d.wrench), "base", "teacher")]),
    }  # fmt: skip


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as place:
        found = {name: rows(d, Path(place)) for name, d in recordings().items()}
    names = list(found)
    print("| written | " + " | ".join(names) + " |")
    for row in found[names[0]]:
        cells = [", ".join(f"{n} {k}" for k, n in sorted(found[name][row].items())) for name in names]
        print(f"| {row} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
