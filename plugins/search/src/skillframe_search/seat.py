r"""Seating a part: approach, push, search where the push stalls, push on.

Primitives and a search as their exception strategy are the papers' structure. How they are joined here is ours.

    approach   to a place above the first contact, then                                              `reach`
    push       the learned skill, with what is added to it below; at rest and within `short` of the end: SUCCESS
    search     where it came to rest short of the end, about the nominal axis; on success the push starts again
    centre     at rest near the end, aside of the nominal axis: drawn back as far as the walls let it     `centre`
    lost       more than `lost` beyond the end is beside the hole: lift, return over the axis, push again

What is added to the push is a wrench F at the centre of compliance, u the way, rho the turn from the nominal attitude:

    catch      - c max(0, v.u - v_max) u                     so that a part that lets go does not fall in
    lean       - k_0 rho - k_1 max(0, |rho| - most) rho/|rho|    so that it does not lie down; k_0 until it is searched
                                                                 for, or rests in the hole
    keep       - k max(0, |a| - most) a/|a| - d v_a              so that a slanting push does not pass the fixture by
    free       - (1 - u u^T) K (x_d - x)                         in the hole, which guides the part: a push that slants
                                                                 or is stiff on an axis across jams it
    rock       a torque that goes round: quickly, slowly, then   in the hole, where it rests short of the end: frees a
               on a spiral of the tip, see `rocking`             jam, and finds a second hole below
    settle     a torque that goes round, and a force to the      where it rests near the end: lets it stand flush where
               nominal axis; both fade                           it is loose, if asked for

a is the way from the nominal axis to the tool, across u, and v_a its rate, beyond the most. A fixture that is off on
two axes at once is off by sqrt(2) tilt in attitude, and by sqrt(2) (shift + tilt h) in place, h from where it is turned
about, which may be the mouth or the end: nobody says. A push that nobody has searched for yet is kept nearer, within
sqrt(2) shift, since to go wider is the search's part.

Where the demonstrations ended without pressing, nothing stops the part: force and speed of the push along u fade over
the last `stop_m`. In the hole the attitude wanted follows the measured one, low-passed and never farther from the
nominal one than the most: the hole knows better. All of this is ours. Searches and returns are counted together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from skillframe.document.frame import read_frame
from skillframe.extend.records import Document
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose, norm, rotation_matrix, rotation_vector
from skillframe.sequence import END, Composition, Part
from skillframe.skill import Command, Observation, Skill, Status
from skillframe_search.centre import ACROSS, Centre
from skillframe_search.reach import Reach
from skillframe_search.rocking import Rocking
from skillframe_search.seat_document import PUSH, SEARCH, Seat, part_of, read_seat

APPROACH, PUSHING, SEARCHING, CENTRING = 0, 1, 2, 3
RUNNING = int(Status.RUNNING)  # a look into the enumeration takes as long as a sum over the batch
FARTHEST_M = 0.08  # an approach may be longer than the demonstrated one by this
KEEP_NS_M = 100.0
REST_S, REST_RAD = 0.3, 0.005  # without progress, near the end, and without a turn as large
MOST_TURNING_S = 2.0  # for so long it may turn there
ENTERED_M = 0.002  # deeper than the first contact was by this is in the hole: rocked before it is searched for


def build(document: Document) -> Seating:
    """The runnable seating of a checked document.

    Raises:
        InputError: the document's block `seat`, or a phase, is not as it should be.
    """
    push, search = (_maker(part_of(document, i)) for i in (PUSH, SEARCH))
    seat = read_seat(document)
    return Seating(seat, read_frame(document).center_of_compliance - np.array(seat.point), push, search)


def _maker(document: Document) -> Callable[[], Skill]:
    kind = registry().skill(document["type"])
    return lambda: kind.build(document)


class Seating(Composition):
    """N trials of seating one part.

    Args:
        seat: where it belongs and what is added to the push.
        shift: (3,) from the seat's point to the centre of compliance, tool axes.
        push: makes the skill that pushes.
        search: makes the skill that searches where it has stalled.
    """

    def __init__(self, seat: Seat, shift: Float, push: Callable[[], Skill], search: Callable[[], Skill]) -> None:
        self._seat, self._way = seat, np.array(seat.way)
        self._upright = rotation_matrix(np.array(seat.attitude))
        self._end, self._start = (np.array(place) + self._upright @ shift for place in (seat.end, seat.start))
        self._rocking = Rocking(seat, self._upright)
        parts = [Part("approach", self._reach), Part("push", push), Part("search", search)]
        super().__init__([*parts, Part("centre", self._centre)])

    def _centre(self) -> Skill:
        return Centre(self._ends, self._way, self._seat.centre_n, pressed=not self._seat.stop_m)

    def _reach(self) -> Skill:
        seat, above = self._seat, -self._seat.above_m * self._way
        farthest = FARTHEST_M + float(norm(self._start - self._end - above))
        return Reach(self._ends + above, self._upright, self._way, seat.approach_speed, farthest)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin with the approach, or with the push where there is none."""
        n = len(rngs)
        self._ends = np.tile(self._end, (n, 1))
        if self._seat.place == "start":
            self._ends += observation.pose.position - self._start
        self._tried = np.zeros(n, dtype=np.intp)
        self._searched, self._urged, self._centred = (np.zeros(n, dtype=bool) for _ in range(3))
        self._held = observation.pose.rotation.copy()
        self._stood, self._stands = observation.pose.rotation.copy(), observation.time.copy()
        self._rocking.start(n)
        self._best, self._since, self._rim = np.full(n, -np.inf), observation.time.copy(), np.zeros(n)
        super().start(observation, rngs)
        if not self._seat.approach:
            self._due = np.full(n, PUSHING)
            self._journal = [[(time, "push: begins")] for time in observation.time.tolist()]

    def step(self, observation: Observation) -> Command:
        """Let the parts answer, look how the push gets on, and add to it."""
        self._deep = _dot(observation.pose.position - self._ends, self._way)
        self._off = self._aside(observation)
        moved = self._deep > self._best + self._seat.progress_m
        self._best, self._since = (
            np.where(moved, self._deep, self._best),
            np.where(moved, observation.time, self._since),
        )
        command = self._guided(observation, self._followed(observation, super().step(observation)))
        self._look(observation, command.status == RUNNING)
        if np.count_nonzero(self._status):
            told = np.where(self._status == RUNNING, "", self._reason)
            command = command._replace(status=self._status.copy(), reason=told)
        return command._replace(feedforward=command.feedforward + self._added(observation))

    def switch(self, row: int, part: int, time: float, why: str) -> None:
        """Enter a part, and watch its progress afresh."""
        super().switch(row, part, time, why)
        self._best[row], self._since[row] = -np.inf, time

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The push after approach and search, the search after a push that ends short of the end."""
        if part != PUSHING:
            if status != Status.SUCCESS:
                return END, status, reason
            self._searched[row] |= part == SEARCHING
            self._centred[row] = part == CENTRING  # a search, or a new approach, leaves it somewhere else
            return PUSHING, Status.RUNNING, f"begins, as the {self.parts[part].name} ended: {reason}"
        left = -1e3 * float(self._deep[row])
        entered = self._entered()[row]
        if status == Status.SUCCESS and left > 1e3 * self._seat.short_m and entered and not self._urged[row]:
            self._urged[row] = True
            return PUSHING, Status.RUNNING, f"goes on and rocks, {left:.1f} mm short of the end: {reason}"
        if status == Status.SUCCESS and self._near()[row] and self._beyond(row) and self._tried[row] < self._seat.tries:
            self._tried[row] += 1
            aside = 1e3 * float(self._off[row])
            return APPROACH, Status.RUNNING, f"lifts and returns, {aside:.1f} mm aside of the nominal axis: {reason}"
        if status == Status.SUCCESS and self._near()[row]:
            aside = 1e3 * float(self._off[row])
            if self._seat.centre_n and not self._centred[row] and aside > 1e3 * self._seat.aside_m:
                return CENTRING, Status.RUNNING, f"begins, {aside:.1f} mm aside of the nominal axis: {reason}"
            return END, status, f"seated, {abs(left):.1f} mm from the demonstrated end: {reason}"
        if status != Status.SUCCESS:
            return END, status, reason
        if not self._seat.search or self._tried[row] >= self._seat.tries:
            tried = f" after {self._tried[row]} searches and returns" if self._seat.search else ""
            return END, Status.FAILURE, f"stalled {left:.1f} mm short of the demonstrated end{tried}: {reason}"
        self._tried[row] += 1
        return SEARCHING, Status.RUNNING, f"begins, as the push stalled {left:.1f} mm short of the end: {reason}"

    def _beyond(self, row: int) -> bool:
        """Whether a part that was drawn back still rests farther aside than the fixture may be off, and `aside_m`."""
        return bool(self._centred[row] and self._off[row] > self._seat.most_aside_m)

    def _near(self) -> NDArray[np.bool_]:
        result: NDArray[np.bool_] = self._deep >= -(self._seat.short_m + self._seat.height_m)
        return result

    def _aside(self, observation: Observation) -> Float:
        """(N,) distance from the nominal axis [m]."""
        away = observation.pose.position - self._ends
        return np.sqrt(np.maximum(_dot_rows(away) - self._deep * self._deep, 0.0))

    def _look(self, observation: Observation, running: NDArray[np.bool_]) -> None:
        """Whose push has stalled, is at the end, or has gone past it, and whose search has sunk."""
        time = observation.time
        here = running & (self._status == RUNNING)
        if self._due is not None:
            here &= self._due == END
        idle = time - self._since
        lost = here & (self.current != APPROACH) & (self._deep > self._seat.lost_m + self._seat.height_m)
        still = here & ~lost & (self.current == PUSHING)
        patience = np.where(self._in_hole(), self._rocking.patience(self._deep, self._urged), self._seat.stall_s)
        still &= np.where(self._deep >= -self._seat.short_m, self._settled(observation, idle), idle >= patience)
        for i in _rows(still):
            self.leave(i, float(time[i]), Status.SUCCESS, f"no progress for {idle[i]:.1f} s")
        sunk = self._deep - self._rim - self._seat.sunk_m - np.tan(self._seat.tilt_rad) * self._off
        for i in _rows(here & ~lost & (self.current == SEARCHING) & (sunk > 0.0)):
            deeper = 1e3 * float(self._deep[i] - self._rim[i])
            self.leave(i, float(time[i]), Status.SUCCESS, f"sank {deeper:.1f} mm")
        for i in _rows(lost):
            self._return(i, float(time[i]))

    def _settled(self, observation: Observation, idle: Float) -> NDArray[np.bool_]:
        """(N,) whether parts near the end have rested there for so long [s], and do not turn any more."""
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

    def _return(self, row: int, time: float) -> None:
        past = f"went {1e3 * self._deep[row]:.1f} mm past the end, which is beside the hole"
        self._tried[row] += 1
        if self._tried[row] > self._seat.tries:
            self._status[row], self._reason[row] = Status.FAILURE, f"{self.parts[self.current[row]].name}: {past}"
            return
        self.switch(row, APPROACH, time, f"lifts and returns, as the tool {past}")

    def _enter(self, observation: Observation, due: NDArray[np.intp]) -> None:
        """Begin a search about the nominal axis, and a push in an attitude that the fixture may have."""
        position, rotation = observation.pose.position.copy(), observation.pose.rotation.copy()
        rows = np.flatnonzero(due == SEARCHING)
        self._rim[rows] = self._deep[rows]
        position[rows] = self._ends[rows] + self._deep[rows, None] * self._way
        rotation[rows] = self._upright
        rows = np.flatnonzero(due == PUSHING)
        self._held[rows] = rotation[rows] = self._within(rotation[rows])
        super()._enter(observation._replace(pose=Pose(position, rotation)), due)

    def _within(self, rotation: Float) -> Float:
        """Attitudes (N, 3, 3) no farther from the nominal one than the fixture may be."""
        turn = rotation_vector(rotation @ self._upright.T)
        share = np.minimum(1.0, self._seat.most_tilt_rad / np.maximum(norm(turn), 1e-9))
        return rotation_matrix(share[:, None] * turn) @ self._upright

    def _followed(self, observation: Observation, command: Command) -> Command:
        """The command, its attitude following the measured one where a part in the hole does not turn on purpose."""
        inside = (self.current == PUSHING) & self._in_hole()
        if not np.count_nonzero(inside) or not self._seat.follow_s:
            return command
        rows = np.flatnonzero(inside & ~command.twist[:, 3:].any(axis=1))
        if not len(rows):
            return command
        share = observation.dt / (self._seat.follow_s + observation.dt)
        turn = rotation_vector(observation.pose.rotation[rows] @ np.swapaxes(self._held[rows], -1, -2))
        self._held[rows] = self._within(rotation_matrix(share * turn) @ self._held[rows])
        rotation = command.pose.rotation.copy()
        rotation[rows] = self._held[rows]
        return command._replace(pose=Pose(command.pose.position, rotation))

    def _in_hole(self) -> NDArray[np.bool_]:
        """Who has been searched for, or has gone beyond the first contact and stalled there."""
        result: NDArray[np.bool_] = self._searched | self._urged
        return result

    def _guided(self, observation: Observation, command: Command) -> Command:
        """The command, its push without what goes across the way in the hole, and fading before an end that is open."""
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
            along = _dot(given, self._way)
            across = given - along[:, None] * self._way
            left_out = (gone * np.maximum(along, 0.0))[:, None] * self._way + np.where(inside[:, None], across, 0.0)
            wanted[:, :3] -= left_out
        return command._replace(twist=twist, feedforward=feedforward)

    def _added(self, observation: Observation) -> Float:
        """(N, 6) the wrench that is added to the push: catch, keep, lean and rock."""
        seat, pushing = self._seat, self.current == PUSHING
        added = np.zeros((len(pushing), 6))
        if not np.count_nonzero(pushing):
            return added
        fast = np.maximum(_dot(observation.twist[:, :3], self._way) - seat.catch_m_s, 0.0)
        added[:, :3] = -seat.catch_ns_m * fast[:, None] * self._way + self._kept(observation)
        turn = rotation_vector(observation.pose.rotation @ self._upright.T)
        angle = np.maximum(norm(turn), 1e-9)
        free = self._in_hole() | (self._entered() & bool(seat.settle_s))
        pull = (
            np.where(free, 0.0, seat.upright_nm_rad)
            + seat.lean_nm_rad * np.maximum(angle - seat.most_tilt_rad, 0.0) / angle
        )
        added[:, 3:] = -pull[:, None] * turn
        idle = observation.time - self._since
        resting = self._in_hole() & (self._deep < -seat.short_m)
        added[:, 3:] += self._rocking.torque(observation, idle, self._deep, resting, self._urged)
        if not seat.stop_m:
            self._settle(added, observation, np.where(self._deep < -seat.short_m, 0.0, self._rocking.settling(idle)))
        return np.where(pushing[:, None], added, 0.0)

    def _settle(self, added: Float, observation: Observation, share: Float) -> None:
        """Add to (N, 6) what lets parts at rest near the end stand flush, each its share (N,) of the most."""
        if not np.count_nonzero(share):
            return
        seat = self._seat
        back = self._ends + self._deep[:, None] * self._way - observation.pose.position
        pull = share * np.minimum(ACROSS, seat.settle_n / np.maximum(self._off, 1e-9))
        added[:, :3] += pull[:, None] * back
        added[:, 3:] += self._rocking.settle(observation.time, share)

    def _kept(self, observation: Observation) -> Float:
        """(N, 3) the force that keeps a push where the fixture may be."""
        seat = self._seat
        wide = self._searched | self._entered()
        beyond = self._off - np.where(wide, seat.most_aside_m, sqrt(2.0) * seat.shift_m + seat.aside_m)
        if not np.count_nonzero(beyond > 0.0):
            return np.zeros((len(beyond), 3))
        away = observation.pose.position - self._ends - self._deep[:, None] * self._way
        out = away / np.maximum(self._off, 1e-9)[:, None]
        speed = _dot(observation.twist[:, :3], out.T)
        force = np.where(beyond > 0.0, seat.keep_n_m * beyond + KEEP_NS_M * speed, 0.0)
        kept: Float = -np.maximum(force, 0.0)[:, None] * out
        return kept

    def _entered(self) -> NDArray[np.bool_]:
        result: NDArray[np.bool_] = self._deep > -self._seat.contact_m + ENTERED_M
        return result


def _rows(chosen: NDArray[np.bool_]) -> list[int]:
    """Which of (N,), at no cost where there is none."""
    return np.flatnonzero(chosen).tolist() if np.count_nonzero(chosen) else []


def _dot_rows(rows: Float) -> Float:
    """(N,) squared lengths of rows (N, 3), each by itself."""
    result: Float = rows[:, 0] ** 2 + rows[:, 1] ** 2 + rows[:, 2] ** 2
    return result


def _dot(rows: Float, way: Float) -> Float:
    """(N,) how far rows (N, 3) go along a way (3,), or each along its own, (3, N), by itself."""
    result: Float = rows[:, 0] * way[0] + rows[:, 1] * way[1] + rows[:, 2] * way[2]
    return result
