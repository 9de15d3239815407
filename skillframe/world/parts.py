"""Parts of robot and scene, and the pairs that are checked for collisions.

| | link | fixture | obstacle | tool |
|---|---|---|---|---|
| link | checked | checked | checked | checked |
| tool | | may touch | checked | exempt |
Links are exempt if one joint separates them, if they share a closed loop, or if they touch at home with at most one
body between them. What an arm holds is exempt from its last two links.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from itertools import combinations
from typing import NamedTuple

from skillframe.frames import Float
from skillframe.robot.model import RobotModel
from skillframe.robot.tables import FIXTURE as FIXTURE_KEY
from skillframe.robot.tables import TOOL as TOOL_KEY
from skillframe.world.convert import FIXTURE, SPRUNG, TOOL, held
from skillframe.world.link_shapes import link_shapes
from skillframe.world.scene import Geom, Scene

WORLD = "universe"
LINK, BASE_LINK, HAND, HELD, STANDING, OBSTACLE = "link", "base link", "hand", "held", "standing", "obstacle"
"""Roles: moving and fixed links, what an arm holds, a standing fixture, obstacles."""
NEIGHBOURS, LOOP, HOLDS, HOME, IGNORED = "neighbours", "one loop", "holds it", "touch at home", "ignored"
"""Reasons for exempt pairs."""
Pair = tuple[int, int]


class Solid(NamedTuple):
    """Shapes that move together under one name.

    Attributes:
        name: for messages; key: in `[collisions] ignore`.
        body: of the plant; joint: index in Pinocchio, 0 if fixed.
        role: selects the parts to check against.
        shapes: with surface points (P, 3) if not convex.
    """

    name: str
    key: str
    body: str
    joint: int
    role: str
    shapes: tuple[tuple[Geom, Float | None], ...]
    guessed: bool = False


def robot_parts(robot: RobotModel) -> list[Solid]:
    """Links with a shape, and obstacles of robot.toml."""
    found: dict[str, Solid] = {}
    for shape in link_shapes(robot):
        joint = 0 if shape.body == WORLD else int(robot.model.getJointId(shape.body))
        role = HAND if shape.tool else LINK if joint else BASE_LINK
        empty = Solid(f"link {shape.link!r}", shape.link, shape.body, joint, role, (), shape.guessed)
        part = found.setdefault(shape.link, empty)
        found[shape.link] = part._replace(shapes=(*part.shapes, (shape.geom, shape.surface)))
    obstacles = obstacle_geoms(robot).items()
    return [
        *found.values(),
        *(Solid(f"the obstacle {name!r}", name, WORLD, 0, OBSTACLE, ((geom, None),)) for name, geom in obstacles),
    ]


def obstacle_geoms(robot: RobotModel) -> dict[str, Geom]:
    """Obstacles of robot.toml by name, in base."""
    found = {}
    for one in robot.spec.obstacle:
        size = tuple(0.5 * edge for edge in one.size) if one.kind == "box" else (0.0, 0.0, 0.1)  # infinite in MuJoCo
        found[one.name] = Geom(kind=one.kind, size=size, position=one.position, quaternion=one.orientation)
    return found


def scene_parts(robot: RobotModel, scene: Scene) -> list[Solid]:
    """Colliding parts of fixture and tool."""
    arms = [int(robot.model.frames[frame].parentJoint) for frame in robot.tool_frames]
    in_hand = held(robot, scene)
    groups = [(FIXTURE, scene.fixture), *((SPRUNG + part.name, part.geoms) for part in scene.sprung)]
    role, joint = (HELD, arms[1]) if in_hand else (STANDING, 0)
    found = [Solid("the fixture", FIXTURE_KEY, body, joint, role, _colliding(geoms)) for body, geoms in groups]
    found.append(Solid("the tool", TOOL_KEY, TOOL, arms[0], HAND, _colliding(scene.tool.geoms)))
    return [part for part in found if part.shapes]


def _colliding(geoms: Iterable[Geom]) -> tuple[tuple[Geom, None], ...]:
    return tuple((geom, None) for geom in geoms if geom.collide)


def left_out(robot: RobotModel, parts: Sequence[Solid]) -> dict[Pair, str]:
    """Exempt pairs (smaller index first), with reasons."""
    tree = _Tree(robot, {part.joint for part in parts})
    ignored = [{*pair} for pair in robot.spec.collisions.ignore]
    found: dict[Pair, str] = {}
    for (i, one), (k, two) in combinations(enumerate(parts), 2):
        if not compared(one.role, two.role):
            continue
        if why := IGNORED if {one.key, two.key} in ignored else tree.why(one, two):
            found[i, k] = why
    return found


def compared(one: str, two: str) -> bool:
    """Whether parts of two roles are checked."""
    bits, meets = zip(*(BITS[role] for role in (one, two)), strict=True)
    return bool(bits[0] & meets[1] or bits[1] & meets[0])


def any_left(parts: Sequence[Solid], skipped: Container[Pair]) -> bool:
    """Whether any pair is checked."""
    pairs = combinations(range(len(parts)), 2)
    return any(compared(parts[i].role, parts[k].role) and (i, k) not in skipped for i, k in pairs)


BITS = {LINK: (1, 3), BASE_LINK: (1, 1), HAND: (1, 2), HELD: (1, 2), STANDING: (1, 0), OBSTACLE: (2, 0)}
"""MuJoCo's contype and conaffinity by role."""


