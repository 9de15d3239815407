r"""Skill that finds a hole's axis from the play of a part in it: swung to its limits, in the middle of which it lies.

    lift        by `lift_m` against the way, off what the part stands on
    torques     +m a, -m a, +m b, -m b; a, b across the way: free to turn and across the way, the height held
    axis        F = exp(rho), rho . a = (rho_1 + rho_2) . a / 2, rho . b = (rho_3 + rho_4) . b / 2
                with rho_i = log(R_i R_0^T) at the limits
    upright     turned to the axis, R = F R_0
    down        slowly as far as is left to the end, or until `held_n` hold it

Where the axis crosses the plane of the hole entrance is the fixture's place, and F its tilt. A pin leans to its
limits whatever friction and clearance are, so that none of them has to be known. The idea is our own choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, dot, norm, rotate, rotation_matrix, rotation_vector
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of
from skillframe_search.contact import surface_axes

LIMITS = 4
LIFTING, UPRIGHT, DOWN = 0, 5, 6
ROWS = ("_began", "_stage", "_at", "_turns", "_found", "_felt", "_rate", "_status", "_reason")


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How a part is swung, gently: on parts of play .05 to .5 mm contact then exerts some 5 N.

    Attributes:
        lift_m: farther than a part tips where it stands, less than it is in the hole [m]; lift_s: duration [s].
        torque_nm: as large as a jam in a hole needs [Nm]; rise_s: until it is reached [s].
        damping_nms: lets it turn at 0.2 rad/s at most, so that the part does not hit its limits [Nms/rad].
        least_s, most_s, rest_rad_s, rate_s: a torque lasts until the part turns no faster than rest_rad_s, in the mean
            over rate_s, but at least and at most so long [s, rad/s].
        upright_s: of the turn to the axis found [s]; turn_nm_rad: its stiffness [Nm/rad].
        height_n_m: stiffness along the way [N/m].
        down_m_s: speed of the way down [m/s]; held_n: force over smoothing_s that ends it [N, s].
    """

    lift_m: float = 0.0015
    lift_s: float = 0.3
    torque_nm: float = 0.7
    rise_s: float = 0.1
    damping_nms: float = 3.0
    least_s: float = 0.25
    most_s: float = 1.5
    rest_rad_s: float = 0.02
    rate_s: float = 0.05
    upright_s: float = 0.3
    turn_nm_rad: float = 20.0
    height_n_m: float = 3000.0
    down_m_s: float = 0.006
    held_n: float = 6.0
    smoothing_s: float = 0.02


HOW = Motion()


