"""Does a body of the robot stand in something?

Only tool and fixture push on each other, so a run could pass through a wall, a table or itself and succeed. Looking
every 10 ms, and when a trial ends, is what makes a failure of it. How far bodies are from that is measured ten times
less often. Between two measurements nothing can touch that has not moved so far, and is not looked at.

What is compared with what stands in `parts`, how deep two parts are is found by `probe`. The plant has no geoms of
links, so that looking changes no bit of a run.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float, norm, quaternion_from_matrix
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import RobotModel
from skillframe.robot.surroundings import collisions_note
from skillframe.world.parts import (
    BASE_LINK,
    HAND,
    HELD,
    HOME,
    LINK,
    OBSTACLE,
    STANDING,
    WORLD,
    Pair,
    Solid,
    any_left,
    left_out,
    near,
    robot_parts,
    scene_parts,
)
from skillframe.world.plant import Plant
from skillframe.world.probe import FAR, Overlap, Posture, Probe

_MOVERS = (LINK, HAND, HELD, BASE_LINK, STANDING, OBSTACLE)


class AtHome(NamedTuple):
    """What a robot's parts are to each other at home.

    Attributes:
        parts: its links and obstacles.
        skipped: why, by pair of indices, for every pair of them that is not looked at.
        overlaps: pairs that are looked at and stand in each other.
    """

    parts: list[Solid]
    skipped: dict[Pair, str]
    overlaps: list[Overlap]


class Touch(NamedTuple):
    """Two bodies that touched: which trial, their names, and how deep they were in each other [m] when it was seen."""

    row: int
    first: str
    second: str
    depth: float

    @property
    def cause(self) -> str:
        """In words: "link 'link5' is 79 mm inside the fixture"."""
        return f"{self.first} is {1000.0 * self.depth:.0f} mm inside {self.second}"


def at_home(robot: RobotModel) -> AtHome:
    """Which pairs of a robot's links are looked at, and which stand in each other at home."""
    parts = robot_parts(robot)
    skipped = left_out(robot, parts)
    probe = Probe(parts, skipped)
    position, quaternion = _home_frames(robot)
    joints = [parts[i].joint for i in probe.free]
    free = np.concatenate([position[joints], quaternion[joints]], axis=-1).ravel()
    found = probe.overlaps(free, np.zeros((0, 3)), np.zeros((0, 4)))
    drawn = [overlap for overlap in found if near(robot, parts, overlap.pair)]
    skipped |= {overlap.pair: HOME for overlap in drawn}
    return AtHome(parts, skipped, [overlap for overlap in found if overlap not in drawn])


def _home_frames(robot: RobotModel) -> tuple[Float, Float]:
    """Position (J, 3) and quaternion w, x, y, z (J, 4) of every joint's body at home, loops closed if they close."""
    home, data = robot.home, robot.model.createData()
    if robot.spec.loop:
        try:
            chain = ClosedChain(robot)
            home = chain.configuration(chain.minimal(robot.home))
        except SkillframeError:
            home = robot.home
    pin.forwardKinematics(robot.model, data, home)
    position = np.array([placement.translation for placement in data.oMi])
    quaternion = quaternion_from_matrix(np.array([placement.rotation for placement in data.oMi]))
    return position, quaternion[:, [3, 0, 1, 2]]


