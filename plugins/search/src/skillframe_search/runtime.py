r"""Search skill for N trials: approach, press, follow the plan, stop when the part falls in.

    approach   x_d moves along the push at approach speed, leading by no more than the push     until contact
    search     no stiffness along the push; the push grows to its force over 0.2 s; x_d follows the plan (eq. 1)
    end        SUCCESS when it falls in (`Watch`), FAILURE when time is up, nothing is touched, or at a force limit

Ended trials hold their pose. Each row is computed by itself, so a trial's commands do not depend on the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.document import read_frame
from skillframe.extend import Document
from skillframe.frames import Float, Pose, cross, dot, move_wrench, rotate, rotate_spatial, rotation_matrix
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of
from skillframe_search.phase import Phase, Push, Stop, read_phase
from skillframe_search.plan import NUMBERS, keyed, plan
from skillframe_search.smoothing import STEP_S

HOLD = 1000.0  # N/m along the push in the approach and at the end
RUNNING = int(Status.RUNNING)  # enumeration access is slow in the loop
PER_TRIAL = (
    "_turn", "_push", "_place", "_rate", "_wrench", "_length", "_lever", "_began", "_touched", "_lead", "_status",
    "_reason", "_stiffness", "_commanded", "_reached",
)  # fmt: skip


def build(document: Document) -> SearchSkill:
    """The skill of a document.

    Raises:
        InputError: the document's phase is invalid.
    """
    frame = read_frame(document)
    return SearchSkill(read_phase(document), frame.from_start, frame.moved)


class SearchSkill(Skill):
    """A search by feel.

    Args:
        phase: the learned phase.
        in_start_orientation: the search frame has the tool's axes at the start, not those of base.
        shift: (3,) from the learning point to the centre of compliance, tool axes.
    """

    def __init__(self, phase: Phase, in_start_orientation: bool, shift: Float) -> None:
        self._phase, self._stop, self._shift = phase, phase.stop, shift
        self._in_start_orientation, self._key = in_start_orientation, keyed(phase)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the pose as the search frame, and choose trajectories."""
        n = len(rngs)
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._turn = self._home.rotation.copy() if self._in_start_orientation else np.tile(np.eye(3), (n, 1, 1))
        self._push = rotate(self._turn, np.array(self._phase.push.direction))
        plans = [plan(self._key, int(rng.integers(NUMBERS))) for rng in rngs]
        self._place, self._rate, self._wrench = (np.stack([p[i] for p in plans]) for i in range(3))
        self._length = np.array([p.length for p in plans])
        self._lever = rotate(self._home.rotation, np.broadcast_to(self._shift, (n, 3)))
        self._began, self._touched = observation.time.copy(), np.full(n, np.inf)
        self._lead, self._commanded, self._reached = np.zeros(n), np.zeros(n), np.zeros(n)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)
        self._watch = Watch(self._phase.push, self._stop, self._push, observation)
        self._end = Pose(self._home.position.copy(), self._home.rotation.copy())
        self._stiffness = self._gain(HOLD, np.ones(n, dtype=bool))
        self._row = np.arange(n)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        fresh = SearchSkill(self._phase, self._in_start_orientation, self._shift)
        fresh.start(rows_of(observation, rows), rngs)
        self._stiffness = self._stiffness.copy()
        for name in PER_TRIAL:
            getattr(self, name)[rows] = getattr(fresh, name)
        for mine, theirs in ((self._home, fresh._home), (self._end, fresh._end)):
            mine.position[rows], mine.rotation[rows] = theirs
        self._watch.replace(rows, fresh._watch)

    def _gain(self, along: float, rows: NDArray[np.bool_]) -> Float:
        """(n, 6, 6) stiffness of some rows with a stiffness along the push."""
        push, values = self._push[rows], self._phase.stiffness
        result = np.zeros((len(push), 6, 6))
        outer = push[:, :, None] * push[:, None, :]
        result[:, :3, :3] = values.translation * np.eye(3) + (along - values.translation) * outer
        result[:, 3:, 3:] = values.rotation * np.eye(3)
        if values.turn is not None:
            result[:, 3:, 3:] += (values.turn - values.rotation) * outer
        return result

    def step(self, observation: Observation) -> Command:
        """Approach, search or hold in each row."""
        running = self._status == RUNNING
        fallen = self._watch.look(observation) & np.isfinite(self._touched)
        new = running & np.isinf(self._touched) & self._watch.touched()
        if np.count_nonzero(new):
            self._touched[new] = observation.time[new]
            self._watch.settle(new)
            self._stiffness = self._stiffness.copy()
            self._stiffness[new] = self._gain(0.0, new)
        self._judge(observation, running & np.isfinite(self._touched), fallen)
        return self._command(observation)

    def _command(self, observation: Observation) -> Command:
        status = self._status
        running = status == RUNNING
        searching = running & np.isfinite(self._touched)
        nearing = running & ~searching
        elapsed = np.where(searching, observation.time - np.where(searching, self._touched, 0.0), 0.0)
        place, rate, wrench, turned = self._on_plan(elapsed)
        went = observation.pose.position - self._home.position
        for most, moved in ((self._commanded, place[:, :3]), (self._reached, went)):  # squared, across the push [m2]
            onto = dot(moved, self._push)
            np.maximum(most, np.where(searching, dot(moved, moved) - onto * onto, 0.0), out=most)
        grown = np.where(searching, np.clip(elapsed / 0.2, 0.0, 1.0), 0.0)[:, None]  # of the push after the touch
        farthest = self._watch.depth + self._phase.push.force / HOLD
        self._lead = np.where(
            nearing, np.minimum(self._lead + self._stop.approach_speed * observation.dt, farthest), self._lead
        )
        along = np.where(searching, self._watch.depth, self._lead)
        position = self._home.position + place[:, :3] + along[:, None] * self._push
        rotation = turned @ self._home.rotation
        twist = np.where(searching[:, None], rate, 0.0)
        twist[:, :3] += np.where(nearing, self._stop.approach_speed, 0.0)[:, None] * self._push
        ended = ~running
        if np.count_nonzero(ended):
            position = np.where(ended[:, None], self._end.position, position)
            rotation = np.where(ended[:, None, None], self._end.rotation, rotation)
        gain = Impedance(self._stiffness)
        return Command(Pose(position, rotation), twist, gain, grown * wrench, status.copy(), self._reason.copy())

    def _on_plan(self, elapsed: Float) -> tuple[Float, Float, Float, Float]:
        """Place, rate and wrench (N, 6) at seconds since the touch, base axes, at the centre, and the turn."""
        last = self._place.shape[1] - 1
        index = np.minimum((elapsed / STEP_S).astype(int), last)
        rate = self._rate[self._row, index]
        place = self._place[self._row, index] + (np.minimum(elapsed, last * STEP_S) - index * STEP_S)[:, None] * rate
        wrench = self._wrench[self._row, index]
        if self._in_start_orientation:
            place, rate, wrench = (rotate_spatial(self._turn, values) for values in (place, rate, wrench))
        turned = rotation_matrix(place[:, 3:])
        if not self._shift.any():
            return place, rate, wrench, turned
        # the learning point follows the place; the centre of compliance turns about it
        place, swept = place.copy(), np.zeros_like(rate)
        place[:, :3] += rotate(turned, self._lever) - self._lever
        swept[:, :3] = cross(rate[:, 3:], self._lever)
        return place, rate + swept, move_wrench(wrench, self._lever), turned

    def _judge(self, observation: Observation, searching: NDArray[np.bool_], fallen: NDArray[np.bool_]) -> None:
        stop, force = self._stop, observation.wrench[:, :3]
        squared = force[:, 0] ** 2 + force[:, 1] ** 2 + force[:, 2] ** 2
        over = squared > stop.force_limit_n**2
        late = searching & (observation.time - self._touched >= stop.time_s)
        longest = 2.0 * stop.approach_m / stop.approach_speed
        lost = ~searching & ((self._watch.depth > stop.approach_m) | (observation.time - self._began > longest))
        ending = (self._status == RUNNING) & (fallen | over | late | lost)
        for i in np.flatnonzero(ending).tolist() if np.count_nonzero(ending) else ():
            found, hard = bool(fallen[i]), bool(over[i])
            seconds = float(observation.time[i] - (self._touched[i] if searching[i] else self._began[i]))
            self._status[i], self._reason[i] = self._verdict(i, found, hard, bool(late[i]), seconds, float(squared[i]))
            self._end.position[i], self._end.rotation[i] = observation.pose.position[i], observation.pose.rotation[i]
            self._stiffness = self._stiffness.copy()
            self._stiffness[i] = self._gain(HOLD, np.arange(len(ending)) == i)[0]

    def _verdict(self, i: int, found: bool, hard: bool, late: bool, seconds: float, squared: float) -> tuple[int, str]:
        if hard:
            limit = self._stop.force_limit_n
            return Status.FAILURE, f"contact force {np.sqrt(squared):.0f} N above the limit of {limit:.0f} N"
        if found:
            return Status.SUCCESS, f"fell in after {seconds:.2f} s of search"
        if late:
            way = 1e3 * self._length[i]
            sent, came = (1e3 * float(np.sqrt(squares[i])) for squares in (self._commanded, self._reached))
            # of the commanded distance: less was held by friction
            held = ": friction holds the tool" if came < 0.5 * sent else ""
            return Status.FAILURE, (
                f"searched for {seconds:.1f} s along {way:.0f} mm and did not fall in; commanded {sent:.1f} mm, "
                f"reached {came:.1f} mm{held}"
            )
        went = 1e3 * float(self._watch.depth[i])
        return Status.FAILURE, f"touched no surface within {went:.0f} mm of the start; start the search nearer to it"


