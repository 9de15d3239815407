"""What robot.toml says of bodies that may not touch: what stands around the robot, and pairs that are not looked at."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from skillframe.robot.numbers import LARGEST

FIXTURE, TOOL = "fixture", "tool"
"""Names, beside those of links and obstacles, that a pair of `[collisions] ignore` can hold."""
_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredCollisions:
    """Whether bodies that touch end a trial.

    Attributes:
        enabled: False looks at no pair of bodies.
        ignore: pairs that may touch, each of two names: links, obstacles, "fixture", "tool".
    """

    enabled: bool = True
    ignore: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """Something that stands still around the robot: a table, a floor, a wall. Nothing may touch it.

    Attributes:
        name: one of its own.
        kind: "box", or "plane", all below which counts as inside.
        size: edges of a box along its axes [m].
        position: in base [m], the middle of a box, a point of a plane.
        attitude: quaternion x, y, z, w; a plane's normal is its z axis.
    """

    name: str
    kind: Literal["box", "plane"] = "box"
    size: tuple[float, float, float] = _ZERO
    position: tuple[float, float, float] = _ZERO
    attitude: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


def unfit_obstacles(obstacles: Sequence[Obstacle]) -> Iterator[tuple[str, str, str]]:
    """What the types allow and no obstacle has: key, what is wrong with it, and the cure."""
    seen = {FIXTURE, TOOL}
    for obstacle in obstacles:
        key = f"obstacle {obstacle.name!r}"
        if not obstacle.name or obstacle.name in seen:
            why = "has no name" if not obstacle.name else "has a name that is taken"
            yield "obstacle", f"{obstacle.name!r} {why}", "give each a name of its own, not 'fixture' or 'tool'"
        seen.add(obstacle.name)
        if not all(abs(x) <= LARGEST for x in (*obstacle.position, *obstacle.size)):
            yield key, "is beyond any physical size", "give metres in base"
        elif obstacle.kind == "box" and not min(obstacle.size) > 0.0:
            yield f"{key}: size", f"is {list(obstacle.size)}", "give a box three positive edges in metres"
        elif obstacle.kind == "plane" and any(obstacle.size):
            yield f"{key}: size", "is given, and a plane has no end", 'leave it out, or say kind = "box"'
        if abs(math.hypot(*obstacle.attitude) - 1.0) > 0.01:
            size = f"has the length {math.hypot(*obstacle.attitude):g}, not 1"
            yield f"{key}: attitude", size, "give a unit quaternion, x, y, z, w"


def collisions_note(robot: str, collisions: DeclaredCollisions) -> str:
    """What every result of a robot has to say of bodies that nobody looked at, or "" if there are none."""
    if not collisions.enabled:
        return f"bodies that touch did not end a trial: [collisions] enabled is false in robot.toml of {robot}"
    if not collisions.ignore:
        return ""
    pairs = ", ".join(f"{one} with {two}" for one, two in collisions.ignore)
    return f"bodies that could touch without ending a trial, by [collisions] ignore of {robot}: {pairs}"