class Swing(Skill):
    """Swings N parts in their holes.

    Args:
        ends: (N, 3) where the parts are seated [m].
        way: (3,) unit vector of insertion.
        upright: (3, 3) nominal orientation of the tool.
    """

    def __init__(self, ends: Float, way: Float, upright: Float) -> None:
        self._ends, self._way, self._upright = ends, way, upright
        self._a, self._b = a, b = surface_axes(way)[:2]
        self._torques = HOW.torque_nm * np.stack([np.zeros(3), a, -a, b, -b, np.zeros(3), np.zeros(3)])
        along = np.outer(way, way)
        self._free, self._stiff = np.zeros((6, 6)), np.zeros((6, 6))
        self._free[:3, :3] = self._stiff[:3, :3] = HOW.height_n_m * along
        self._stiff[3:, 3:] = HOW.turn_nm_rad * np.eye(3)

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin with the lift."""
        n = len(rngs)
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._began, self._stage = observation.time.copy(), np.zeros(n, dtype=np.intp)
        self._at, self._turns = np.zeros((n, LIMITS, 3)), np.zeros((n, LIMITS, 3))
        self._found, self._felt, self._rate = observation.pose.rotation.copy(), np.zeros(n), np.zeros((n, 3))
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in the given trials."""
        fresh = Swing(self._ends[rows], self._way, self._upright)
        fresh.start(rows_of(observation, rows), rngs)
        for name in ROWS:
            getattr(self, name)[rows] = getattr(fresh, name)
        self._home.position[rows], self._home.rotation[rows] = fresh._home

    def step(self, observation: Observation) -> Command:
        """The next command."""
        into = observation.time - self._began
        self._rate += (observation.twist[:, 3:] - self._rate) * (observation.dt / (HOW.rate_s + observation.dt))
        over = np.where(
            self._stage == LIFTING,
            into > HOW.lift_s,
            (into > HOW.most_s) | (norm(self._rate) < HOW.rest_rad_s) & (into > HOW.least_s),
        )
        over = np.where(self._stage == UPRIGHT, into > HOW.upright_s, over) & (self._stage < DOWN)
        for i in np.flatnonzero(over).tolist():
            if LIFTING < self._stage[i] < UPRIGHT:
                # note the orientation at a limit, and the axis once all are known
                limit, turn = int(self._stage[i]) - 1, rotation_vector(observation.pose.rotation[i] @ self._upright.T)
                self._turns[i, limit], self._at[i, limit] = turn, observation.pose.position[i]
                if limit == LIMITS - 1:
                    about = rotation_matrix((turn @ self._way) * self._way)
                    self._found[i] = rotation_matrix(self._tilt()[i]) @ about @ self._upright
        self._stage += over
        self._began = np.where(over, observation.time, self._began)
        into, stage = observation.time - self._began, self._stage
        lifted = HOW.lift_m * np.where(stage == LIFTING, np.minimum(into / HOW.lift_s, 1.0), 1.0)
        farthest = HOW.lift_m + np.maximum(dot(self._ends - self._home.position, self._way), 0.0)
        down = np.where(stage == DOWN, np.minimum(HOW.down_m_s * into, farthest), 0.0)
        self._felt += (-dot(observation.wrench[:, :3], self._way) - self._felt) * (
            observation.dt / (HOW.smoothing_s + observation.dt)
        )
        held = (down > 0.0) & (self._felt > HOW.held_n)
        for i in np.flatnonzero((self._status == Status.RUNNING) & (held | (down >= farthest))).tolist():
            lean = float(np.degrees(norm(self._tilt()[i])))
            self._status[i], self._reason[i] = Status.SUCCESS, f"the axis leans by {lean:.1f} degrees"
        wrench = np.zeros((len(into), 6))
        wrench[:, 3:] = self._torques[stage] * np.clip(into / HOW.rise_s, 0.0, 1.0)[:, None]
        wrench[:, 3:] -= (HOW.damping_nms * (stage < UPRIGHT))[:, None] * observation.twist[:, 3:]
        place = self._home.position + (down - lifted)[:, None] * self._way
        stiffness = np.where((stage >= UPRIGHT)[:, None, None], self._stiff, self._free)
        zero = np.zeros((len(into), 6))
        pose = Pose(place, self._found.copy())
        return Command(pose, zero, Impedance(stiffness), wrench, self._status.copy(), self._reason.copy())

    def _tilt(self) -> Float:
        """(N, 3) rotation vectors of the axes."""
        return self._middle(self._turns, self._a, self._b)

    def _middle(self, limits: Float, first: Float, second: Float) -> Float:
        """(N, 3) across the way: along `first` between limits 0 and 1, along `second` between 2 and 3.

        A part that is turned about one axis keeps, by friction, what it leans about the other.
        """
        one, two = limits[:, :2].mean(axis=1), limits[:, 2:].mean(axis=1)
        result: Float = dot(one, first)[:, None] * first + dot(two, second)[:, None] * second
        return result

    def axes(self, entrance: Float) -> Pose:
        """Where the fixtures stand, against where they nominally do.

        Args:
            entrance: (N, 3) where the nominal axis crosses the plane of the hole entrance [m].

        Returns:
            the pose (N, 3), (N, 3, 3), of the frame in which each fixture is nominal.
        """
        turn, inside = rotation_matrix(self._tilt()), self._at - entrance[:, None]
        tip = self._middle(inside, self._b, self._a)  # a turn about a moves the tip along b
        along = rotate(turn, np.broadcast_to(self._way, entrance.shape))
        deep = dot(inside.mean(axis=1), self._way)
        crossing = entrance + tip + deep[:, None] * (self._way - along / dot(along, self._way)[:, None])
        return Pose(crossing - rotate(turn, entrance), turn)
