"""Presses learned from one and from three demonstrations: `python -m tests.figures.pressed [FIRST_SEED]`.

24 cm down, then 40 N for 4 s, recorded-like (`plugins/lmc/tests/test_press.py` says how): the aim wanders by 7 degrees
over 0.5 s, the standing force is 5 degrees off about each axis, and the sensor reads 2 N per axis in the air.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from skillframe.extend import LearnOptions

sys.path.insert(0, str(Path(__file__).parents[2] / "plugins/lmc/tests"))

SEEDS, CLOSE = 20, 5.0


def main(first: int) -> None:
    """Print how many of 20 are within 5 degrees of straight down."""
    from skillframe_lmc.learner import learn
    from test_press import off, press, translation

    for count in (1, 3):
        groups = [[press(first + count * k + i) for i in range(count)] for k in range(SEEDS)]
        parts = [translation(learn(group, LearnOptions())) for group in groups]
        angles = np.array([off(p, (0, 0, -1)) if p["desired_direction"] is not None else 180.0 for p in parts])
        print(f"{count} demonstrations: {(angles <= CLOSE).sum()} of {SEEDS}, "
              f"median {np.median(angles):.1f}, at most {angles.max():.1f} degrees")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
