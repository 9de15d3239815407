"""Collision checks of a robot's bodies.

Overlaps are checked every 10 ms and at the end of a trial, distances ten times less often. Bodies that moved less than
the last distance are skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float, dot, norm, quaternion_from_matrix
from skillframe.robot.chain import ClosedChain
from skillframe.robot.link_checks import Problem
from skillframe.robot.model import RobotModel
from skillframe.robot.tables import FIXTURE, Obstacle, collisions_note
from skillframe.world.link_shapes import odd_meshes
from skillframe.world.parts import (
    BASE_LINK,
    HAND,
    HELD,
    HOLDS,
    HOME,
    IGNORED,
    LINK,
    LOOP,
    NEIGHBOURS,
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
from skillframe.world.probe import FAR, TOLERANCE, Overlap, Posture, Probe

_MOVERS = (LINK, HAND, HELD, BASE_LINK, STANDING, OBSTACLE)


class AtHome(NamedTuple):
    """Relations of a robot's parts at home.

    Attributes:
        parts: links and obstacles.
        skipped: reason, by pair of indices, for every unchecked pair.
        overlaps: checked pairs that overlap.
    """

    parts: list[Solid]
    skipped: dict[Pair, str]
    overlaps: list[Overlap]


class Touch(NamedTuple):
    """Two bodies that touched: row of the trial, names, and depth [m]."""

    row: int
    first: str
    second: str
    depth: float

    @property
    def cause(self) -> str:
        """Text such as "link 'link5' is 79 mm inside the fixture"."""
        return f"{self.first} is {1000.0 * self.depth:.{1 if self.depth < 0.001 else 0}f} mm inside {self.second}"


def at_home(robot: RobotModel) -> AtHome:
    """Checked pairs of a robot's links, and overlaps at home."""
    parts = robot_parts(robot)
    skipped = left_out(robot, parts)
    probe = Probe(parts, skipped)
    home, data = robot.home, robot.model.createData()
    if robot.spec.machine:
        try:
            home = ClosedChain(robot).home
        except SkillframeError:
            home = robot.home
    pin.forwardKinematics(robot.model, data, home)
    position = np.array([placement.translation for placement in data.oMi])
    quaternion = quaternion_from_matrix(np.array([placement.rotation for placement in data.oMi]))
    quaternion = quaternion[:, [3, 0, 1, 2]]
    joints = [parts[i].joint for i in probe.free]
    free = np.concatenate([position[joints], quaternion[joints]], axis=-1).ravel()
    found = probe.overlaps(free, np.zeros((0, 3)), np.zeros((0, 4)))
    drawn = [overlap for overlap in found if near(robot, parts, overlap.pair)]
    skipped |= {overlap.pair: HOME for overlap in drawn}
    return AtHome(parts, skipped, [overlap for overlap in found if overlap not in drawn])


class Collisions:
    """Checks for overlapping bodies of a plant.

    Attributes:
        enabled: there are pairs to check; note: for results, "" if all are checked.
        distance: (N,) last smallest distance of convex bodies that may not touch [m], at most `FAR`; NaN before.
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

    def touches(self, plant: Plant, rows: NDArray[np.int64], of_fixture: float = TOLERANCE) -> list[Touch]:
        """Deepest overlap of each trial of `rows`, above `of_fixture` [m], or `TOLERANCE` without a fixture."""
        if not self.enabled or not len(rows):
            return []
        near = rows[~self._clear(plant, rows)]
        result = []
        for row, posture in self._postures(plant, near):
            for overlap in self._probe.overlaps(*posture, of_fixture):
                parts = [self._parts[i] for i in overlap.pair]
                if overlap.depth > TOLERANCE or any(part.key == FIXTURE for part in parts):
                    one, two = sorted(parts, key=lambda part: _MOVERS.index(part.role))
                    result.append(Touch(row, one.name, two.name, overlap.depth))
                    break
        return result

    def measure(self, plant: Plant, rows: NDArray[np.int64]) -> None:
        """Update `distance` of some trials."""
        if not self.enabled:
            return
        looked = [*self._postures(plant, rows)]
        told, postures = [row for row, _ in looked], [posture for _, posture in looked]
        self.distance[told] = self._probe.distances(postures, np.fmin(self.distance[told], FAR))
        self._at[rows], self._turn[rows] = self._coordinates(plant, rows, self._moved)

    def _clear(self, plant: Plant, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Trials in which no body moved far enough since the last measurement to touch.

        No point moves farther than its body's origin, plus reach times the chord of the rotation, and two bodies
        approach by twice that.
        """
        at, turn = self._coordinates(plant, rows, self._moved)
        before, turned = (self._at, self._turn) if len(rows) == len(self._at) else (self._at[rows], self._turn[rows])
        shift = norm(at - before)
        chord = 2.0 * np.sqrt(np.maximum(1.0 - np.square(dot(turn, turned)), 0.0))
        furthest = (shift + self._probe.reach * chord).max(axis=-1, initial=0.0)
        return np.asarray(self._probe.bounded & (self.distance[rows] > 2.0 * furthest))

    @staticmethod
    def _coordinates(plant: Plant, rows: NDArray[np.int64], bodies: NDArray[np.int64]) -> tuple[Float, Float]:
        position, quaternion = plant.body_coordinates()
        if len(rows) < plant.count:
            position, quaternion = position[rows], quaternion[rows]
        return position.take(bodies, axis=1), quaternion.take(bodies, axis=1)

    def _postures(self, plant: Plant, rows: NDArray[np.int64]) -> Iterator[tuple[int, Posture]]:
        if not len(rows):
            return
        free = np.concatenate(self._coordinates(plant, rows, self._free), axis=-1)
        free = free.reshape(len(rows), 7 * len(self._free))
        at, turn = self._coordinates(plant, rows, self._posed)
        finite = np.isfinite(free).all(axis=-1)
        for k in np.flatnonzero(finite):
            yield int(rows[k]), (free[k], at[k], turn[k])