class Collisions:
    """Looks for bodies of a plant that stand in each other.

    Args:
        plant: its robot, its scene, and in each call its state.

    Attributes:
        enabled: whether anything is looked at; note: what a result has to say of that, "" if all is looked at.
        distance: (N,) the smallest that `measure` found between convex bodies that may not touch [m], at most `FAR`;
            NaN where nothing was looked at.
    """

    def __init__(self, plant: Plant) -> None:
        spec = plant.robot.spec
        self.enabled, self.note = spec.collisions.enabled, collisions_note(spec.name, spec.collisions)
        self.distance = np.full(plant.count, np.nan)
        if not self.enabled:
            return
        known = at_home(plant.robot)
        self._parts = [*known.parts, *scene_parts(plant.robot, plant.scene)]
        skipped = {**left_out(plant.robot, self._parts), **known.skipped}
        self.enabled = any_left(self._parts, skipped)
        self._probe = Probe(self._parts, skipped)
        self._free = self._bodies(plant, self._probe.free)
        self._posed = self._bodies(plant, self._probe.posed)
        self._moved = np.concatenate([self._free, self._posed])
        self._at = np.zeros((plant.count, len(self._moved), 3))
        self._turn = np.zeros((plant.count, len(self._moved), 4))

    def _bodies(self, plant: Plant, parts: list[int]) -> NDArray[np.int64]:
        names = (self._parts[i].body for i in parts)
        return np.array([0 if name == WORLD else plant.model.body(name).id for name in names], dtype=np.int64)

    def touches(self, plant: Plant, rows: NDArray[np.int64]) -> list[Touch]:
        """Of some trials those with a body in another, each with the deepest pair."""
        if not self.enabled or not len(rows):
            return []
        look, near = self._probe.overlaps, rows[~self._clear(plant, rows)]
        found = [(row, look(*posture)) for row, posture in self._postures(plant, near)]
        return [self._touch(row, overlaps[0]) for row, overlaps in found if overlaps]

    def measure(self, plant: Plant, rows: NDArray[np.int64]) -> None:
        """Bring `distance` of some trials up to date with where their bodies are now."""
        if not self.enabled:
            return
        looked = [*self._postures(plant, rows)]
        told, postures = [row for row, _ in looked], [posture for _, posture in looked]
        self.distance[told] = self._probe.distances(postures, np.fmin(self.distance[told], FAR))
        self._at[rows], self._turn[rows] = self._coordinates(plant, rows, self._moved)

    def _clear(self, plant: Plant, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some trials cannot touch, since no body came so far from where it was last measured.

        No point of a body moved further than its origin did, and its reach times the chord of its turn. Two bodies
        come nearer by twice the longest of these at most. `distance`, the smallest so far, is no more than the last
        was. Where shapes are left out of it, or it is NaN, nothing is clear.
        """
        at, turn = self._coordinates(plant, rows, self._moved)
        before, turned = (self._at, self._turn) if len(rows) == len(self._at) else (self._at[rows], self._turn[rows])
        shift = norm(at - before)
        chord = 2.0 * np.sqrt(np.maximum(1.0 - np.square(np.vecdot(turn, turned)), 0.0))
        furthest = (shift + self._probe.reach * chord).max(axis=-1, initial=0.0)
        return np.asarray(self._probe.bounded & (self.distance[rows] > 2.0 * furthest))

    @staticmethod
    def _coordinates(plant: Plant, rows: NDArray[np.int64], bodies: NDArray[np.int64]) -> tuple[Float, Float]:
        """Positions (n, B, 3) and quaternions (n, B, 4) of some bodies in some trials."""
        position, quaternion = plant.body_coordinates()
        if len(rows) < plant.count:
            position, quaternion = position[rows], quaternion[rows]
        return position.take(bodies, axis=1), quaternion.take(bodies, axis=1)

    def _postures(self, plant: Plant, rows: NDArray[np.int64]) -> Iterator[tuple[int, Posture]]:
        """Of some trials the row, and where its parts are, as the probe takes them."""
        if not len(rows):
            return
        free = np.concatenate(self._coordinates(plant, rows, self._free), axis=-1)
        free = free.reshape(len(rows), 7 * len(self._free))
        at, turn = self._coordinates(plant, rows, self._posed)
        finite = np.isfinite(free).all(axis=-1)  # a diverging trial is the limits' business
        for k in np.flatnonzero(finite):
            yield int(rows[k]), (free[k], at[k], turn[k])

    def _touch(self, row: int, overlap: Overlap) -> Touch:
        """What moves first, and what it is in second."""
        one, two = sorted((self._parts[i] for i in overlap.pair), key=lambda part: _MOVERS.index(part.role))
        return Touch(row, one.name, two.name, overlap.depth)
