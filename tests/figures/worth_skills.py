"""Pushes and played motions, one a row, so that all methods of a table run in one simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from skillframe_lmc.phase import Stop
from skillframe_lmc.stall import StallWatch

from skillframe.extend import Document
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose, rotation_matrix, rotation_vector, unit
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons, rows_of

STIFF_N_M, STIFF_NM_RAD = 1000.0, 20.0
GRID = 0.005  # s between two samples of a played motion
LONGEST = 8.0  # s that a run may take; the longest way is 95 mm at 20 mm/s
SAMPLED_S = 14.0  # s of a played motion that are sampled: as long as the longest run
SPIRAL_M, SPIRAL_SPEED = 0.003, 0.02  # what a turn of the spiral adds to its radius [m], and its speed along the way


def stiff() -> Float:
    """Stiffness (6, 6) that holds everything."""
    return np.diag(np.repeat([STIFF_N_M, STIFF_NM_RAD], 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One trial: a push and turn as LMC runs them, or a skill file's motion.

    Attributes:
        push, turn: (3,) unit vectors in base, zero for none.
        stiffness: (6, 6).
        speed, turning: [m/s], [rad/s]; lead, twist: largest push [N] and torque [Nm].
        spiral: search square to the push while pushing.
        document: a skill whose commands, which go by time alone, are played in place of a push.
        compliance: (6, 6) stiffness for it in place of its own, or None.
    """

    push: Float = field(default_factory=lambda: np.zeros(3))
    turn: Float = field(default_factory=lambda: np.zeros(3))
    stiffness: Float = field(default_factory=stiff)
    speed: float = 0.02
    turning: float = 0.0
    lead: float = 20.0
    twist: float = 2.0
    spiral: bool = False
    document: Document | None = None
    compliance: Float | None = None