_ORDER = (NEIGHBOURS, LOOP, HOME, HOLDS, IGNORED)
_WORDS = {
    NEIGHBOURS: "neighbours", LOOP: "in one closed loop", HOME: "overlapping at home",
    HOLDS: "the last two links and what the arm holds", IGNORED: "by [collisions] ignore",
}  # fmt: skip


def collision_lines(robot: RobotModel) -> list[str]:
    """Obstacles, checked pairs and contacts at home, as lines."""
    lines = [f"  obstacle {one.name!r}: {_obstacle(one)}" for one in robot.spec.obstacle]
    if not robot.spec.collisions.enabled:
        return ["", *lines, "  collisions: not checked ([collisions] enabled is false)"]
    known = at_home(robot)
    links = sum(1 for part in known.parts if part.joint)
    lines.append(f"  collisions: {links} moving links end a run that touch fixture, obstacle or each other, but for")
    for reason, pairs in _by_reason(known).items():
        lines.append(f"    {_WORDS[reason]}: " + ", ".join(f"{one}-{two}" for one, two in pairs))
    lines += [f"  at home {text}" for text in _touching(known)]
    return ["", *lines]


def collision_values(robot: RobotModel) -> dict[str, Any]:
    """The same for scripts."""
    known = at_home(robot) if robot.spec.collisions.enabled else AtHome([], {}, [])
    return {
        "enabled": robot.spec.collisions.enabled,
        "obstacles": [one.name for one in robot.spec.obstacle],
        "not_looked_at": {reason: [list(pair) for pair in pairs] for reason, pairs in _by_reason(known).items()},
        "touching_at_home": [
            {"between": [known.parts[i].key for i in overlap.pair], "depth_m": overlap.depth}
            for overlap in known.overlaps
        ],
    }


def collision_problems(robot: RobotModel) -> Iterator[Problem]:
    """Meshes that collide differently than drawn, and bodies that overlap at home."""
    if not robot.spec.collisions.enabled:
        return
    for odd in odd_meshes(robot):
        yield Problem(code=odd.code, severity="warning", where=odd.link, message=odd.message, fix=odd.fix)
    known = at_home(robot)
    for overlap, text in zip(known.overlaps, _touching(known), strict=True):
        one, two = (known.parts[i].key for i in overlap.pair)
        fix = f'choose another [home], correct the shapes, or write ignore = [["{one}", "{two}"]] under [collisions]'
        yield Problem(code="home_collision", severity="warning", where=one, message=f"at home {text}", fix=fix)


def _touching(known: AtHome) -> list[str]:
    texts = []
    for (i, k), depth in known.overlaps:
        texts.append(f"{known.parts[i].name} is {1000.0 * depth:.0f} mm inside {known.parts[k].name}")
    return texts


def _by_reason(known: AtHome) -> dict[str, list[tuple[str, str]]]:
    found: dict[str, list[tuple[str, str]]] = {reason: [] for reason in _ORDER}
    for (i, k), reason in sorted(known.skipped.items()):
        if known.parts[i].joint or known.parts[k].joint:
            found[reason].append((known.parts[i].key, known.parts[k].key))
    return {reason: pairs for reason, pairs in found.items() if pairs}


def _obstacle(one: Obstacle) -> str:
    place = ", ".join(f"{x:g}" for x in one.position)
    size = f" of {' x '.join(f'{x:g}' for x in one.size)} m" if one.kind == "box" else ""
    return f"{one.kind}{size} at ({place}) m"
