"""`Result`: what became of the trials of a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skillframe.execution.trace import Trace
from skillframe.frames import Float
from skillframe.skill import Reasons, no_reasons


def _none() -> Float:
    return np.zeros(0)


def _never() -> NDArray[np.bool_]:
    return np.zeros(0, dtype=bool)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of N trials. Every array has N rows.

    Attributes:
        success: the scene's goal was reached, no limit was broken, and the skill did not say that it failed.
        failure: why not, in words; "" for a success.
        status: of the skill at its end (`Status`).
        reason: why the trial ended, in words.
        duration_s: simulated seconds.
        peak_force_n: peak contact force, the largest true force of one control tick.
        final_error_m, final_error_rad: distance to the goal at the end.
        energy_j: work of the controller on the tool.
        peak_force_filtered_n: largest force that the controller's estimate read.
        peak_force_10ms_n: largest mean of the true contact force over 10 ms, which is held to the limit.
        peak_torque_share: largest torque that the law asked a joint for, over its effort; NaN where none is given.
        peak_speed_share: largest speed of a joint over its velocity limit; NaN where none is given.
        peak_range_share: largest distance of a joint from the middle of its range, over half the range: 0 in the
            middle, 1 at an end; NaN where none is given.
        peak_torque_joint, peak_speed_joint, peak_range_joint: names of the joints that these are of; "" where unknown.
        ended_by: code of what ended the trial (`Ended`).
        goal_reached: the scene's goal held when the trial ended, whatever ended it.
        ended_itself: the skill itself ended the trial, not the clock, a limit or a fault.
        distance_to_collision_m: smallest distance of bodies that may not touch, as `Collisions.distance` says.
        second: by name how far second parts of the fixture had moved when the trial ended, as `State.second`.
        traces: one per trial if asked for.
        interrupted: Ctrl-C came before the end; what was running is closed as it stood.
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
    """What became of N trials of several arms. `traces` of the base class are the first arm's.

    Attributes:
        arms: their names.
        joint_path_rad: (N, arms, joints) way each joint went.
        turned_rad: (N, arms, 3) rotation vector of each tool since the start, base axes.
        arm_traces: per trial a trace for every arm, by name, if asked for.
    """

    arms: tuple[str, ...]
    joint_path_rad: Float
    turned_rad: Float
    arm_traces: list[dict[str, Trace]] | None = None
