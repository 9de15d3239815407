"""Outcome of the trials of a run, and in words: peak contact forces, joints near their limits, moved second parts.

| column | words | held to |
|---|---|---|
| `peak_force_n` | peak contact force in simulation: the largest of one control tick | twice the limit |
| `peak_force_10ms_n` | over 10 ms: the largest mean of the simulator's force over any 10 ms | the limit |
| `peak_force_filtered_n` | by the estimate: the largest that the controller's filtered estimate read | the limit |

"Peak" by itself is always the first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.execution.trace import SHARE_JOINTS, SHARES, Trace
from skillframe.frames import Float
from skillframe.skill import Reasons, no_reasons


def _none() -> Float:
    return np.zeros(0)


def _never() -> NDArray[np.bool_]:
    return np.zeros(0, dtype=bool)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Outcome of N trials. Every array has N rows. Shares are NaN where no limit is given.

    Attributes:
        success: the scene's goal was reached, no limit was broken, and the skill did not report failure.
        failure: why not; "" for a success.
        status: of the skill at its end (`Status`).
        reason: why the trial ended.
        duration_s: simulated seconds.
        peak_force_n: largest true contact force of one control tick.
        final_error_m, final_error_rad: distance to the goal at the end.
        energy_j: work of the controller on the tool.
        peak_force_filtered_n: largest filtered estimate of the contact force.
        peak_force_10ms_n: largest 10 ms mean of the true contact force, which the limit applies to.
        peak_torque_share: largest commanded torque of a joint over its effort.
        peak_speed_share: largest speed of a joint over its velocity limit.
        peak_range_share: largest distance of a joint from the middle of its range, over half the range.
        peak_torque_joint, peak_speed_joint, peak_range_joint: names of these joints; "" where unknown.
        ended_by: code of what ended the trial (`Ended`).
        goal_reached: the scene's goal held at the end.
        ended_itself: the skill ended the trial.
        distance_to_collision_m: smallest distance of bodies that must not touch.
        second: final displacements of second parts by name.
        traces: one per trial, if requested.
        interrupted: Ctrl-C ended the running trials.
    """

    success: NDArray[np.bool_]
    failure: Reasons
    status: NDArray[np.int64]
    reason: Reasons
    duration_s: Float
    peak_force_n: Float
    final_error_m: Float
    final_error_rad: Float
    energy_j: Float
    peak_force_filtered_n: Float = field(default_factory=_none)
    peak_force_10ms_n: Float = field(default_factory=_none)
    peak_torque_share: Float = field(default_factory=_none)
    peak_speed_share: Float = field(default_factory=_none)
    peak_range_share: Float = field(default_factory=_none)
    peak_torque_joint: Reasons = field(default_factory=lambda: no_reasons(0))
    peak_speed_joint: Reasons = field(default_factory=lambda: no_reasons(0))
    peak_range_joint: Reasons = field(default_factory=lambda: no_reasons(0))
    ended_by: Reasons = field(default_factory=lambda: no_reasons(0))
    goal_reached: NDArray[np.bool_] = field(default_factory=_never)
    ended_itself: NDArray[np.bool_] = field(default_factory=_never)
    distance_to_collision_m: Float = field(default_factory=_none)
    second: dict[str, Float] = field(default_factory=dict)
    traces: list[Trace] | None = None
    interrupted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmsResult(Result):
    """Outcome of N trials of several arms. `traces` are the first arm's.

    Attributes:
        arms: their names.
        joint_path_rad: (N, arms, joints) distance each joint moved.
        turned_rad: (N, arms, 3) rotation vector of each tool since the start, base axes.
        arm_traces: for each trial the traces by arm, if requested.
    """

    arms: tuple[str, ...]
    joint_path_rad: Float
    turned_rad: Float
    arm_traces: list[dict[str, Trace]] | None = None


SIMULATED = "in simulation"  #: how a report calls a run in simulation
PEAK = f"peak contact force {SIMULATED}"
"""Name of `peak_force_n`."""
MEAN = "contact force in simulation over 10 ms"
"""Name of `peak_force_10ms_n`."""
ESTIMATE = "contact force by the controller's estimate"
"""Name of `peak_force_filtered_n`."""
DEFINED = "A peak is the largest contact force of one control tick in simulation."
"""What "peak" means on a page."""
WORDS = {"peak_force_n": PEAK, "peak_force_10ms_n": "over 10 ms", "peak_force_filtered_n": "by the estimate"}
"""The three forces by column, in the order in which they are listed."""
RUN_WORDS = (
    "torque at most {} of its limit", "speed at most {} of its limit",
    "range at most {} from its middle to an end",
)  # fmt: skip
LENGTHS = ("travel", "moved")


def peak_forces(values: Mapping[str, object], figure: Callable[[float], str]) -> list[str]:
    """The three forces of a trial that are known, each a phrase with its unit. They belong together in this order.

    Args:
        values: by column.
        figure: writes a number.
    """
    given = {column: values.get(column) for column in WORDS}
    known = {name: float(x) for name, x in given.items() if isinstance(x, int | float) and math.isfinite(x)}
    where = force_source(values)
    return [f"{WORDS[column].replace(SIMULATED, where)} {figure(value)} N" for column, value in known.items()]


def force_source(values: Mapping[str, object]) -> str:
    """Where the unfiltered contact force of a run comes from: the simulator, or a real robot's sensor."""
    return "at the sensor" if values.get("source") == "real" else SIMULATED


def joint_shares(meta: Mapping[str, Any]) -> list[str]:
    """How near the joints came to their limits, each share with its joint, from the metadata of a trace."""
    parts = zip(RUN_WORDS, SHARES, SHARE_JOINTS, strict=True)
    found = [(text, meta.get(share), meta.get(joint)) for text, share, joint in parts]
    return [
        text.format(f"{share:.0%}") + (f" ({joint})" if joint else "")
        for text, share, joint in found
        if isinstance(share, int | float)
    ]


def second_parts(second: Mapping[str, float | None]) -> list[str]:
    """A phrase for each quantity of a trace's `second` [m or rad]: "gear.angle 3.1 degrees". Null is "unknown"."""
    return [f"{name} {_moved(name, value)}" for name, value in second.items()]


def _moved(name: str, value: float | None) -> str:
    if not isinstance(value, int | float):
        return "unknown"
    if name.rpartition(".")[2] in LENGTHS:
        return f"{1000.0 * value:.2f} mm"
    return f"{math.degrees(value):.1f} degrees"
