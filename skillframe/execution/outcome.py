"""Outcome of each trial of a batch, as a `Result` and in its trace's metadata.

A trial succeeds if the scene's goal holds at its end, no limit was broken, and its skill did not report failure. The
goal is the scene's before the skill started. A goal that holds although its own error has grown much is no success.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.control.contact import TrueContact, over
from skillframe.execution.drive import Drive, Setup, TrialRecorder
from skillframe.execution.result import Result
from skillframe.execution.trace import SHARE_JOINTS, SHARES
from skillframe.frames import Float
from skillframe.skill import Ended, Status, no_reasons
from skillframe.world.collisions import Collisions

MUCH = (0.01, np.deg2rad(10.0))
"""Allowed growth of an error until a goal is reached [m, rad].

A goal has a width, and some ignore a direction in their error. All shipped goals are narrower.
"""
Journal = Callable[[int], list[tuple[float, str]]]


class Outcomes:
    """Outcome figures of N trials, each taken as its trial ends.

    Attributes:
        status: (N,) of the skill (`Status`), set before a trial is closed.
        touched: names of both bodies, for trials that ended by collision.
    """

    def __init__(self, setup: Setup, drive: Drive, contact: TrueContact, count: int) -> None:
        self.setup, self.drive, self.contact, self.count = setup, drive, contact, count
        self._goal, self._goal_error, self._way = setup.scene.goal, setup.scene.goal_error, setup.scene.way
        self._before = np.stack(self._goal_error(drive.plant.tip_state()), axis=-1)
        self.touched: dict[int, tuple[str, str]] = {}
        self.reason, self.status = no_reasons(count), np.zeros(count, dtype=np.int64)
        self.limited = np.zeros(count, dtype=bool)
        self.duration, self.ended_by = np.zeros(count), no_reasons(count)
        self.filtered, self.way = np.full(count, np.nan), np.full(count, np.nan)
        self.shares = np.full((3, count), np.nan)
        self.joints = np.full((3, count), "", dtype=object)  # of torque, speed and range, as the shares
        self.second: dict[str, Float] = {}
        self.goal, self.errors, self.energy = np.zeros(count, dtype=bool), np.zeros((count, 2)), np.zeros(count)

    def close(self, rows: NDArray[np.int64], time: float, reason: str, code: Ended, limit: bool) -> None:
        """Evaluate ending trials `rows` at `time` [s]. `limit` marks a broken limit or a fault."""
        state = self.drive.plant.tip_state()
        self.goal[rows] = self._goal(state)[rows]
        self.errors[rows] = np.stack(self._goal_error(state), axis=-1)[rows]
        for name, value in state.second.items():
            self.second.setdefault(name, np.full(self.count, np.nan))[rows] = value[rows]
        if self._way is not None:
            self.way[rows] = self._way.reached(state)[rows]
        self.duration[rows], self.limited[rows] = time, limit
        shares = self.drive.shares()
        self.energy[rows] = shares.energy[rows]
        for kind, part in enumerate((shares.torque, shares.speed, shares.range)):
            if part is not None:
                self.shares[kind, rows] = part[rows]
        if shares.joints is not None:
            self.joints[:, rows] = shares.joints[:, rows]
        self.filtered[rows] = self.contact.estimate[rows]
        if limit:
            self.status[rows] = Status.FAILURE
        for i in rows:
            self.reason[i], self.ended_by[i] = reason, code.value

    def result(
        self, recorder: TrialRecorder | None, journal: Journal, collisions: Collisions, interrupted: bool
    ) -> Result:
        """The outcome of every trial, with `journal` for a trial's log and `interrupted` for Ctrl-C."""
        success = self.goal & ~self.limited & (self.status != Status.FAILURE) & ~self._contradicted()
        failure = no_reasons(self.count)
        for i in np.flatnonzero(~success):
            failure[i] = self._failure(int(i))
        traces = None
        if recorder is not None:
            told = partial(self._meta, journal=journal, collisions=collisions)
            metas = (told(i, bool(success[i]), str(failure[i])) for i in range(self.count))
            traces = [recorder.trace(i, meta) for i, meta in enumerate(metas)]
        return Result(
            success=success, failure=failure, status=self.status, reason=self.reason, duration_s=self.duration,
            peak_force_n=self.contact.peak, final_error_m=self.errors[:, 0], final_error_rad=self.errors[:, 1],
            energy_j=self.energy, peak_force_filtered_n=self.filtered, peak_force_10ms_n=self.contact.mean,
            ended_by=self.ended_by, **dict(zip(SHARES, self.shares, strict=True)),
            **dict(zip(SHARE_JOINTS, self.joints, strict=True)),
            goal_reached=self.goal, ended_itself=self.ended_by == Ended.SKILL.value,
            distance_to_collision_m=collisions.distance,
            second=self.second, traces=traces, interrupted=interrupted,
        )  # fmt: skip

    def _contradicted(self) -> NDArray[np.bool_]:
        """Whether the goal holds (N,) although neither error has shrunk since the start and one has grown much."""
        grown = self.errors - self._before
        result: NDArray[np.bool_] = self.goal & np.all(grown >= 0.0, axis=1) & np.any(grown > MUCH, axis=1)
        return result

    def _failure(self, i: int) -> str:
        if self.limited[i]:
            return str(self.reason[i])
        if self._contradicted()[i]:
            now, before = (
                f"{1e3 * error[0]:.3g} mm and {error[1]:.3g} rad" for error in (self.errors[i], self._before[i])
            )
            return f"contradiction: the goal criterion holds {now} from the goal, and the start was {before} from it"
        lacks = "the skill gave up, though the goal is reached" if self.goal[i] else "goal not reached"
        return f"{lacks}: {self.reason[i]}"

    def _meta(self, i: int, success: bool, failure: str, *, journal: Journal, collisions: Collisions) -> dict[str, Any]:
        scene, actuators = self.setup.scene, list(self.drive.actuators)
        peak = float(self.contact.peak[i])
        mark = over(peak, self.setup.robot.spec.limits.force_n) if success else ""
        return {
            "robot": self.setup.robot.spec.name, "world": scene.name, "params": scene.params,
            "interface": self.setup.robot.spec.control.figures(),
            "center_of_compliance": np.asarray(self.setup.center_of_compliance, dtype=float).tolist(),
            "frames": {k: list(v) for k, v in scene.tool.frames.items()},
            "hand": scene.tool.hand, "success": success, "failure": failure, "reason": str(self.reason[i]),
            "status": Status(int(self.status[i])).name, "duration_s": float(self.duration[i]),
            "peak_force_n": peak, "peak_force_filtered_n": float(self.filtered[i]),
            "peak_force_10ms_n": float(self.contact.mean[i]), "ended_by": self.ended_by[i],
            **{name: _known(share) for name, share in zip(SHARES, self.shares[:, i], strict=True)},
            **dict(zip(SHARE_JOINTS, self.joints[:, i], strict=True)),
            "goal_reached": bool(self.goal[i]), "ended_itself": self.ended_by[i] == Ended.SKILL,
            "distance_to_collision_m": _known(float(collisions.distance[i])),
            "notes": [*(text for text in (mark, collisions.note) if text), *self.drive.notes(i)],
            "final_error_m": float(self.errors[i, 0]),
            "final_error_rad": float(self.errors[i, 1]), "analytic": scene.analytic,
            "progress": None if scene.way is None else scene.way.told(_known(self.way[i])),
            "events": [[time, text] for time, text in journal(i)],
            **({"second": {key: _known(value[i]) for key, value in self.second.items()}} if self.second else {}),
            "limits": asdict(self.setup.limits), **({"touched": [*self.touched[i]]} if i in self.touched else {}),
            **({"actuators": actuators} if actuators else {}),
        }  # fmt: skip


def _known(figure: float) -> float | None:
    return None if np.isnan(figure) else float(figure)
