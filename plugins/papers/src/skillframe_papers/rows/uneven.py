r"""Rows 3 and 5 of the papers' results: what LMC learns from uneven demonstrations by somebody who aims wrong.

Row 3: a valley of two slopes a (steep) and b (flat) with friction angles phi_a and phi_b. A push in the valley's plane
tilted by t from its -z towards the steep side slides down both slopes iff

    phi_b - b < t < a - phi_a

(statics of Coulomb friction; row 2 runs it), and b < phi_b, so that the valley's own -z is no such push. Row 5: a peg.
The whole fixture is turned at random in space, two of three demonstrations come from one side (in the valley from
farther away, too), and the person aims off the middle by the same angle in all three, and wavers. All of this is our
choice. Of a valley theory says that minus the mean force always lies between the limits, so that this null cannot fail
but by noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import atan, radians, tan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float, norm, quaternion_from_matrix, rotation_matrix, unit
from skillframe.robot.model import RobotModel
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.scene import Scene, State
from skillframe.world.shapes import slope
from skillframe.world.worlds.valley import ValleyParams
from skillframe_papers.bars import counted, judged, together
from skillframe_papers.rows import nulls
from skillframe_papers.rows.lmc import REDRAWN, pictures

SETS, QUICK_SETS = 20, 4
VALLEY_SEED, PEG_SEED = 61_000, 62_000
SHARE = 0.9
WITHIN_DEG, AXIS_DEG = 10.0, 20.0
MOST_TURN = radians(60.0)
LENGTH, WIDTH = 0.12, 0.16
X, Y, DOWN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])


class Set(NamedTuple):
    """Demonstrations of one fixture, how it is turned in base (3, 3), how many were redrawn, what was learned."""

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
    """Slopes [rad], the friction of each, and on which side of the fixture the steep one is (+1: +x)."""

    steep: float
    flat: float
    rough_steep: float
    rough_flat: float
    side: float

    @property
    def limits(self) -> tuple[float, float]:
        """Of a push that slides down both, as a tilt towards the steep side [rad]."""
        return atan(self.rough_flat) - self.flat, self.steep - atan(self.rough_steep)

    def allows(self, push: Float) -> bool:
        """Whether a push (3,) in the fixture's axes slides down both slopes and not along them."""
        low, high = self.limits
        tilt = float(np.arctan2(self.side * push[0], -push[2]))
        sideways = abs(float(push[1])) / float(norm(push))
        return bool(low < tilt < high and sideways < np.sin(atan(min(self.rough_steep, self.rough_flat))))


def _turned(rng: np.random.Generator) -> tuple[RobotModel, Float]:
    """The free tool with the whole fixture, and so every start, turned at random by up to 60 degrees."""
    robot = load_robot_model("free_tool")
    turn = rotation_matrix(unit(rng.standard_normal(3)) * rng.uniform(0.0, MOST_TURN))
    x, y, z, w = quaternion_from_matrix(turn)
    place = replace(robot.spec.workspace, attitude=(float(x), float(y), float(z), float(w)))
    return replace(robot, spec=replace(robot.spec, workspace=place)), turn


def aimed(scene: Scene, direction: Float, starts: Sequence[dict[str, float]]) -> Scene:
    """The scene with a person who believes in another direction (3,) of the fixture, from some starts."""
    x, y, z = (float(value) for value in direction)
    return replace(scene, task=replace(scene.task, direction=(x, y, z), starts=tuple(starts)))


def _off(job: RowRun, rng: np.random.Generator) -> float:
    """How far somebody aims wrong, always to the same side [rad]."""
    return float(radians(float(job.settings["teacher.bias_deg"])) * rng.choice([-1.0, 1.0]))


def _person(job: RowRun) -> TeacherSettings:
    return TeacherSettings(aim_noise=radians(float(job.settings["teacher.aim_noise_deg"])))


def _learn(demonstrations: Sequence[Demonstration]) -> Document:
    return learned(registry().skill("lmc"), list(demonstrations), LearnOptions())


def valley_scene(valley: Valley) -> Scene:
    """The shipped valley with two slopes of its own. The ball starts 4 mm above the slope it is over."""
    right, left = (valley.steep, valley.flat) if valley.side > 0.0 else (valley.flat, valley.steep)
    radius = ValleyParams().radius
    up = np.array([[-np.sin(right), np.cos(right)], [np.sin(left), np.cos(left)]])
    rest = radius * up.sum(axis=0) / (1.0 + up[0] @ up[1])  # touches both planes

    def lift(offset: Float, tilt: Float) -> Float:
        x = offset[..., 0] + rest[0]
        high = np.where(x > 0.0, x * tan(right), -x * tan(left)) + radius / np.cos(np.where(x > 0.0, right, left))
        above: Float = np.maximum(high, rest[1]) - rest[1]
        return above

    def there(state: State) -> NDArray[np.bool_]:
        close: NDArray[np.bool_] = norm(state.tip.position[..., [0, 2]] - rest) < ValleyParams().tolerance
        return close

    plates = (slope(right, 0.0, LENGTH, WIDTH), slope(left, np.pi, LENGTH, WIDTH))
    return replace(
        load_world("valley", {}), fixture=plates, start_tip=(float(rest[0]), 0.0, float(rest[1] + 0.004)),
        start_lift=lift, goal=there,
    )  # fmt: skip


def _valley_set(job: RowRun, index: int) -> tuple[Set, Valley]:
    rng = np.random.default_rng([VALLEY_SEED + job.seed, index])
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
        seed = VALLEY_SEED + 1000 * job.seed + 2 * index + int(side > 0.0)
        given = {"world.friction": friction}
        shown = record(robot, scene, _person(job), count=len(chosen), seed=seed, draws=given, duration_s=20.0)
        found, redrawn = [*found, *shown.demonstrations], redrawn + len(shown.rejected)
    return Set(found, turn, redrawn, _learn(found)), valley