class Rows(Skill):
    """Runs a `Row` each. Pushes are as in `skillframe_lmc.runtime`, without its limits of time, force and travel."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows = rows

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin where the tools are."""
        rows = self._rows
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._push, self._turn = np.array([r.push for r in rows]), np.array([r.turn for r in rows])
        self._speed, self._turning = np.array([r.speed for r in rows]), np.array([r.turning for r in rows])
        self._stiffness = np.array([r.stiffness for r in rows])
        self._impedance = Impedance(self._stiffness.copy())
        self._limit = np.array([r.lead for r in rows]) / self._along(self._push, 0)
        self._turn_limit = np.array([r.twist for r in rows]) / self._along(self._turn, 3)
        self._progress, self._turned, self._stall = np.zeros(len(rows)), np.zeros(len(rows)), StallWatch(Stop())
        self._turns = np.flatnonzero(self._turn.any(axis=1))
        self._spirals = np.flatnonzero([r.spiral for r in rows])
        self._spanned = np.array([np.linalg.svd(rows[i].push[None])[2][1:] for i in self._spirals]).reshape(-1, 2, 3)
        self._still = np.array([not (r.push.any() or r.turn.any() or r.document) for r in rows])
        self._played = [(np.array(at), _played(rows[at[0]], rows_of(observation, np.array(at))))
                        for at in self._documents().values()]  # fmt: skip
        self._softened: dict[int, Impedance] = {}
        self._status, self._tick = np.zeros(len(rows), dtype=np.int64), 0

    def _along(self, direction: Float, first: int) -> Float:
        part = self._stiffness[:, first : first + 3, first : first + 3]
        k = np.einsum("ni,nij,nj->n", direction, part, direction)
        return np.where(k > 0.0, k, 1e-9)

    def _documents(self) -> dict[int, list[int]]:
        """Rows that play the same document."""
        groups: dict[int, list[int]] = {}
        for i, row in enumerate(self._rows):
            if row.document is not None:
                groups.setdefault(id(row.document), []).append(i)
        return groups

    def step(self, observation: Observation) -> Command:
        """One tick of every row."""
        dt = observation.dt if self._tick else 0.0
        reached = ((observation.pose.position - self._home.position) * self._push).sum(-1)
        self._progress = np.minimum(self._progress + self._speed * dt, reached + self._limit)
        pushing = self._progress - reached >= 0.5 * self._limit
        position = self._home.position + self._progress[:, None] * self._push
        twist = np.concatenate([self._speed[:, None] * self._push, self._turning[:, None] * self._turn], axis=1)
        rotation, feedforward = self._home.rotation.copy(), np.zeros_like(twist)
        if len(self._turns):
            pushing[self._turns] |= self._turn_on(observation, dt, rotation)
        if len(self._spirals):
            position[self._spirals] += self._aside(float(observation.time.max()))
            pushing[self._spirals] = False
        self._play(position, rotation, twist, feedforward)
        self._tick += 1
        self._status[self._stall.look(observation, pushing) | self._still] = Status.SUCCESS
        return Command(
            Pose(position, rotation), twist, self._impedance, feedforward, self._status.copy(),
            no_reasons(len(self._rows)),
        )  # fmt: skip

    def _turn_on(self, observation: Observation, dt: float, rotation: Float) -> Any:
        at = self._turns
        axis, home = self._turn[at], self._home.rotation[at]
        wanted = self._turned[at] + self._turning[at] * dt
        desired = rotation_matrix(wanted[:, None] * axis) @ home
        error = rotation_vector(desired @ np.swapaxes(observation.pose.rotation[at], -1, -2))
        reached = wanted - (error * axis).sum(-1)
        self._turned[at] = np.minimum(wanted, reached + self._turn_limit[at])
        rotation[at] = rotation_matrix(self._turned[at][:, None] * axis) @ home
        return self._turned[at] - reached >= 0.5 * self._turn_limit[at]

    def _aside(self, time: float) -> Float:
        """An Archimedean spiral r = p a / 2 pi at constant speed: a^2 = 4 pi v t / p."""
        angle = np.sqrt(4.0 * np.pi * SPIRAL_SPEED * time / SPIRAL_M)
        radius = SPIRAL_M * angle / (2.0 * np.pi)
        return radius * (np.cos(angle) * self._spanned[:, 0] + np.sin(angle) * self._spanned[:, 1])

    def _play(self, position: Float, rotation: Float, twist: Float, feedforward: Float) -> None:
        """Put the played rows' commands in place, in a line between their samples, the rest held."""
        g, after = divmod(self._tick * 1e-3 / GRID + 1e-9, 1.0)
        for at, (commands, ends) in self._played:
            now = commands[min(int(g), len(commands) - 1)]
            following = commands[min(int(g) + 1, len(commands) - 1)]
            position[at] = now.pose.position + after * (following.pose.position - now.pose.position)
            rotation[at], twist[at], feedforward[at] = now.pose.rotation, now.twist, now.feedforward
            self._status[at[g >= ends]] = Status.SUCCESS
            if after < 1e-6 and (self._tick == 0 or now.impedance is not self._softened.get(int(at[0]))):
                self._softened[int(at[0])] = now.impedance
                self._soften(at, now.impedance.stiffness)

    def _soften(self, at: Any, stiffness: Float) -> None:
        """Follow played rows with the skill's stiffness, or with what the row has in its place."""
        changed = self._impedance.stiffness.copy()
        changed[at] = stiffness
        for i in at:
            own = self._rows[i].compliance
            changed[i] = changed[i] if own is None else own
        self._impedance = Impedance(changed)


def _played(row: Row, start: Observation) -> tuple[list[Command], Float]:
    """A skill's commands at every `GRID` from starts (n), and the sample (n,) at which each says that it has ended.

    The kinds that are played go by time and by where they began alone (their modules say so).
    """
    assert row.document is not None
    skill, n = registry().skill(row.document["type"]).build(row.document), len(start.time)
    skill.start(start, [np.random.default_rng(i) for i in range(n)])
    commands, ends = list[Command](), np.full(n, np.inf)
    for g in range(round(SAMPLED_S / GRID)):
        seen = start._replace(time=np.full(n, g * GRID), dt=GRID)
        commands.append(skill.step(seen))
        ends = np.where((commands[-1].status != Status.RUNNING) & np.isinf(ends), g, ends)
        if np.isfinite(ends).all():
            break
    return commands, ends


def push_along(direction: Float, turn: Float | None = None, like: Row | None = None) -> Row:
    """A null: its own push, and turn where it has one, free in all axes square to them."""
    given, stiffness = unit(np.asarray(direction, dtype=float)), np.zeros((6, 6))
    stiffness[:3, :3] = STIFF_N_M * np.outer(given, given)
    stiffness[3:, 3:] = STIFF_NM_RAD * np.eye(3)
    around = np.zeros(3) if turn is None else unit(np.asarray(turn, dtype=float))
    return replace(like or Row(), push=given, turn=around, stiffness=stiffness, turning=0.0 if turn is None else 0.087)