class _Tree:
    """Tree of the bodies that have a shape."""

    def __init__(self, robot: RobotModel, shaped: set[int]) -> None:
        self.parents, self.shaped = [int(joint) for joint in robot.model.parents], {0, *shaped}
        self.above = {joint.child: joint.parent for joint in robot.urdf.joints.values()}
        self.loops = list[set[int]]()
        for loop in robot.spec.loop:
            frames = (robot.model.frames[robot.model.getFrameId(name)] for name in (loop.frame_a, loop.frame_b))
            first, second = (self._up(int(frame.parentJoint)) for frame in frames)
            shared = next(joint for joint in first if joint in second)
            self.loops.append({*first[: first.index(shared)], *second[: second.index(shared)], shared})

    def _up(self, joint: int) -> list[int]:
        found = [joint]
        while found[-1]:
            found.append(self.parents[found[-1]])
        return found

    def carriers(self, joint: int) -> list[int]:
        """A body and its ancestors."""
        return [i for i in self._up(joint) if i in self.shaped]

    def apart(self, one: int, two: int) -> int:
        """Number of steps between two bodies."""
        first, second = self.carriers(one), self.carriers(two)
        shared = next(joint for joint in first if joint in second)
        return first.index(shared) + second.index(shared)

    def branches(self, one: Solid, two: Solid) -> int:
        """1 for a moving link and a fixed one that does not carry it, else 0."""
        if bool(one.joint) == bool(two.joint):
            return 0
        moves, stands = (one, two) if one.joint else (two, one)
        link = moves.key
        while link in self.above and link != stands.key:
            link = self.above[link]
        return int(link != stands.key)

    def why(self, one: Solid, two: Solid) -> str:
        """Reason why a pair is exempt, or ""."""
        if OBSTACLE in (one.role, two.role):
            return ""
        for part, other in ((one, two), (two, one)):
            if part.role in (HAND, HELD) and other.joint in self.carriers(part.joint)[:2]:
                return HOLDS
        if STANDING in (one.role, two.role):
            return ""
        apart = self.apart(one.joint, two.joint) + self.branches(one, two)
        if apart < 2 or (apart == 2 and (one.guessed or two.guessed)):
            return NEIGHBOURS
        return LOOP if any({one.joint, two.joint} <= loop for loop in self.loops) else ""


def near(robot: RobotModel, parts: Sequence[Solid], pair: Pair) -> bool:
    """Whether at most one body is between two links, so that their shapes may overlap."""
    one, two = (parts[i] for i in pair)
    links = all(part.role in (LINK, BASE_LINK, HAND) for part in (one, two))
    tree = _Tree(robot, {part.joint for part in parts})
    return links and tree.apart(one.joint, two.joint) + tree.branches(one, two) == 2
