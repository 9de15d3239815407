"""Skills made of skills: one after another, or one where another failed.

Each trial is in one part at a time; trials of a batch may be in different parts. When a part ends, the next one starts
at the next tick, from where the tool is. The controller designs the damping (from stiffness and task-space inertia)
whatever the parts command, so that a trial's damping does not depend on the parts of other trials. "When insertion
fails, search, then retry" is

  fallback(insert, sequence(search, insert)),

with `expects_travel_m` on insert: skills such as LMC end at rest, and coming to rest too early means failure.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Sequence as Several
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, norm, rotate, rotate_spatial
from skillframe.handover import ShapeCheck
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, restartable

Rows = NDArray[np.intp]
END = -1
"""Returned by `Composition.follows` if no part follows."""


class Part(NamedTuple):
    """One skill of a composition.

    Attributes:
        name: for messages.
        make: returns a new skill.
        expects_travel_m: a success nearer than this to the part's start counts as a failure; 0 accepts any.
    """

    name: str
    make: Callable[[], Skill]
    expects_travel_m: float = 0.0


class Composition(Skill):
    """N trials, each in one of several parts. Subclasses define the order.

    Args:
        parts: at least one.
    """

    def __init__(self, parts: Several[Part]) -> None:
        if not parts:
            raise InputError("composition", "has no parts", "name at least one skill")
        self.parts = list(parts)

    @abstractmethod
    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """What follows in a trial when a part has ended.

        Returns:
            The part that follows, or `END`; the status of the whole; and the reason in words.
        """

    def start(self, observation: Observation, rngs: Several[np.random.Generator]) -> None:
        """Start every trial in part 0."""
        n, k = len(rngs), len(self.parts)
        self._rngs = [rng.spawn(k) for rng in rngs]
        self._children: list[Skill | None] = [None] * k
        self._checks: dict[int, ShapeCheck] = {}
        self.current: Rows = np.full(n, END)
        self._due: Rows | None = np.zeros(n, dtype=np.intp)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)
        self._from = observation.pose.position.copy()
        self._journal: list[list[tuple[float, str]]] = [[] for _ in rngs]
        self._shared: int | None = None
        for i in range(n):
            self._note(i, float(observation.time[i]), f"{self.parts[0].name}: begins")

    def step(self, observation: Observation) -> Command:
        """Step every trial's part, and handle those that have ended."""
        if self._due is not None:
            self._enter(observation, self._due)
            self._due = None
        if self._shared is not None:
            command = self._answer(self._shared, observation)
            command = command._replace(impedance=Impedance(command.impedance.stiffness))
        else:
            answers = [(part, self._answer(part, observation)) for part in self._current_parts]
            command = _picked(self.current, answers)
        if np.count_nonzero(command.status):
            for i in np.flatnonzero((command.status != Status.RUNNING) & (self._status == Status.RUNNING)).tolist():
                status, reason = int(command.status[i]), str(command.reason[i])
                expected = self.parts[int(self.current[i])].expects_travel_m
                travel = float(norm(observation.pose.position[i] - self._from[i]))
                if status == Status.SUCCESS and travel < expected:
                    status = Status.FAILURE
                    reason = f"{reason}; expected {1e3 * expected:.0f} mm, went {1e3 * travel:.1f} mm"
                self.leave(i, float(observation.time[i]), status, reason)
            told = self._reason.copy()
            told[self._status == Status.RUNNING] = ""
            command = command._replace(status=self._status.copy(), reason=told)
        return command

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Several[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in part 0 in the given trials. Subclasses add what they keep of a trial."""
        for row, rng in zip(rows.tolist(), rngs, strict=True):
            self._rngs[row], self._journal[row] = rng.spawn(len(self.parts)), []
            self._status[row], self._reason[row] = Status.RUNNING, ""
            self.switch(row, 0, float(observation.time[row]), "begins")

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """Time [s] and text of each change of part."""
        return list(self._journal[trial])

    def switch(self, row: int, part: int, time: float, why: str) -> None:
        """Let a trial enter a part at the next tick."""
        if self._due is None:
            self._due = np.full(len(self.current), END)
        self._due[row] = part
        self._note(row, time, f"{self.parts[part].name}: {why}")

    def leave(self, row: int, time: float, status: int, reason: str) -> None:
        """Let a trial leave its part with a status. The next part follows, or the whole ends."""
        part = int(self.current[row])
        following, whole, why = self.follows(row, part, status, reason)
        if following != END:
            self.switch(row, following, time, why)
            return
        self._status[row], self._reason[row] = whole, f"{self.parts[part].name}: {why}"
        self._note(row, time, f"ended: {why}")

    def _note(self, row: int, time: float, text: str) -> None:
        self._journal[row].append((time, text))

    def _enter(self, observation: Observation, due: Rows) -> None:
        for part in np.unique(due[due != END]).tolist():
            rows = np.flatnonzero(due == part)
            self.current[rows] = part
            self._from[rows] = observation.pose.position[rows]
            child = self._children[part]
            if child is None:
                child = self._children[part] = restartable(self.parts[part].make)
                self._checks[part] = ShapeCheck(child, observation.time.shape)
                child.start(observation, [rngs[part] for rngs in self._rngs])
            else:
                child.restart(rows, observation, [self._rngs[i][part] for i in rows.tolist()])
        first = int(self.current[0])
        self._shared = first if bool((self.current == first).all()) else None
        self._current_parts: list[int] = np.unique(self.current).tolist()

    def _answer(self, part: int, observation: Observation) -> Command:
        child = self._children[part]
        assert child is not None
        return self._checks[part](child.step(observation))


class Sequence(Composition):
    """One part after another. The first failure ends the whole."""

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next part after a success."""
        if status == Status.SUCCESS and part + 1 < len(self.parts):
            return part + 1, Status.RUNNING, f"begins, as {self.parts[part].name} ended: {reason}"
        return END, status, reason


class Fallback(Composition):
    """Parts tried in order until one succeeds."""

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next part after a failure."""
        if status == Status.FAILURE and part + 1 < len(self.parts):
            return part + 1, Status.RUNNING, f"begins, as {self.parts[part].name} failed: {reason}"
        return END, status, reason


class Moved(Skill):
    """A skill that runs as if base stood at another pose.

    Args:
        make: returns a new skill.
        pose: in base, position (3,) and rotation (3, 3), of the frame that the skill takes for base.
    """

    def __init__(self, make: Callable[[], Skill], pose: Pose) -> None:
        self._child, self._pose = restartable(make), pose

    def start(self, observation: Observation, rngs: Several[np.random.Generator]) -> None:
        """Start the skill in its frame."""
        self._child.start(seen_from(self._pose, observation), rngs)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Several[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start the skill again in the given trials."""
        self._child.restart(rows, seen_from(self._pose, observation), rngs)

    def step(self, observation: Observation) -> Command:
        """The skill's command, in base."""
        return told_from(self._pose, self._child.step(seen_from(self._pose, observation)))

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """Events of the skill."""
        return self._child.journal(trial)


def seen_from(frame: Pose, observation: Observation) -> Observation:
    """The observation in the axes of a frame, one pose in base or one for each trial."""
    back = np.swapaxes(frame.rotation, -1, -2)
    pose = Pose(rotate(back, observation.pose.position - frame.position), back @ observation.pose.rotation)
    twist, wrench = (rotate_spatial(back, each) for each in (observation.twist, observation.wrench))
    return observation._replace(pose=pose, twist=twist, wrench=wrench)


def told_from(frame: Pose, command: Command) -> Command:
    """The command in base of a skill that sees a frame for base."""
    turn = frame.rotation
    both = np.zeros((*turn.shape[:-2], 6, 6))
    both[..., :3, :3] = both[..., 3:, 3:] = turn
    turned = [None if m is None else both @ m @ np.swapaxes(both, -1, -2) for m in command.impedance]
    # rounding leaves a turned matrix unsymmetric
    stiffness, damping = (None if m is None else 0.5 * (m + np.swapaxes(m, -1, -2)) for m in turned)
    assert stiffness is not None
    return command._replace(
        pose=frame.compose(command.pose), twist=rotate_spatial(turn, command.twist),
        impedance=Impedance(stiffness, damping), feedforward=rotate_spatial(turn, command.feedforward),
    )  # fmt: skip


def _picked(current: Rows, answers: Several[tuple[int, Command]]) -> Command:
    _, base = answers[0]
    n = len(current)
    pose = Pose(np.array(base.pose.position), np.array(base.pose.rotation))
    stiffness: Float = np.broadcast_to(base.impedance.stiffness, (n, 6, 6)).copy()
    twist, feedforward = np.array(base.twist), np.array(base.feedforward)
    status, reason = np.array(base.status), np.array(base.reason)
    for part, other in answers[1:]:
        rows = current == part
        pose.position[rows], pose.rotation[rows] = other.pose.position[rows], other.pose.rotation[rows]
        stiffness[rows] = np.broadcast_to(other.impedance.stiffness, (n, 6, 6))[rows]
        twist[rows], feedforward[rows] = other.twist[rows], other.feedforward[rows]
        status[rows], reason[rows] = other.status[rows], other.reason[rows]
    return Command(pose, twist, Impedance(stiffness), feedforward, status, reason)
