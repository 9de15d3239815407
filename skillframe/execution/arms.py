"""Several arms in the one loop: a coordinator sees (N, arms, ...) and answers with a command for every arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from skillframe.execution.drives.choose import require_arms
from skillframe.execution.executor import simulate
from skillframe.execution.first_arm import FirstArm
from skillframe.execution.result import ArmsResult
from skillframe.execution.setup import Setup
from skillframe.frames import Float
from skillframe.skill import Skill

__all__ = ["ArmsResult", "FirstArm", "simulate_arms"]


def simulate_arms(
    coordinator: Skill,
    setup: Setup,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    duration_s: float = 30.0,
    trace_hz: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> ArmsResult:
    """Run a coordinator on len(rngs) trials until each has ended. Arguments as of `executor.simulate`.

    With one centre of compliance (3,) instead of one per arm, `coordinator` is a skill for one arm, and the others hold
    still. `start.*` displaces the first arm's tool, `fixture.*` the fixture in the second arm's hand.

    Raises:
        SkillframeError: the robot has one arm, or the scene nothing for a second one to hold.
        UnknownName, UnreachablePose: as `simulate`.
    """
    require_arms(setup)
    result = simulate(coordinator, setup, draws, rngs, duration_s=duration_s, trace_hz=trace_hz, progress=progress)
    assert isinstance(result, ArmsResult)
    return result
