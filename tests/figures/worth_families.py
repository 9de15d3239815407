"""Tasks in which averages of a demonstration do not work, one instance a seed, and people who demonstrate them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from typing import Any

import numpy as np
from skillframe_teaching.people import People, Person, off_by
from skillframe_teaching.sessions import demonstration_from
from skillframe_teaching.teacher import TeacherSettings

from skillframe.demonstration.record import Demonstration
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.frames import Float, rotation_matrix, unit
from skillframe.world.placement import fixture_poses
from skillframe.world.scene import Scene

KINDS = ("noise 8", "noise 15", "bias 10", "hesitating", "wrong first")
ATTEMPTS = 12


def _hump(rng: np.random.Generator, slope: tuple[float, float], friction: tuple[float, float], **more: Any) -> Any:
    return "hump", {"slope": radians(rng.uniform(*slope)), "friction": rng.uniform(*friction), **more}


def _steps(rng: np.random.Generator) -> Any:
    world, params = _hump(rng, (46, 51), (0.16, 0.24), steps=radians(rng.uniform(15, 22)))
    return world, {**params, "height": float(rng.uniform(0.010, 0.013) * np.sin(params["slope"]))}


def _pit(rng: np.random.Generator, faces: Sequence[tuple[float, float]], friction: tuple[float, float]) -> Any:
    apart = rng.uniform(105.0, 135.0)
    azimuths = (0.0, radians(apart), radians(0.5 * apart + 180.0)) if len(faces) == 3 else (0.0, np.pi, 0.0)
    slopes = [radians(rng.uniform(*face)) for face in faces] + [-0.01] * (3 - len(faces))
    return "pit", {"slopes": tuple(slopes), "azimuths": azimuths, "friction": rng.uniform(*friction)}


def _slide(rng: np.random.Generator) -> Any:
    push = tuple(unit(np.array([0.75, rng.uniform(0.30, 0.45), -rng.uniform(0.40, 0.55)])).tolist())
    return "pit", {
        "slopes": (0.0, radians(90.0), radians(90.0)), "azimuths": (radians(225.0), radians(90.0), 0.0),
        "push": push, "friction": rng.uniform(0.2, 0.3),
    }  # fmt: skip


FAMILIES: dict[str, Callable[[np.random.Generator], Any]] = {
    "hump_low": lambda rng: _hump(rng, (51, 55), (0.08, 0.12)),
    "hump": lambda rng: _hump(rng, (46, 51), (0.16, 0.24)),
    "hump_long": lambda rng: _hump(rng, (46, 51), (0.16, 0.24)),
    "steps": _steps,
    "skew": lambda rng: _hump(rng, (45, 50), (0.12, 0.20), skew=radians(rng.uniform(12, 20))),
    "slide": _slide,
    "corner": lambda rng: _pit(rng, [(18, 24), (35, 45), (55, 63)], (0.12, 0.18)),
    "valley": lambda rng: _pit(rng, [(22, 28), (55, 63)], (0.18, 0.25)),
    "lid": lambda rng: ("lid", {"opening": radians(rng.uniform(60, 68)), "friction": rng.uniform(0.08, 0.12)}),
    "bayonet": lambda rng: (
        "bayonet", {"lead": radians(rng.uniform(83, 87)), "friction": rng.uniform(0.18, 0.25), "depth": 0.004}
    ),
}  # fmt: skip
GENTLE_N = {"bayonet": 5.0}
"""How hard people and pushes press where the tool drops, in place of 15 and 20 N: 8 N and 8 mm end most demonstrations
by their limit of 80 N, 5 N and 4 mm 3 of 48."""
FLOORS = {"hump_long": (0.070, 0.085, 0.100, 0.110)}
"""How far before the ramp people begin, in place of `SHORT`. The longer, the more the floor weighs in means."""
SHORT = (0.012, 0.030, 0.040, 0.055)
LONGER_S = {"hump_long": 14.0}
"""How long a run may take [s] where 8 do not bear the way at the speed of one who hesitates, some 14 mm/s."""
NUMBERS = {
    "corner": 0, "hump": 1, "hump_low": 2, "skew": 3, "slide": 4, "steps": 5, "valley": 6, "bayonet": 7, "hump_long": 8,
    "lid": 9,
}  # fmt: skip
"""What a family adds to the seeds of its instances; a new family takes the next number."""


def drawn(family: str, seed: int) -> tuple[Scene, Float, np.random.Generator]:
    """An instance: its scene, how the whole fixture is turned (3, 3), and what draws the rest of the set."""
    rng = np.random.default_rng([seed, NUMBERS[family]])
    world, params = FAMILIES[family](rng)
    turn = unit(rng.standard_normal(3)) * rng.uniform(0.0, np.pi)
    return load_world(world, {**params, "turn": tuple(turn.tolist())}), rotation_matrix(turn), rng


def starts(
    scene: Scene, turn: Float, rng: np.random.Generator, count: int, lift: float, floors: Sequence[float] = SHORT
) -> Float:  # fmt: skip
    """Offsets (count, 3) of starts, in the turned fixture's axes. `floors` are those of a hump [m]."""
    if scene.name == "hump":
        before = rng.choice(floors, count) if not lift else rng.uniform(min(floors), max(floors), count)
        return np.column_stack([0.03 - before, np.zeros(count), np.full(count, lift)]) @ turn.T
    if scene.name == "bayonet":
        return np.tile(-lift * np.array(scene.task.direction), (count, 1))
    if scene.name == "pit" and not scene.params["slopes"][0]:  # a slide
        along, aside = rng.uniform(0.03, 0.06, count), rng.uniform(0.004, 0.025, count)
        return np.column_stack([-along, -aside, np.full(count, lift)]) @ turn.T
    nominal = np.array([[s.get(f"start.offset_{a}", 0.0) for a in "xyz"] for s in scene.task.starts])
    up = -lift * np.array(scene.task.direction)
    return nominal[rng.integers(len(nominal), size=count)] * rng.uniform(0.5, 1.2, (count, 1)) + up