class Watch:
    r"""Detects from pose and wrench that a part has fallen in, in N trials, each row by itself.

        answer  n = - w . push          low-passed over 20 ms       reaction of the surface
        surface s                       depth along the push, low-passed over 0.5 s, while n is above its share of it
        fallen  <=>  depth - s > drop  and  n fell below its share of the push within the last second

    Depth alone would mistake a slope for a hole, and the reaction alone a bump.

    Attributes:
        answer: (N,) reaction of the surface [N].
        depth: (N,) along the push since the start [m].
    """

    def __init__(self, push: Push, stop: Stop, direction: Float, observation: Observation) -> None:
        count = len(observation.time)
        self._push, self._stop, self._direction = push, stop, direction.copy()
        self._home = observation.pose.position.copy()
        self.answer, self.depth = np.zeros(count), np.zeros(count)
        self._surface, self._lost = np.zeros(count), np.full(count, -np.inf)

    def replace(self, rows: NDArray[np.intp], other: Watch) -> None:
        """Replace the state of some trials by that of another watch of these alone."""
        for name in ("_direction", "_home", "answer", "depth", "_surface", "_lost"):
            getattr(self, name)[rows] = getattr(other, name)

    def touched(self) -> NDArray[np.bool_]:
        """Trials that press against something now."""
        result: NDArray[np.bool_] = self.answer > self._stop.touch_n
        return result

    def settle(self, rows: NDArray[np.bool_]) -> None:
        """Take the present depth as the surface."""
        self._surface[rows] = self.depth[rows]
        self._lost[rows] = -np.inf

    def look(self, observation: Observation) -> NDArray[np.bool_]:
        """Take in an observation, and return which trials have fallen in (N,)."""
        dt = observation.dt
        felt = -dot(observation.wrench[:, :3], self._direction)
        self.answer = self.answer + (felt - self.answer) * (dt / (0.02 + dt))
        self.depth = dot(observation.pose.position - self._home, self._direction)
        pressed = self.answer > self._stop.lost_share * self._push.force
        followed = self._surface + (self.depth - self._surface) * (dt / (0.5 + dt))
        self._surface = np.where(pressed, followed, self._surface)
        self._lost = np.where(pressed, self._lost, observation.time)
        deep = self.depth - self._surface > self._stop.drop_m
        result: NDArray[np.bool_] = deep & (observation.time - self._lost < 1.0)
        return result
