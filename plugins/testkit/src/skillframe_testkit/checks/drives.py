"""Checks of a drive: it can be made, holds a tool still in empty space, and keeps trials independent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.extend import DriveType, Lazy
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.trials import SHORT_S, Push


def check_drive(drive: DriveType) -> list[str]:
    """Problems of a drive, with its example robot in the world free."""
    return attempt("make", lambda: _make(drive)) or (attempt("drives", lambda: _drives(drive)) if drive.example else [])


def _make(drive: DriveType) -> Iterator[str]:
    made = drive.make.load() if isinstance(drive.make, Lazy) else drive.make
    if not callable(made):
        yield f"is {made!r:.60}, which cannot be called; give the function or class that makes the drive"


def _drives(drive: DriveType) -> Iterator[str]:
    from skillframe.execution import Result, Setup, load_robot_model, load_world, simulate

    setup = Setup(robot=load_robot_model(drive.example), scene=load_world("free", {}), drive=drive)

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
    if not np.isfinite(path).all() or moved > 5e-3:  # m; a panda with ideal torques moves 0.1 mm
        yield f"a tool that is to stand still moves by {1e3 * moved:.3g} mm; 5 mm are allowed"
    elif not np.array_equal(path, alone.traces[0].position):
        yield "a trial beside another ends in other numbers than alone; trials must not know of each other"
