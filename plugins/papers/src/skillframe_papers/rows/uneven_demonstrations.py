r"""Rows 3 and 5: LMC learned from uneven demonstrations with an error of aim.

Row 3: a valley of slopes a (steep) and b (flat) with friction angles phi_a and phi_b. A push in its plane, tilted by t
from its -z towards the steep side, slides down both slopes iff

    phi_b - b < t < a - phi_a

(statics; row 2 runs it), and b < phi_b, so that -z itself is no such push. Row 5: a peg. The fixture is turned at
random, two of three demonstrations come from one side, and the teacher's aim is off by one angle in all three, and
wavers. In a valley, minus the mean force always lies between the limits, so that null fails only by noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import atan, radians, tan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skillframe_teaching.sessions import record
from skillframe_worlds.valley import ValleyParams

from skillframe.demonstration import Demonstration
from skillframe.execution import load_robot_model, load_world
from skillframe.extend import Document, RowResult, RowRun
from skillframe.frames import Float, norm, quaternion_from_matrix, rotation_matrix, unit
from skillframe.robot import RobotModel
from skillframe.world import Scene, State, slope
from skillframe_papers.rows import nulls
from skillframe_papers.rows.harness import DOWN, Ran, X, Y, compared, lmc, not_behind, one_axis, teacher, world
from skillframe_papers.rows.lmc import REDRAWN, pictures


class Set(NamedTuple):
    """Demonstrations of one fixture, its orientation in base (3, 3), repeated ones, and the learned document."""

    demonstrations: list[Demonstration]
    turn: Float
    redrawn: int
    document: Document

    @property
    def parts(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Translation and rotation."""
        phase = self.document["phases"][0]
        return phase["translation"], phase["rotation"]

    def seen(self, direction: Any) -> Float | None:
        """A direction in the fixture's axes."""
        return None if direction is None else np.array(direction) @ self.turn


class Valley(NamedTuple):
    """Slopes [rad], the friction of each, and the steep one's side (+1: +x)."""

    steep: float
    flat: float
    rough_steep: float
    rough_flat: float
    side: float

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of a push that slides down both, as a tilt towards the steep side [rad]."""
        return atan(self.rough_flat) - self.flat, self.steep - atan(self.rough_steep)

    def allows(self, push: Float) -> bool:
        """Whether a push (3,) in the fixture's axes slides down both slopes and not along them."""
        low, high = self.limits
        tilt = float(np.arctan2(self.side * push[0], -push[2]))
        sideways = abs(float(push[1])) / float(norm(push))
        return bool(low < tilt < high and sideways < np.sin(atan(min(self.rough_steep, self.rough_flat))))


def _turned(rng: np.random.Generator) -> tuple[RobotModel, Float]:
    """The free tool with fixture and starts turned at random by up to 60 degrees."""
    robot = load_robot_model("free_tool")
    turn = rotation_matrix(unit(rng.standard_normal(3)) * rng.uniform(0.0, radians(60.0)))
    x, y, z, w = quaternion_from_matrix(turn)
    place = replace(robot.spec.workspace, orientation=(float(x), float(y), float(z), float(w)))
    return replace(robot, spec=replace(robot.spec, workspace=place)), turn


def aimed(scene: Scene, direction: Float, starts: Sequence[dict[str, float]]) -> Scene:
    """The scene with a teacher who believes in another direction (3,) of the fixture, from some starts."""
    x, y, z = (float(value) for value in direction)
    return replace(scene, task=replace(scene.task, direction=(x, y, z), starts=tuple(starts)))


def _off(job: RowRun, rng: np.random.Generator) -> float:
    """Error of aim, always to the same side [rad]."""
    return float(radians(float(job.settings["teacher.bias_deg"])) * rng.choice([-1.0, 1.0]))


