r"""Skill that seats a part: approach, push, search where the push stalls, push on.

    approach   to a place above the first contact                                            `reach`
    push       the learned skill with F below; at rest within `short` of the end: SUCCESS
    search     where it rests short of the end, about the nominal axis; then push again
    swing      where it rests short of the end in the hole; then push on about the axis found  `swing`
    centre     at rest near the end, aside of the nominal axis                               `centre`
    lost       more than `lost` beyond the end is beside the hole: lift, return, push again

F acts at the centre of compliance; u is the way, rho the turn from the nominal orientation:

    catch      - c max(0, v.u - v_max) u                          a part that comes loose does not fall in
    upright    - k rho                                            until a search, or rest in the hole
    free       - (1 - u u^T) K (x_d - x)                          in the hole, against jams by a slanting push
    rock       a rotating torque, see `rocking`                   at rest in the hole, short of the end
    settle     a rotating torque and a force to the axis, fading  at rest near the end

A swing shows where the fixture stands. From then on the seating sees and commands in a frame in which that is nominal,
with an error of `known_m` and `known_rad`, and a part that falls in is braked from `known_catch_m_s` on.

Where nothing stops the part, the push fades over the last `stop_m`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from skillframe.document import read_frame
from skillframe.extend import Document, registry
from skillframe.frames import Float, Pose, dot, norm, rotate, rotation_matrix, rotation_vector
from skillframe.sequence import END, Composition, Part, seen_from, told_from
from skillframe.skill import Command, Observation, Skill, Status, rows_of
from skillframe_search.centre import ACROSS, Centre
from skillframe_search.handling import HANDLING, Handling
from skillframe_search.reach import Reach
from skillframe_search.rocking import Rocking
from skillframe_search.seat_document import PUSH, SEARCH, Seat, part_of, read_seat
from skillframe_search.swing import Swing

APPROACH, PUSHING, SEARCHING, CENTRING, SWINGING = range(5)
RUNNING = int(Status.RUNNING)  # enumeration access is slow in the loop
REST_S, REST_RAD = 0.3, 0.005  # without progress near the end, and the largest turn
MOST_TURNING_S = 2.0  # that it may turn there
ROWS = (
    "_ends", "_tried", "_searched", "_urged", "_centred", "_stood", "_stands", "_best", "_since", "_rim",
    "_shift", "_tilt", "_known",
)  # fmt: skip


def build(document: Document, how: Handling = HANDLING) -> Seating:
    """The runnable seating of a checked document.

    Raises:
        InputError: the document's block `seat`, or a phase, is invalid.
    """
    push, search = (_maker(part_of(document, i)) for i in (PUSH, SEARCH))
    seat = read_seat(document)
    return Seating(seat, read_frame(document).center_of_compliance - np.array(seat.point), push, search, how)


def _maker(document: Document) -> Callable[[], Skill]:
    kind = registry().skill(document["type"])
    return lambda: kind.build(document)


class Seating(Composition):
    """N trials of seating one part.

    Args:
        seat: place of the part and its error.
        shift: (3,) from the seat's point to the centre of compliance, tool axes.
        push: makes the skill that pushes.
        search: makes the skill that searches.
        how: constants of F.
    """

    def __init__(
        self, seat: Seat, shift: Float, push: Callable[[], Skill], search: Callable[[], Skill],
        how: Handling = HANDLING,
    ) -> None:  # fmt: skip
        self._seat, self._how, self._way = seat, how, np.array(seat.way)
        self._upright = rotation_matrix(np.array(seat.orientation))
        self._end, self._start = (np.array(place) + self._upright @ shift for place in (seat.end, seat.start))
        parts = [Part("approach", self._reach), Part("push", push), Part("search", search)]
        swing = Part("swing", lambda: Swing(self._ends, self._way, self._upright))
        super().__init__([*parts, Part("centre", self._centre), swing])

    def _centre(self) -> Skill:
        return Centre(self._ends, self._way, self._how.centre_n, pressed=not self._seat.stop_m)

    def _reach(self) -> Skill:
        above = -self._seat.above_m * self._way
        # by which an approach may be longer than demonstrated
        farthest = 0.08 + float(norm(self._start - self._end - above))
        return Reach(self._ends + above, self._upright, self._way, self._how.approach_speed, farthest)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin with the approach, or with the push."""
        n = len(rngs)
        self._ends = np.tile(self._end, (n, 1))
        if self._seat.place == "start":
            self._ends += observation.pose.position - self._start
        self._tried = np.zeros(n, dtype=np.intp)
        self._searched, self._urged, self._centred = (np.zeros(n, dtype=bool) for _ in range(3))
        self._stood, self._stands = observation.pose.rotation.copy(), observation.time.copy()
        self._rocking = Rocking(self._how, self._seat, self._upright)
        self._rocking.start(n)
        self._best, self._since, self._rim = np.full(n, -np.inf), observation.time.copy(), np.zeros(n)
        self._frame: Pose | None = None
        self._known = np.zeros(n, dtype=bool)
        self._shift, self._tilt = np.full(n, self._seat.shift_m), np.full(n, self._seat.tilt_rad)
        super().start(observation, rngs)
        if not self._seat.approach:
            self._due = np.full(n, PUSHING)
            self._journal = [[(time, "push: begins")] for time in observation.time.tolist()]

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again where the fixture nominally is, in the given trials."""
        super().restart(rows, observation, rngs)
        fresh = copy(self)
        fresh.start(rows_of(observation, rows), rngs)
        for name in ROWS:
            getattr(self, name)[rows] = getattr(fresh, name)
        assert self._due is not None
        assert fresh._due is not None
        for row, due, journal in zip(rows.tolist(), fresh._due, fresh._journal, strict=True):
            self._due[row], self._journal[row] = due, journal
        self._rocking.restart(rows)
        if self._frame is not None:
            self._frame.position[rows], self._frame.rotation[rows] = 0.0, np.eye(3)

    def step(self, observation: Observation) -> Command:
        """Command of the active parts, with F added, as if each fixture stood where its swing found it."""
        if self._frame is None:
            return self._stepped(observation)
        frame = Pose(self._frame.position.copy(), self._frame.rotation.copy())
        return told_from(frame, self._stepped(seen_from(frame, observation)))

    def _stepped(self, observation: Observation) -> Command:
        self._deep = dot(observation.pose.position - self._ends, self._way)
        away = observation.pose.position - self._ends
        self._off = np.sqrt(np.maximum(dot(away, away) - self._deep * self._deep, 0.0))
        moved = self._deep > self._best + self._how.progress_m
        self._best, self._since = (
            np.where(moved, self._deep, self._best),
            np.where(moved, observation.time, self._since),
        )
        command = self._guided(observation, super().step(observation))
        self._look(observation, command.status == RUNNING)
        if np.count_nonzero(self._status):
            told = np.where(self._status == RUNNING, "", self._reason)
            command = command._replace(status=self._status.copy(), reason=told)
        return command._replace(feedforward=command.feedforward + self._added(observation))

    def switch(self, row: int, part: int, time: float, why: str) -> None:
        """Enter a part, and restart the watch of its progress. A return is to the nominal place, whatever was found."""
        super().switch(row, part, time, why)
        if part == APPROACH and self._known[row]:
            assert self._frame is not None
            self._frame.position[row], self._frame.rotation[row] = 0.0, np.eye(3)
            self._shift[row], self._tilt[row], self._known[row] = self._seat.shift_m, self._seat.tilt_rad, False
        self._best[row], self._since[row] = -np.inf, time

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next part: push after approach and search, search after a push short of the end."""
        if part == SWINGING:
            return PUSHING, Status.RUNNING, f"begins, {self._believe(row)}: {reason}"
        if part != PUSHING:
            if status != Status.SUCCESS:
                return END, status, reason
            self._searched[row] |= part == SEARCHING
            self._centred[row] = part == CENTRING  # a search, or a new approach, leaves it somewhere else
            return PUSHING, Status.RUNNING, f"begins, as the {self.parts[part].name} ended: {reason}"
        left = -1e3 * float(self._deep[row])
        entered = self._entered()[row]
        swings = self._searched[row] and self._guides()[row]
        if status == Status.SUCCESS and left > 1e3 * self._how.short_m and entered and not (self._urged[row] or swings):
            self._urged[row] = True
            return PUSHING, Status.RUNNING, f"goes on and rocks, {left:.1f} mm short of the end: {reason}"
        if (
            status == Status.SUCCESS
            and self._near()[row]
            and bool(self._centred[row] and self._off[row] > self._most_aside()[row])
            and self._tried[row] < self._seat.tries
        ):
            self._tried[row] += 1
            aside = 1e3 * float(self._off[row])
            return APPROACH, Status.RUNNING, f"lifts and returns, {aside:.1f} mm aside of the nominal axis: {reason}"
        if status == Status.SUCCESS and self._near()[row]:
            aside = 1e3 * float(self._off[row])
            if self._how.centre_n and not self._centred[row] and aside > 1e3 * self._how.aside_m:
                return CENTRING, Status.RUNNING, f"begins, {aside:.1f} mm aside of the nominal axis: {reason}"
            return END, status, f"seated, {abs(left):.1f} mm from the demonstrated end: {reason}"
        if status != Status.SUCCESS:
            return END, status, reason
        if self._tried[row] >= self._seat.tries:
            tried = f" after {self._tried[row]} searches and returns" if self._seat.tries else ""
            return END, Status.FAILURE, f"stalled {left:.1f} mm short of the demonstrated end{tried}: {reason}"
        self._tried[row] += 1
        if self._guides()[row]:
            self._urged[row] = True
            return SWINGING, Status.RUNNING, f"begins, {left:.1f} mm short of the end in the hole: {reason}"
        return SEARCHING, Status.RUNNING, f"begins, as the push stalled {left:.1f} mm short of the end: {reason}"

    def _believe(self, row: int) -> str:
        """Take the axis of a swing for the fixture's, and say so."""
        swing = self._children[SWINGING]
        assert isinstance(swing, Swing)
        entrances = self._ends - self._seat.contact_m * self._way
        found, entrance = swing.axes(entrances), entrances[row]
        turn, place = found.rotation[row], found.position[row]
        aside, lean = norm(rotate(turn, entrance) + place - entrance), norm(rotation_vector(turn))
        if lean > self._most_tilt()[row] or aside > self._most_aside()[row]:
            return f"as the axis, {1e3 * aside:.1f} mm aside, is farther off than the fixture may be"
        if self._frame is None:
            n = len(self._ends)
            self._frame = Pose(np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)))
        new = Pose(self._frame.position[row], self._frame.rotation[row]).compose(Pose(place, turn))
        self._frame.position[row], self._frame.rotation[row] = new
        self._known[row] = True
        self._shift[row] = min(self._how.known_m, self._shift[row])
        self._tilt[row] = min(self._how.known_rad, self._tilt[row])
        return f"with the axis {1e3 * aside:.1f} mm aside"

    def _most_tilt(self) -> Float:
        """(N,) largest tilt of a fixture with errors about two axes [rad]."""
        result: Float = sqrt(2.0) * self._tilt
        return result

    def _most_aside(self) -> Float:
        """(N,) its largest error in place, turned about a point as far away as the hole is deep, plus `aside_m` [m]."""
        result: Float = sqrt(2.0) * (self._shift + self._tilt * self._seat.contact_m) + self._how.aside_m
        return result

    def _guides(self) -> NDArray[np.bool_]:
        """(N,) whether the hole guides the part, which is short of its end."""
        result: NDArray[np.bool_] = (self._deep > self._how.swing_m - self._seat.contact_m) & (
            self._deep < -self._how.short_m
        )
        return result

    def _near(self) -> NDArray[np.bool_]:
        result: NDArray[np.bool_] = self._deep >= -(self._how.short_m + self._seat.height_m)
        return result

    def _look(self, observation: Observation, running: NDArray[np.bool_]) -> None:
        """End pushes that stalled or ended, and searches that sank. Return from past the end while tries are left."""
        time = observation.time
        here = running & (self._status == RUNNING)
        if self._due is not None:
            here &= self._due == END
        idle = time - self._since
        lost = here & (self.current != APPROACH) & (self._deep > self._how.lost_m + self._seat.height_m)
        still = here & ~lost & (self.current == PUSHING)
        tilt = self._most_tilt()
        spiral = self._rocking.patience(self._deep, self._urged, tilt)
        patience = np.where(self._in_hole(), spiral, self._how.stall_s)
        patience = np.where(self._in_hole() & self._guides() & ~self._known, self._how.swing_s, patience)
        still &= np.where(self._deep >= -self._how.short_m, self._settled(observation, idle), idle >= patience)
        for i in _rows(still):
            self.leave(i, float(time[i]), Status.SUCCESS, f"no progress for {idle[i]:.1f} s")
        sunk = self._deep - self._rim - self._how.sunk_m - np.tan(self._seat.tilt_rad) * self._off
        for i in _rows(here & ~lost & (self.current == SEARCHING) & (sunk > 0.0)):
            deeper = 1e3 * float(self._deep[i] - self._rim[i])
            self.leave(i, float(time[i]), Status.SUCCESS, f"sank {deeper:.1f} mm")
        for i in _rows(lost):
            past = f"went {1e3 * self._deep[i]:.1f} mm past the end, so it missed the hole"
            self._tried[i] += 1
            if self._tried[i] > self._seat.tries:
                self._status[i], self._reason[i] = Status.FAILURE, f"{self.parts[self.current[i]].name}: {past}"
            else:
                self.switch(i, APPROACH, float(time[i]), f"lifts and returns, as the tool {past}")

    def _settled(self, observation: Observation, idle: Float) -> NDArray[np.bool_]:
        """(N,) whether parts near the end have rested for `idle` [s] and stopped turning."""
        result: NDArray[np.bool_] = idle >= REST_S
        if self._seat.stop_m or not self._seat.settle_s:
            return result
        time, rotation = observation.time, observation.pose.rotation
        turned = norm(rotation_vector(rotation @ np.swapaxes(self._stood, -1, -2))) > REST_RAD
        self._stood = np.where(turned[:, None, None], rotation, self._stood)
        self._stands = np.where(turned, time, self._stands)
        since = idle - self._seat.settle_s
        result = (since >= REST_S) & ((time - self._stands >= REST_S) | (since >= MOST_TURNING_S))
        return result

    def _enter(self, observation: Observation, due: NDArray[np.intp]) -> None:
        """Begin a search about the nominal axis, and a push in an orientation within the fixture's error."""
        position, rotation = observation.pose.position.copy(), observation.pose.rotation.copy()
        rows = np.flatnonzero(due == SEARCHING)
        self._rim[rows] = self._deep[rows]
        position[rows] = self._ends[rows] + self._deep[rows, None] * self._way
        rotation[rows] = self._upright
        rows = np.flatnonzero(due == PUSHING)
        turn = rotation_vector(rotation[rows] @ self._upright.T)
        share = np.minimum(1.0, self._most_tilt()[rows] / np.maximum(norm(turn), 1e-9))
        rotation[rows] = rotation_matrix(share[:, None] * turn) @ self._upright
        super()._enter(observation._replace(pose=Pose(position, rotation)), due)

    def _in_hole(self) -> NDArray[np.bool_]:
        """Trials that have been searched for, or stalled below the first contact."""
        result: NDArray[np.bool_] = self._searched | self._urged
        return result

    def _guided(self, observation: Observation, command: Command) -> Command:
        """The command without push across the way in the hole, fading before an open end."""
        seat, pushing = self._seat, self.current == PUSHING
        inside = pushing & (self._in_hole() | self._entered())
        if not (seat.stop_m or np.count_nonzero(inside)):
            return command
        gone = 1.0 - np.clip(-self._deep / seat.stop_m, 0.0, 1.0) if seat.stop_m else np.zeros(len(pushing))
        gone = np.where(pushing, gone, 0.0)
        lead = command.pose.position - observation.pose.position
        force = (command.impedance.stiffness[..., :3, :3] * lead[:, None, :]).sum(axis=-1)
        twist, feedforward = command.twist.copy(), command.feedforward.copy()
        for wanted, given in ((twist, command.twist[:, :3]), (feedforward, force)):
            along = dot(given, self._way)
            across = given - along[:, None] * self._way
            left_out = (gone * np.maximum(along, 0.0))[:, None] * self._way + np.where(inside[:, None], across, 0.0)
            wanted[:, :3] -= left_out
        return command._replace(twist=twist, feedforward=feedforward)

    def _added(self, observation: Observation) -> Float:
        """(N, 6) F without `free`."""
        seat, how, pushing = self._seat, self._how, self.current == PUSHING
        added = np.zeros((len(pushing), 6))
        if not np.count_nonzero(pushing):
            return added
        catch = np.where(self._known, self._how.known_catch_m_s, how.catch_m_s)
        fast = np.maximum(dot(observation.twist[:, :3], self._way) - catch, 0.0)
        added[:, :3] = -how.catch_ns_m * fast[:, None] * self._way
        turn = rotation_vector(observation.pose.rotation @ self._upright.T)
        free = self._in_hole() | (self._near() & bool(seat.settle_s))
        added[:, 3:] = -np.where(free, 0.0, how.upright_nm_rad)[:, None] * turn
        idle = observation.time - self._since
        resting = self._in_hole() & (self._deep < -how.short_m)
        tilt = self._most_tilt()
        added[:, 3:] += self._rocking.torque(observation, idle, self._deep, resting, self._urged, tilt)
        if not seat.stop_m:
            share = np.where(self._deep < -how.short_m, 0.0, self._rocking.settling(idle))
            if np.count_nonzero(share):
                back = self._ends + self._deep[:, None] * self._way - observation.pose.position
                pull = share * np.minimum(ACROSS, how.settle_n / np.maximum(self._off, 1e-9))
                added[:, :3] += pull[:, None] * back
                added[:, 3:] += self._rocking.settle(observation.time, share)
        return np.where(pushing[:, None], added, 0.0)

    def _entered(self) -> NDArray[np.bool_]:
        # below the first contact is in the hole: rocked before a search
        result: NDArray[np.bool_] = self._deep > -self._seat.contact_m + 0.002
        return result


def _rows(chosen: NDArray[np.bool_]) -> list[int]:
    """Indices of true entries (N,), fast where there is none."""
    return np.flatnonzero(chosen).tolist() if np.count_nonzero(chosen) else []