def _person(kind: str, scene: Scene, turn: Float, rng: np.random.Generator) -> Person:
    push = scene.task.direction
    assert push is not None
    if kind == "bias 10":
        return Person(push=off_by(push, radians(10.0), rng.uniform(0.0, 2.0 * np.pi)))
    if kind == "wrong first":
        x, y, z = turn.T @ np.array(push)
        return Person(wrong=tuple((turn @ np.array([-x, -y, z])).tolist()))
    noise = {"noise 15": 15.0}.get(kind, 8.0)
    return Person(push=off_by(push, radians(rng.uniform(0.0, 3.0)), rng.uniform(0.0, 2.0 * np.pi)),
                  aim_noise=radians(noise), hesitates=kind == "hesitating")  # fmt: skip


def demonstrations(
    scene: Scene, turn: Float, rng: np.random.Generator, kinds: Sequence[str], count: int,
    floors: Sequence[float] = SHORT,
) -> tuple[dict[str, list[Demonstration]], int]:  # fmt: skip
    """`count` demonstrations of a person of each kind, and how many failed. A person whose all fail is left out."""
    people = {kind: _person(kind, scene, turn, rng) for kind in kinds}
    begin = {kind: starts(scene, turn, rng, count, 0.0, floors) for kind in kinds}
    got: dict[tuple[str, int], Demonstration] = {}
    failed = 0
    for attempt in range(ATTEMPTS):
        slots = [(kind, i) for kind in kinds for i in range(count) if (kind, i) not in got]
        if not slots:
            break
        if attempt == ATTEMPTS // 2:
            people |= {kind: _person(kind, scene, turn, rng) for kind, _ in slots}
        traces, good = _attempt(scene, [people[kind] for kind, _ in slots], [begin[k][i] for k, i in slots], rng)
        failed += int((~good).sum())
        for slot, trace, fine in zip(slots, traces, good, strict=True):
            if fine:
                got[slot] = demonstration_from(trace, scene, TeacherSettings())
    full = [kind for kind in kinds if all((kind, i) in got for i in range(count))]
    return {kind: [got[kind, i] for i in range(count)] for kind in full}, failed


def _attempt(scene: Scene, people: list[Person], begin: list[Float], rng: np.random.Generator) -> Any:
    robot = load_robot_model("free_tool")
    draws = {f"start.offset_{a}": np.array(begin)[:, i] for i, a in enumerate("xyz")}
    setup = Setup(
        robot=robot.guided(), scene=scene, center_of_compliance=np.array(scene.tool.frames["grip"]),
        filter_wrench=False, stop_when=scene.goal,
    )  # fmt: skip
    most = TeacherSettings(force_max=GENTLE_N.get(scene.name, TeacherSettings().force_max))
    hands = People(scene.task, fixture_poses(robot, draws, len(people)), people, most)
    result = simulate(hands, setup, draws, rng.spawn(len(people)), duration_s=12.0, trace_hz=500.0)
    return result.traces, result.success
