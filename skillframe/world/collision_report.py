"""Which bodies of a robot are looked at and which are not, for `robots show`, and what `robots check` says of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from skillframe.robot.model import RobotModel
from skillframe.robot.problems import Problem
from skillframe.robot.surroundings import Obstacle
from skillframe.world.collisions import AtHome, at_home
from skillframe.world.link_shapes import odd_meshes
from skillframe.world.parts import HOLDS, HOME, IGNORED, LOOP, NEIGHBOURS

_ORDER = (NEIGHBOURS, LOOP, HOME, HOLDS, IGNORED)
_WORDS = {
    NEIGHBOURS: "neighbours", LOOP: "in one closed loop", HOME: "overlapping at home",
    HOLDS: "the last two links and what the arm holds", IGNORED: "by [collisions] ignore",
}  # fmt: skip


def collision_lines(robot: RobotModel) -> list[str]:
    """What touches what, in lines for people."""
    lines = [f"  obstacle {one.name!r}: {_obstacle(one)}" for one in robot.spec.obstacle]
    if not robot.spec.collisions.enabled:
        return ["", *lines, "  collisions: not looked at ([collisions] enabled is false)"]
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
    """Meshes that count otherwise than they are drawn, and bodies that stand in each other at home."""
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
    """Pairs that are not looked at by why, in the order of the robot."""
    found: dict[str, list[tuple[str, str]]] = {reason: [] for reason in _ORDER}
    for (i, k), reason in sorted(known.skipped.items()):
        if known.parts[i].joint or known.parts[k].joint:  # two that stand still never meet
            found[reason].append((known.parts[i].key, known.parts[k].key))
    return {reason: pairs for reason, pairs in found.items() if pairs}


def _obstacle(one: Obstacle) -> str:
    place = ", ".join(f"{x:g}" for x in one.position)
    size = f" of {' x '.join(f'{x:g}' for x in one.size)} m" if one.kind == "box" else ""
    return f"{one.kind}{size} at ({place}) m"
