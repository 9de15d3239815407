"""Worlds with one defect each, as an author could write them by mistake: a tool above a plate, to be set down."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from skillframe.extend import WorldType
from skillframe.frames import norm
from skillframe.world.scene import Geom, Scene, Task, Tool

DOWN = (1.0, 0.0, 0.0, 0.0)
SIDEWAYS = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))
TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, -0.05]])
TETRAHEDRON_FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate:
    thickness: float = 0.02
    above: float = 0.03
    tolerance: float = 0.002
    turns: int = 1
    stiff: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Used:
    thickness: float = 0.02
    above: float = 0.03
    tolerance: float = 0.002


def plate(params):
    def away(state):
        return norm(state.tip.position)

    return Scene(
        name="plate",
        fixture=(Geom(kind="box", size=(0.1, 0.1, 0.5 * params.thickness), position=(0, 0, -0.5 * params.thickness)),),
        tool=Tool(
            geoms=(Geom(kind="capsule", size=(0.01, 0.05), position=(0.0, 0.0, 0.09)),),
            mass=0.5, center_of_mass=(0.0, 0.0, 0.075), inertia=(1e-3, 1e-3, 1e-4),
            frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, 0.15)},
        ),
        friction=0.2,
        start_tip=(0.0, 0.0, params.above),
        start_quaternion=DOWN,
        goal=lambda state: away(state) < params.tolerance,
        goal_error=lambda state: (away(state), np.zeros(len(state.wrench))),
        task=Task(direction=(0.0, 0.0, -1.0)),
    )  # fmt: skip


def world(build: Callable = plate, params: type = Used):
    return WorldType(name="plate", summary="a plate to set a tool down on", params=params, build=build)


def with_scene(change):
    """The plate, with its scene changed by a function of the scene."""
    return world(lambda params: change(plate(params)))


def with_fixture(*geoms):
    return with_scene(lambda scene: replace(scene, fixture=geoms))


def with_tool(**changes):
    return with_scene(lambda scene: replace(scene, tool=replace(scene.tool, **changes)))


def mixed_goal(scene):
    return replace(scene, goal=lambda state: np.full(len(state.wrench), bool(np.all(scene.goal(state)))))


def mean_goal(scene):
    def goal(state):
        away = norm(state.tip.position)
        return away < 0.5 * away.mean()

    return replace(scene, goal=goal)


def mixed_error(scene):
    def error(state):
        away = norm(state.tip.position)
        return away / away.max(), np.zeros_like(away)

    return replace(scene, goal_error=error)


def only_of(*names):
    fields = [(f.name, f.type, f.default) for f in dataclasses.fields(Plate) if f.name in names]
    return dataclasses.make_dataclass("Some", fields, frozen=True, kw_only=True)


def prints(params):
    print("building the plate")
    return plate(params)


def says_where(scene):
    return replace(scene, goal=lambda state: print("judging") or scene.goal(state))


DRAWN = np.random.default_rng(3)


def by_chance(scene):
    return replace(scene, friction=float(DRAWN.uniform(0.1, 0.3)))


L_SHAPE = np.array([[0, 0], [0.1, 0], [0.1, 0.02], [0.02, 0.02], [0.02, 0.1], [0, 0.1]])


def l_mesh():
    """A closed mesh of an L: concave, so that its hull would fill the corner."""
    n = len(L_SHAPE)
    vertices = np.concatenate([np.c_[L_SHAPE, np.full(n, -0.02)], np.c_[L_SHAPE, np.zeros(n)]])
    flat = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    sides = [t for i in range(n) for t in ([i, (i + 1) % n, n + (i + 1) % n], [i, n + (i + 1) % n, n + i])]
    faces = [[c, b, a] for a, b, c in flat] + [[n + a, n + b, n + c] for a, b, c in flat] + sides
    return Geom(kind="mesh", vertices=vertices, faces=np.array(faces))


PLANTED = {
    "a hand that no person has": (
        with_scene(lambda scene: replace(scene, task=replace(scene.task, hand="gloved"))),
        "nobody can take the tool",
    ),
    "a start that nobody can set": (
        with_scene(lambda scene: replace(scene, task=replace(scene.task, starts=({"start.hight": 0.01},)))),
        "demonstration:",
    ),
    "starts inside the fixture": (
        with_scene(lambda scene: replace(scene, start_tip=(0.0, 0.0, -0.015))),
        "start: the tool stands 15 mm deep in the fixture at the start, with free_tool; raise start_tip",
    ),
    "an unknown kind of geom": (with_fixture(Geom(kind="torus", size=(0.1, 0.02))), "unknown kind 'torus'"),
    "a flat mesh": (
        with_fixture(Geom(kind="mesh", vertices=TETRAHEDRON * [1.0, 1.0, 0.0], faces=TETRAHEDRON_FACES)),
        "world plate: mesh 0 of the fixture",
    ),
    "a filled mesh": (with_fixture(l_mesh()), "world plate: mesh 0 of the fixture"),
    "a mesh in millimetres": (
        with_fixture(Geom(kind="mesh", vertices=1e3 * TETRAHEDRON, faces=TETRAHEDRON_FACES)),
        "millimetres",
    ),
    "a box in millimetres": (
        with_fixture(Geom(kind="box", size=(100.0, 100.0, 10.0), position=(0.0, 0.0, -10.0))),
        "size: the fixture reaches 110 m from its frame; is it in millimetres? give metres",
    ),
    "a start in millimetres": (
        with_scene(lambda scene: replace(scene, start_tip=(0.0, 0.0, 30.0))),
        "size: the run starts 30 m from the fixture frame; is start_tip in millimetres? give metres",
    ),
    "a tool in millimetres": (
        with_tool(frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, 150.0)}),
        "size: the tool has a frame 150 m away from the wrist; is it in millimetres? give metres",
    ),
    "a start 3 m up": (
        with_scene(lambda scene: replace(scene, start_tip=(0.0, 0.0, 3.0))),
        "start: the tool starts 3 m away from the fixture, with free_tool; start nearer than 1 m",
    ),
    "a tool sideways": (
        with_scene(lambda scene: replace(scene, start_quaternion=SIDEWAYS)),
        "orientation: the tool starts turned 90 degrees away from pointing into the fixture",
    ),
    "a tool upside down": (
        with_scene(lambda scene: replace(scene, start_quaternion=(0.0, 0.0, 0.0, 1.0))),
        "orientation: the tool starts turned 180 degrees away from pointing into the fixture",
    ),
    "a goal of all trials": (with_scene(mixed_goal), "goal: goal of a trial depends on the others of its batch"),
    "a goal by the mean": (with_scene(mean_goal), "goal: goal of a trial depends on the others of its batch"),
    "an error by the largest": (with_scene(mixed_error), "goal: goal_error[0] of a trial depends on the others"),
    "a number that nothing reads": (
        world(lambda p: plate(replace(Plate(), above=p.above)), only_of("above", "thickness")),
        "parameters: parameter thickness has no effect: 0.024 or 0.016 gives the same scene and goal; use it or drop",
    ),
    "a tolerance that nothing reads": (
        world(lambda p: plate(Plate(above=p.above)), only_of("above", "tolerance")),
        "parameters: parameter tolerance has no effect",
    ),
    "a count that nothing reads": (
        world(plate, Plate),
        "parameters: parameter turns has no effect: 2 or 0 gives the same",
    ),
    "a switch that nothing reads": (
        world(plate, Plate),
        "parameters: parameter stiff has no effect: True gives the same",
    ),
    "a box of two sizes": (with_fixture(Geom(kind="box", size=(0.1, 0.1))), "start: MuJoCo does not take it: "),
    "a sphere of no size": (with_fixture(Geom(kind="sphere", size=(0.0,))), "start: MuJoCo does not take it: "),
    "no mass": (with_tool(mass=0.0), "scene: no body has mass 0.0"),
    "chance in building": (with_scene(by_chance), "scene: building twice from the same parameters"),
    "prints": (world(prints), "scene: prints 'building the plate', which gets into what a command prints"),
    "prints in its goal": (with_scene(says_where), "prints 'judging', which gets into what a command prints"),
    "a key that is missing": (world(lambda params: {}["plate"]), "scene: raised KeyError: 'plate'"),
    "quits": (world(lambda params: exec("raise SystemExit(2)")), "scene: raised SystemExit: 2"),
}
"""The defect, and what must be among what the kit says of it."""
