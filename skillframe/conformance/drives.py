"""What a drive must do: be made, hold a tool still in empty space, and keep trials apart to the last bit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.conformance.problems import attempt
from skillframe.conformance.trials import SHORT_S, Push
from skillframe.errors import SkillframeError
from skillframe.extend.records import DriveType, Lazy

HELD_M = 5e-3
"""How far a drive may let a tool come from where it stands still; ours: a panda on ideal torques keeps 0.1 mm."""


def check_drive(drive: DriveType) -> list[str]:
    """Problems of a drive. Empty if it conforms. It drives the panda in the world free for a tenth of a second."""
    return attempt("make", lambda: _make(drive)) or attempt("drives", lambda: _drives(drive))


def _make(drive: DriveType) -> Iterator[str]:
    made = drive.make.load() if isinstance(drive.make, Lazy) else drive.make
    if not callable(made):
        yield f"is {made!r:.60}, which cannot be called; give the function or class that makes the drive"


def _drives(drive: DriveType) -> Iterator[str]:
    """Trials that hold still end by time, near their start, and the same alone and beside another."""
    from skillframe.execution.executor import Result, Setup, simulate
    from skillframe.execution.prepare import load_robot_model, load_world

    setup = Setup(robot=load_robot_model("panda"), scene=load_world("free", {}), make_drive=drive.make)

    def hold(seeds: list[int]) -> Result:
        rngs = [np.random.default_rng(seed) for seed in seeds]
        return simulate(Push(0.0), setup, {}, rngs, duration_s=SHORT_S, trace_hz=1000.0)

    try:
        pair, alone = hold([13, 14]), hold([14])
    except SkillframeError as error:
        yield f"does not run: {error}"
        return
    for i, reason in enumerate(pair.reason):
        if pair.ended_by[i] != "time":
            yield f"holding a tool still in the world free for {1e3 * SHORT_S:g} ms ends: {reason}"
            return
    assert pair.traces is not None
    assert alone.traces is not None
    path = pair.traces[1].position
    moved = float(np.abs(path - path[0]).max())
    if not np.isfinite(path).all() or moved > HELD_M:
        yield f"a tool that is to stand still moves by {1e3 * moved:.3g} mm; {1e3 * HELD_M:g} mm are allowed"
    elif not np.array_equal(path, alone.traces[0].position):
        yield "a trial beside another ends in other numbers than alone; trials must not know of each other"
