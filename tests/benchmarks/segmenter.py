"""Speed of the segmenter: its fit, a whole `segment` call, and a policy's step online. CPU time, medians.

Run by `run.py`, or alone: `python -m tests.benchmarks.segmenter` from the project's root.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from tests.figures import quasistatic

REPEATS, TICKS, DT = 7, 2000, 1e-3
LONG = ((0.0, 0.0, -1.0), (0.8, 0.0, -0.6), (0.0, 0.8, -0.6))  # lowered, then slid twice over the table
WINDOWS = 2000
LEVEL = np.array([1.0, 1.0, 0.0])


def median_cpu(work: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Median CPU seconds of a call. One more goes before, for imports and caches."""
    work()
    taken = []
    for _ in range(repeats):
        before = time.process_time()
        work()
        taken.append(time.process_time() - before)
    return float(np.median(taken))


def long_demonstration(seed: int):
    """Three phases in 2000 windows of 50 ms."""
    hand = quasistatic.Hand(rng=np.random.default_rng([46, seed]))
    whole = WINDOWS * 0.05
    hand.move_free(np.array(LONG[0]), hand.speed * whole / 3.0)
    for push, seconds in ((LONG[1], whole / 3.0), (LONG[2], whole / 3.0 + 2.0)):
        while seconds > 0.0:  # `slide` takes 20 s at most
            hand.slide(np.array(push), [quasistatic.Z], np.sign(push) * LEVEL, hand.speed * min(seconds, 10.0))
            seconds -= 10.0
    return hand.finish().demonstration.between(0.0, whole + 0.01)


def fit_seconds() -> tuple[float, str]:
    """The fit of 3 demonstrations of 2000 windows, three phases given, and what was fitted."""
    from skillframe_segmenter import em, segmentation
    from skillframe_segmenter.settings import Settings

    settings = Settings()
    prepared = segmentation.prepare([long_demonstration(i) for i in range(3)], settings, "wrench_hmm")
    size = " + ".join(str(w.size) for w in prepared.cut)

    def work():
        data = em.gather(prepared.seen, prepared.drive, settings)
        return segmentation.fit(data, prepared, 3, settings)

    return median_cpu(work), size


def segment_seconds() -> tuple[float, float]:
    """`skillframe segment` on three files, in a process that has its imports. Returns their mean length [s]."""
    from skillframe.cli import main
    from skillframe.extend.reading import write_demonstration

    taught = [m.demonstration for m in quasistatic.demonstrations("valley", 7)]
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        files = [Path(folder) / f"d{i}.npz" for i in range(len(taught))]
        for demonstration, path in zip(taught, files, strict=True):
            write_demonstration(demonstration, path)
        words = ["segment", *map(str, files), "--out", str(Path(folder) / "p.json")]
        taken = median_cpu(lambda: main.run(words))
    return taken, float(np.mean([d.duration for d in taught]))


def step_seconds(count: int) -> float:
    """Filter and LMC of a running policy: CPU seconds per tick and trial, the ends of windows included."""
    from skillframe.document.file import learned
    from skillframe.extend import LearnOptions
    from skillframe.extend.registry import registry
    from skillframe.frames import Pose
    from skillframe.skill import Observation

    kind = registry().skill("policy")
    document = learned(kind, [m.demonstration for m in quasistatic.demonstrations("ls", 7)], LearnOptions())
    skill, rotation = kind.build(document), np.broadcast_to(quasistatic.DOWN, (count, 3, 3)).copy()
    twist, wrench = np.tile([0.0, 0.0, -0.02, 0.0, 0.0, 0.0], (count, 1)), np.full((count, 6), 0.05)

    def seen(tick: int) -> Observation:
        position = np.full((count, 3), 0.3)
        position[:, 2] -= 0.02 * tick * DT
        return Observation(np.full(count, tick * DT), DT, Pose(position, rotation), twist, wrench)

    skill.start(seen(0), [np.random.default_rng(i) for i in range(count)])
    ticks = [seen(i) for i in range(1, TICKS + 1)]
    taken = []
    for part in np.array_split(np.arange(TICKS), 5):
        before = time.process_time()
        for i in part.tolist():
            command = skill.step(ticks[i])
        taken.append((time.process_time() - before) / len(part) / count)
    assert not command.status.any(), "the policy has ended while it was timed"
    return float(np.median(taken))


def measure(show: Callable[..., None]) -> None:
    """Print the figures with `show` of `run.py`, each beside its bound."""
    from skillframe.errors import UnknownName
    from skillframe.extend.registry import registry

    try:
        registry().segmenter("wrench_hmm")
    except UnknownName:
        print("segmenter: the plug-in is not installed")
        return
    taken, size = fit_seconds()
    show(f"segmenter: fit of {size} windows, 6 dimensions, 3 phases", taken, "s", 0.15)
    taken, length = segment_seconds()
    show(f"skillframe segment, 3 demonstrations of {length:.1f} s, after import", taken, "s", 0.4)
    show("policy: filter and LMC, a tick at N = 1", 1e6 * step_seconds(1), "us", 60.0)
    show("policy: filter and LMC, a tick and trial at N = 256", 1e6 * step_seconds(256), "us", 3.0)


if __name__ == "__main__":

    def show(what: str, value: float, unit: str, bound: float) -> None:
        """One line."""
        print(f"{what:<70} {value:9.3g} {unit}   bound < {bound:g} {unit}: {'met' if value < bound else 'MISSED'}")

    measure(show)
