"""Straight pushes and replays, one a row, so that all methods of a table run in one simulation; and the nulls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from skillframe_lmc.intervals import track, translation
from skillframe_lmc.phase import Stop
from skillframe_lmc.sectors import sectors
from skillframe_lmc.settings import Settings
from skillframe_lmc.stall import StallWatch

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, Pose, unit
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons

STIFF_N_M, STIFF_NM_RAD, BLEND_S = 1000.0, 20.0, 1.0


class Row(NamedTuple):
    """One trial: a push as LMC runs it, or a replay along `path`.

    Attributes:
        direction: (3,) of the push; zero holds still.
        stiffness: (3, 3) of the translation.
        speed: [m/s]; lead: largest push [N].
        path: (T, 3) of the tip, a sample each millisecond; None for a push.
    """

    direction: Float
    stiffness: Float
    speed: float = 0.02
    lead: float = 20.0
    path: Float | None = None


class Rows(Skill):
    """Runs a row of `Row` each. A push is as in `skillframe_lmc.runtime`, without its limits of time and travel."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows = rows

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin where the tools are."""
        n = len(self._rows)
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._direction = np.array([row.direction for row in self._rows])
        self._speed = np.array([row.speed for row in self._rows])
        stiffness = np.zeros((n, 6, 6))
        stiffness[:, :3, :3] = [row.stiffness for row in self._rows]
        stiffness[:, 3:, 3:] = STIFF_NM_RAD * np.eye(3)
        self._impedance = Impedance(stiffness)
        along = np.einsum("ni,nij,nj->n", self._direction, stiffness[:, :3, :3], self._direction)
        self._limit = np.array([row.lead for row in self._rows]) / np.where(along > 0.0, along, 1e-9)
        self._progress, self._stall = np.zeros(n), StallWatch(Stop())
        self._replays = [i for i, row in enumerate(self._rows) if row.path is not None]
        self._status, self._tick = np.zeros(n, dtype=np.int64), 0

    def step(self, observation: Observation) -> Command:
        """One tick of every row."""
        reached = ((observation.pose.position - self._home.position) * self._direction).sum(-1)
        dt = observation.dt if self._tick else 0.0
        self._progress = np.minimum(self._progress + self._speed * dt, reached + self._limit)
        pushing = self._progress - reached >= 0.5 * self._limit
        position = self._home.position + self._progress[:, None] * self._direction
        twist = np.zeros((len(self._rows), 6))
        twist[:, :3] = self._speed[:, None] * self._direction
        for i in self._replays:
            path = self._rows[i].path
            assert path is not None
            pushing[i] = self._tick >= len(path)
            left = max(0.0, 1.0 - observation.time[i] / BLEND_S)
            position[i] = path[min(self._tick, len(path) - 1)] + left * (self._home.position[i] - path[0])
        self._tick += 1
        ended = self._stall.look(observation, pushing)
        self._status[ended] = Status.SUCCESS
        n = len(self._rows)
        pose = Pose(position, self._home.rotation)
        return Command(pose, twist, self._impedance, np.zeros((n, 6)), self._status.copy(), no_reasons(n))


def push_along(direction: Float, like: Row) -> Row:
    """A null: its own push, free in all axes square to it, as fast and as hard as LMC's."""
    given = unit(np.asarray(direction, dtype=float))
    return like._replace(direction=given, stiffness=STIFF_N_M * np.outer(given, given))


def replay(demonstration: Demonstration) -> Row:
    """The first demonstration's path of the tip, stiff in all axes."""
    tip = np.array(demonstration.meta["frames"]["tip"])
    at = demonstration.position + np.einsum("nij,j->ni", _rotations(demonstration), tip)
    clock = np.arange(0.0, demonstration.duration, 1e-3) + demonstration.time[0]
    path = np.column_stack([np.interp(clock, demonstration.time, at[:, i]) for i in range(3)])
    return Row(np.zeros(3), STIFF_N_M * np.eye(3), path=path)


def averages(demonstrations: Sequence[Demonstration]) -> dict[str, Float]:
    """Pushes that are averages of what was shown: motion, chord, minus contact force, and the first and third's."""
    motions = []
    for demonstration in demonstrations:
        tip = np.array(demonstration.meta["frames"]["tip"])
        motions.append(translation(track(demonstration, tip, tip, "base"), Settings()))
    given = [sectors(motion) for motion in motions]
    motion = unit(np.concatenate([g.motion for g in given]).mean(axis=0))
    force = unit(-np.concatenate([m.load[g.contact] for m, g in zip(motions, given, strict=True)]).mean(axis=0))
    chord = unit(np.array([unit(m.displacement.sum(axis=0)) for m in motions]).mean(axis=0))
    return {"motion": motion, "chord": chord, "force": force, "bisector": unit(motion + force)}


def _rotations(demonstration: Demonstration) -> Float:
    from skillframe.frames import matrix_from_quaternion

    return matrix_from_quaternion(demonstration.quaternion)
