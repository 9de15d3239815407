"""What phases explain on the real wiping and peeling recordings, against labels by hand and against chance.

    SKILLFRAME_RECORDINGS=... python -m tests.figures.phases_explained

Wiping: three recordings together, read w-first. Peeling: one recording of one arm with 44 boundaries by hand; hits are
boundaries by hand with a cut within 0.5 s, chance is the mean of as many cuts put down evenly at random, 1000 times.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from skillframe_recordings.audit import audit

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.extend import Document, LearnOptions
from skillframe.extend.reading import read_demonstration
from skillframe.extend.registry import registry
from skillframe.frames import Float

NAMES = ("px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz")
W_FIRST = {"qw": "qx", "qx": "qy", "qy": "qz", "qz": "qw"}
NEAR_S, DRAWS = 0.5, 1000


def wipes(base: Path) -> list[Demonstration]:
    """The three wiping recordings."""
    columns = "t=t," + ",".join(f"{n}={W_FIRST.get(n, n.removeprefix('p'))}" for n in NAMES)
    return [
        read_demonstration(base / "icsc_wiping" / f"rim{i}.csv", columns=columns, wrench_frame="tool") for i in range(3)
    ]


def told(name: str, demonstrations: list[Demonstration]) -> Document:
    """Segment, and print the score."""
    document = learned(registry().skill("policy"), demonstrations, LearnOptions())
    found = document["explained"]
    touches, count = found["touches"], sum(len(row["boundaries"]) for row in document["demonstrations"])
    print(
        f"{name}: {len(document['phases'])} phases, {count} cuts; share {found['share']:.2f}, turned "
        f"{found['chance']:.2f}, p {found['p']:.3f}; contact changes {touches['changes']}, at cuts {touches['near']}, "
        f"by chance {touches['chance']:.1f}",
        flush=True,
    )
    return document


def hits(by_hand: Float, cuts: Float) -> int:
    """Boundaries by hand that have a cut within `NEAR_S`."""
    return int((np.abs(by_hand[:, None] - cuts).min(axis=1) <= NEAR_S).sum()) if len(cuts) else 0


def against_hand(name: str, by_hand: Float, cuts: Float, start: float, end: float) -> None:
    """Print hits beside those of as many cuts at random."""
    rng = np.random.default_rng(0)
    random = [hits(by_hand, rng.uniform(start, end, len(cuts))) for _ in range(DRAWS)]
    p = (1 + sum(r >= hits(by_hand, cuts) for r in random)) / (1 + DRAWS)
    print(
        f"    {name}: {hits(by_hand, cuts)} of {len(by_hand)} by hand within {NEAR_S} s of its {len(cuts)} cuts; at "
        f"random {np.mean(random):.1f}, p {p:.3f}",
        flush=True,
    )


def main() -> None:
    """Print what there is."""
    base = Path(os.environ["SKILLFRAME_RECORDINGS"])
    told("wiping", wipes(base))
    columns = ",".join(f"{n}=active_{n.removeprefix('p')}" for n in NAMES)
    peel = read_demonstration(base / "icsc_peeling" / "recording2.csv", columns=columns, rate=100.0)
    label = np.genfromtxt(base / "icsc_peeling" / "recording2.csv", delimiter=",", names=True)["label"]
    by_hand = peel.time[1:][np.diff(label) != 0.0]
    document = told("peeling, active arm, columns as labelled", [peel])
    row = document["demonstrations"][0]
    against_hand("phases", by_hand, np.array(row["boundaries"]), row["start"], row["end"])
    contact = np.array([t for each in audit(peel).contacts for t in each[:2]])
    against_hand("contact alone", by_hand, contact, row["start"], row["end"])


if __name__ == "__main__":
    main()