def valley_scene(valley: Valley) -> Scene:
    """The shipped valley with other slopes, the ball 4 mm above its first slope."""
    right, left = (valley.steep, valley.flat) if valley.side > 0.0 else (valley.flat, valley.steep)
    radius = ValleyParams().radius
    up = np.array([[-np.sin(right), np.cos(right)], [np.sin(left), np.cos(left)]])
    rest = radius * up.sum(axis=0) / (1.0 + up[0] @ up[1])  # touches both planes

    def lift(offset: Float, tilt: Float) -> Float:
        x = offset[..., 0] + rest[0]
        high = np.maximum(x * tan(right) + radius / np.cos(right), -x * tan(left) + radius / np.cos(left))
        above: Float = np.maximum(high, rest[1]) - rest[1]
        return above

    def there(state: State) -> NDArray[np.bool_]:
        close: NDArray[np.bool_] = norm(state.tip.position[..., [0, 2]] - rest) < ValleyParams().tolerance
        return close

    plates = (slope(right, 0.0, 0.12, 0.16), slope(left, np.pi, 0.12, 0.16))  # 120 mm long, 160 mm wide
    return replace(
        load_world("valley", {}), fixture=plates, start_tip=(float(rest[0]), 0.0, float(rest[1] + 0.004)),
        start_lift=lift, goal=there,
    )  # fmt: skip


def _valley_set(job: RowRun, index: int) -> tuple[Set, Valley]:
    rng = np.random.default_rng([61_000 + job.seed, index])
    steep, flat = radians(rng.uniform(62.0, 68.0)), radians(rng.uniform(4.0, 8.0))
    valley = Valley(steep, flat, rng.uniform(0.05, 0.12), rng.uniform(0.2, 0.25), float(rng.choice([-1.0, 1.0])))
    robot, turn = _turned(rng)
    aim = 0.5 * sum(valley.limits) + _off(job, rng)
    direction = np.array([valley.side * np.sin(aim), 0.0, -np.cos(aim)])
    ways = rng.uniform([0.015, 0.015, 0.004], [0.025, 0.025, 0.008])
    most = rng.choice([-1.0, 1.0])  # the side, +1 steep, from which two of the three come
    found, redrawn = list[Demonstration](), 0
    for side, chosen in ((most, ways[:2]), (-most, ways[2:])):
        level = np.cos(valley.steep if side > 0.0 else valley.flat)
        starts = tuple({"start.offset_x": float(side * valley.side * way * level)} for way in chosen)
        scene = aimed(valley_scene(valley), direction, starts)
        friction = valley.rough_steep if side > 0.0 else valley.rough_flat
        seed = 61_000 + 1000 * job.seed + 2 * index + int(side > 0.0)
        given = {"world.friction": friction}
        shown = record(robot, scene, teacher(job), count=len(chosen), seed=seed, draws=given, duration_s=20.0)
        found, redrawn = [*found, *shown.demonstrations], redrawn + len(shown.rejected)
    return Set(found, turn, redrawn, lmc(found)), valley


def noise(job: RowRun) -> RowResult:
    """Row 3: sets of uneven demonstrations that give a feasible direction."""
    given = [_valley_set(job, i) for i in range(job.count(20, 4))]
    sets, allowed = [each for each, _ in given], [valley.allows for _, valley in given]
    ours = Ran(np.array([_right(each, allows) for each, allows in zip(sets, allowed, strict=True)]))
    across = Ran(np.array([_one_axis(each, 0, X) for each in sets]))
    others = _nulls(sets, allowed)
    others["by hand: the fixture's -z"] = Ran(np.array([allows(DOWN) for allows in allowed]))
    level_with, told = _beside(job, ours, others)
    return RowResult(
        ours=f"feasible in {ours} sets of three. {_short(others)}",
        verdict=compared(job, [ours], not {"mean motion", nulls.BY_HAND} & set(level_with)),
        values={"feasible_share": ours.share}, head=("push", "feasible in"),
        rows=[("LMC", str(ours)), *((name, str(each)) for name, each in others.items()),
              ("LMC: one axis, across the valley", str(across)), _redrawn(sets)],
        pictures=pictures(sets[0].document),
        difference=f"{told} In a valley minus the mean force lies between the limits for whatever shares, and so does "
        "the bisector of both nearly always: no valley separates the intersection from these.",
    )  # fmt: skip