def noise(job: RowRun) -> RowResult:
    """Row 3: sets of uneven demonstrations that give a feasible direction."""
    sets = [_valley_set(job, i) for i in range(job.count(SETS, QUICK_SETS))]
    good = sum(_right(each, valley.allows) for each, valley in sets)
    across = sum(_one_axis(each, 0, X) for each, _ in sets)
    others = _nulls([(each, valley.allows) for each, valley in sets])
    others["by hand: the fixture's -z"] = sum(valley.allows(DOWN) for _, valley in sets)
    behind, told = nulls.judged_beside(good, others, len(sets), quick=job.quick)
    share, beside = judged(good, len(sets), SHARE, quick=job.quick), {"mean motion", nulls.BY_HAND} <= set(behind)
    rows = [("LMC", counted(good, len(sets))), *((name, counted(hits, len(sets))) for name, hits in others.items())]
    rows += [("LMC: one axis, across the valley", counted(across, len(sets))), _redrawn([s for s, _ in sets])]
    return RowResult(
        ours=f"feasible in {counted(good, len(sets))} sets of three. {_short(others)}",
        verdict=together([share], beside), values={"feasible_share": good / len(sets)},
        head=("push", "feasible in"), rows=rows, pictures=pictures(sets[0][0].document),
        difference=f"{told} In a valley minus the mean force lies between the limits for whatever shares, and so does "
        "the bisector of both nearly always: no valley tells the intersection from these.",
    )  # fmt: skip


def _right(each: Set, allows: Callable[[Float], bool]) -> bool:
    push = each.seen(each.parts[0]["desired_direction"])
    return push is not None and allows(push)


def _one_axis(each: Set, part: int, axis: Float) -> bool:
    """Exactly one compliant axis, within 20 degrees of one of the fixture's."""
    axes = each.parts[part]["compliant_axes"]
    return len(axes) == 1 and abs(float(np.dot(np.array(axes[0]) @ each.turn, axis))) > np.cos(radians(AXIS_DEG))


def _nulls(sets: Sequence[tuple[Set, Callable[[Float], bool]]]) -> dict[str, int]:
    """Of each null, in how many sets its push is right."""
    found = [({n: push @ each.turn for n, push in nulls.pushes(each.demonstrations).items()}, ok) for each, ok in sets]
    return {name: sum(ok(pushes[name]) for pushes, ok in found) for name in found[0][0]}


def _short(others: Mapping[str, int]) -> str:
    return "Nulls: " + ", ".join(f"{name} {hits}" for name, hits in others.items())


def _redrawn(sets: Sequence[Set]) -> tuple[str, str]:
    return REDRAWN, str(sum(each.redrawn for each in sets))


def _peg_set(job: RowRun, index: int) -> Set:
    rng = np.random.default_rng([PEG_SEED + job.seed, index])
    robot, turn = _turned(rng)
    off = _off(job, rng)
    most = float(rng.choice([-1.0, 1.0]))
    tilts = np.radians([*rng.uniform(5.0, 8.0, 2), -rng.uniform(3.0, 8.0)]) * most
    starts = tuple({"start.tilt_y": float(tilt)} for tilt in tilts)
    world = load_world("peg_in_hole", {"friction": job.settings["world.friction"]})
    scene = aimed(world, np.array([np.sin(off), 0.0, -np.cos(off)]), starts)
    shown = record(robot, scene, _person(job), count=3, seed=PEG_SEED + 1000 * job.seed + index, duration_s=20.0)
    return Set(shown.demonstrations, turn, len(shown.rejected), _learn(shown.demonstrations))


def _near_the_hole(push: Float) -> bool:
    return bool(np.dot(push, DOWN) > np.cos(radians(WITHIN_DEG)))


def peg(job: RowRun) -> RowResult:
    """Row 5: what is learned for the peg."""
    sets = [_peg_set(job, i) for i in range(job.count(SETS, QUICK_SETS // 2))]
    facts = [
        (f"push within {WITHIN_DEG:g} degrees of the hole's axis", [_right(s, _near_the_hole) for s in sets]),
        ("no direction of turning", [_never_turns(s.parts[1]) for s in sets]),
        ("one axis, along x", [_one_axis(s, 0, X) for s in sets]),
        ("one axis of turning, about y", [_one_axis(s, 1, Y) for s in sets]),
    ]
    identical = sum(all(each) for each in zip(*(values for _, values in facts), strict=True))
    others = _nulls([(each, _near_the_hole) for each in sets])
    behind, told = nulls.judged_beside(sum(facts[0][1]), others, len(sets), quick=job.quick)
    share, beside = judged(identical, len(sets), SHARE, quick=job.quick), nulls.BY_HAND in behind
    return RowResult(
        ours=f"identical in {counted(identical, len(sets))} sets of three, the push alone right in {sum(facts[0][1])}. "
        + _short(others),
        verdict=together([share], beside), pictures=pictures(sets[0].document), head=("", "ours"),
        rows=[*((text, counted(sum(values), len(sets))) for text, values in facts),
              *((f"push of the null: {name}", counted(hits, len(sets))) for name, hits in others.items()),
              _redrawn(sets)],
        difference=f"{told} Nulls have a push and no axes. Whoever knows the hole's axis needs no demonstration for "
        "the push.",
        values={"identical_share": identical / len(sets)},
    )  # fmt: skip


def _never_turns(rotation: Mapping[str, Any]) -> bool:
    return rotation["desired_direction"] is None and not rotation["fully_compliant"]
