"""Recordings of drives that have more to show than a robot: their own columns beside the trace's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from skillframe.execution.drive import Trials
from skillframe.execution.recorder import Recorder
from skillframe.execution.trace import Trace
from skillframe.frames import Float
from skillframe.skill import Command, Observation


class WithColumns:
    """A recorder whose samples hold a drive's columns too. Both are asked for only where a sample is due.

    Args:
        recorder: made with the columns' names and shapes.
        columns: gives the columns now, each (N, ...).
        seen: turns an observation into what is recorded of it.
    """

    def __init__(
        self, recorder: Recorder, columns: Callable[[], Mapping[str, Float]],
        seen: Callable[[Observation], Observation] = lambda observation: observation,
    ) -> None:  # fmt: skip
        self._recorder, self._columns, self._seen = recorder, columns, seen

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        """As `Recorder.record`."""
        due = self._recorder.due(tick)
        seen, columns = (self._seen(observation), self._columns()) if due else (observation, None)
        self._recorder.record(tick, time, seen, command, law, columns)

    def close(self, rows: Trials) -> None:
        """As `Recorder.close`."""
        self._recorder.close(rows)

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """As `Recorder.trace`."""
        return self._recorder.trace(i, meta)