def _right(each: Set, allows: Callable[[Float], bool]) -> bool:
    push = each.seen(each.parts[0]["desired_direction"])
    return push is not None and allows(push)


def _one_axis(each: Set, part: int, axis: Float) -> bool:
    """Whether there is exactly one compliant axis, within 20 degrees of the fixture's."""
    return one_axis({"compliant_axes": [each.seen(a) for a in each.parts[part]["compliant_axes"]]}, axis)


def _nulls(sets: Sequence[Set], allowed: Sequence[Callable[[Float], bool]]) -> dict[str, Ran]:
    """Sets in which each null's push is right."""
    pushes = [{n: push @ each.turn for n, push in nulls.pushes(each.demonstrations).items()} for each in sets]
    return {
        name: Ran(np.array([ok(each[name]) for each, ok in zip(pushes, allowed, strict=True)])) for name in pushes[0]
    }


def _beside(job: RowRun, ours: Ran, others: Mapping[str, Ran]) -> tuple[list[str], str]:
    """Nulls that ours is not ahead of, and a sentence with all of them."""
    level_with = not_behind(job, ours, others)
    behind = ", ".join(name for name in others if name not in level_with) or "none"
    told = ", ".join(f"{name} {each}" for name, each in others.items())
    return level_with, f"Nulls: {told}. Behind by their intervals: {behind}."


def _short(others: Mapping[str, Ran]) -> str:
    return "Nulls: " + ", ".join(f"{name} {each.hits}" for name, each in others.items())


def _redrawn(sets: Sequence[Set]) -> tuple[str, str]:
    return REDRAWN, str(sum(each.redrawn for each in sets))


def _peg_set(job: RowRun, index: int) -> Set:
    rng = np.random.default_rng([62_000 + job.seed, index])
    robot, turn = _turned(rng)
    off = _off(job, rng)
    most = float(rng.choice([-1.0, 1.0]))
    tilts = np.radians([*rng.uniform(5.0, 8.0, 2), -rng.uniform(3.0, 8.0)]) * most
    starts = tuple({"start.tilt_y": float(tilt)} for tilt in tilts)
    scene = aimed(world(job, "peg_in_hole"), np.array([np.sin(off), 0.0, -np.cos(off)]), starts)
    shown = record(robot, scene, teacher(job), count=3, seed=62_000 + 1000 * job.seed + index, duration_s=20.0)
    return Set(shown.demonstrations, turn, len(shown.rejected), lmc(shown.demonstrations))


def _near_the_hole(push: Float) -> bool:
    return bool(np.dot(push, DOWN) > np.cos(radians(10.0)))


def peg(job: RowRun) -> RowResult:
    """Row 5: what is learned for the peg."""
    sets = [_peg_set(job, i) for i in range(job.count(20, 2))]
    turns = [each.parts[1] for each in sets]
    facts = {
        "push within 10 degrees of the hole's axis": [_right(s, _near_the_hole) for s in sets],
        "no direction of turning": [t["desired_direction"] is None and not t["fully_compliant"] for t in turns],
        "one axis, along x": [_one_axis(s, 0, X) for s in sets],
        "one axis of turning, about y": [_one_axis(s, 1, Y) for s in sets],
    }
    shares = {text: Ran(np.array(values)) for text, values in facts.items()}
    push, identical = next(iter(shares.values())), Ran(np.all(list(facts.values()), axis=0))
    others = _nulls(sets, [_near_the_hole] * len(sets))
    level_with, told = _beside(job, push, others)
    return RowResult(
        ours=f"identical in {identical} sets of three, the push alone right in {push.hits}. " + _short(others),
        verdict=compared(job, [identical], nulls.BY_HAND not in level_with), pictures=pictures(sets[0].document),
        head=("", "ours"),
        rows=[*((text, str(each)) for text, each in shares.items()),
              *((f"push of the null: {name}", str(each)) for name, each in others.items()), _redrawn(sets)],
        difference=f"{told} Nulls have a push and no axes. Whoever knows the hole's axis needs no demonstration for "
        "the push.",
        values={"identical_share": identical.share},
    )  # fmt: skip
