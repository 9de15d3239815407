"""Scenes: fixture, tool, start and goal of a task, as data.

In the *fixture frame* z points up, out of the hole or valley; in the *tool frame*, the robot's `tool_frame`, out along
the tool.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, Pose
from skillframe.robot.meshes import unfit_to_collide
from skillframe.world.surfaces import Surface

Vector = tuple[float, float, float]  #: x, y, z
IDENTITY = (0.0, 0.0, 0.0, 1.0)
KINDS = ("box", "capsule", "cylinder", "mesh", "plane", "sphere")
REACTION_S = 0.2
"""Reaction time of a teacher [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Geom:
    """A primitive or convex mesh in its body's frame.

    Attributes:
        kind: "box" (half sizes), "sphere" (radius), "capsule" and "cylinder" (radius, half length), "plane", "mesh".
        size: as in MuJoCo; empty for a mesh.
        position: (3,) [m]; quaternion: x, y, z, w.
        vertices: (V, 3) of a convex mesh; faces: (F, 3) closed triangles, or None for the hull.
        surface: of a mesh of any shape that collides only with other surfaces, in its body's frame.
        collide: takes part in contact.
        visible: is drawn.
    """

    kind: str
    size: tuple[float, ...] = ()
    position: Vector = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = IDENTITY
    rgba: tuple[float, float, float, float] = (0.6, 0.65, 0.7, 1.0)
    vertices: NDArray[np.float64] | None = None
    faces: NDArray[np.int64] | None = None
    surface: Surface | None = None
    collide: bool = True
    visible: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Tool:
    """Rigid tool behind the force-torque sensor, in the tool frame.

    Attributes:
        mass: [kg]; center_of_mass: [m]; inertia: xx, yy, zz about the centre of mass [kg m^2].
        frames: named points, always with "tip"; "wrist" is the origin by default.
        hand: name of the point where a teacher holds it.
    """

    geoms: tuple[Geom, ...]
    mass: float
    center_of_mass: Vector
    inertia: Vector
    frames: dict[str, Vector]
    hand: str = "wrist"

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", {"wrist": (0.0, 0.0, 0.0), **self.frames})


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """Fixture held by the second arm of a two-armed robot.

    Attributes:
        tool: mass properties of what that arm holds, without geoms.
        position: (3,) of the fixture frame in that arm's tool frame [m]; quaternion: its orientation.
    """

    tool: Tool
    position: Vector
    quaternion: tuple[float, float, float, float] = IDENTITY


@dataclass(frozen=True, slots=True, kw_only=True)
class Sprung:
    """Compliant part of the fixture: geoms on a plate that slides along an axis on a spring and damper.

    F = K s with damping 2 zeta sqrt(K m), which gives a surface a stiffness independent of the masses.

    Attributes:
        name: unique among sprung parts.
        geoms: undeflected, in the fixture frame.
        axis: unit vector of sliding in the fixture frame.
        stiffness: K [N/m]; mass: m [kg], weightless; damping_ratio: zeta.
    """

    name: str
    geoms: tuple[Geom, ...]
    axis: Vector
    stiffness: float
    mass: float = 40.0
    damping_ratio: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """Second part of the fixture that contact moves: it turns, slides, or is free.

    Only a free one has weight and touches the fixture; others have a range.

    Attributes:
        name: unique among sprung parts and movers.
        geoms: at the start, in the fixture frame.
        joint: "hinge", "slide" or "free".
        anchor: point of the hinge's axis in the fixture frame [m].
        axis: unit vector in the fixture frame.
        mass: [kg]; center_of_mass: in the fixture frame [m]; inertia: (3, 3) about it [kg m^2].
        stiffness: of its spring [N/m or Nm/rad]; rest: of the spring [m or rad].
        damping: [N s/m or Nm s/rad]; friction: of its joint [N or Nm].
        range: of travel from the start [m or rad], or None.
    """

    name: str
    geoms: tuple[Geom, ...]
    joint: str
    anchor: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    mass: float
    center_of_mass: Vector
    inertia: NDArray[np.float64]
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    range: tuple[float, float] | None = None

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of its entries in `State.second`."""
        return tuple(f"{self.name}.{word}" for word in MOVES[self.joint])


MOVES = {"hinge": ("angle",), "slide": ("travel",), "free": ("moved", "turned")}
"""Displacements by joint: angle [rad], travel [m], and of a free one distance [m] and rotation [rad]."""


class State(NamedTuple):
    """State of N tools in the fixture frame, for goals.

    Attributes:
        tip: pose of "tip" in the true fixture frame: (N, 3), (N, 3, 3), tool axes.
        wrench: (N, 6) true contact wrench on the tool at the tip, fixture axes.
        second: (N,) displacements of movers by name ("gear.angle", see `MOVES`); 0 if absent.
    """

    tip: Pose
    wrench: Float
    second: Mapping[str, Float] = MappingProxyType({})


class HandStop(NamedTuple):
    """Where a teacher stops a part that nothing else stops.

    Attributes:
        point: (3,) of the tool, from `hand`, in tool axes [m].
        at: (3,) its target in the fixture frame [m].
    """

    point: Vector
    at: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A teacher's knowledge of the task, in the fixture frame.

    Attributes:
        direction: unit vector of the push, or None to hold still.
        aligned: target orientation of the tool (quaternion), or None.
        turn: rotation vector of levering, or None.
        to: target of the teacher's hand in free air, or None.
        hand: "aligning" (soft and active in rotation), "sliding", "hold" or "lever".
        starts: nominal starts of the demonstrations, in turn: dicts of `start.*` quantities.
        done: predicate that ends a demonstration or stage; the goal if None.
        then: further stages, each after `done` has held for a reaction time.
        stop: where the teacher stops pushing along `direction`.
        waits_s: rest before the motion [s].
        held_s: time the teacher continues once done and stopped [s].
        believed: of a blindfolded teacher, standard deviations of the goal from the start, along and across the surface
            [m] and about its normal [rad].
    """

    direction: Vector | None
    aligned: tuple[float, float, float, float] | None = None
    turn: Vector | None = None
    to: Vector | None = None
    hand: str = "sliding"
    starts: tuple[dict[str, float], ...] = ({},)
    done: Callable[[State], NDArray[np.bool_]] | None = None
    then: tuple[Task, ...] = ()
    stop: HandStop | None = None
    waits_s: float = 0.0
    held_s: float = 0.0
    believed: Vector = (0.004, 0.004, 0.0)


class Way(NamedTuple):
    """Progress of a task, as in "inserted 58 of 60 mm".

    Attributes:
        word: "inserted".
        of_m: the total [m].
        reached: progress (N,) [m].
    """

    word: str
    of_m: float
    reached: Callable[[State], Float]

    def told(self, reached_m: float | None) -> dict[str, Any]:
        """Values for a trace: `word`, `of_m`, `reached_m` [m] or None."""
        return {"word": self.word, "of_m": self.of_m, "reached_m": reached_m}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A task without the robot.

    Attributes:
        fixture: geoms in the fixture frame.
        sprung: compliant and movable parts.
        friction: Coulomb coefficient between tool and fixture.
        start_tip: (3,) nominal start of the tip in the fixture frame.
        start_quaternion: nominal start orientation of the tool frame there.
        start_lift: extra start height (N,) [m] for offsets (N, 3) [m] and tilts (N, 3) [rad].
        goal: predicate per trial.
        goal_error: distance to the goal: (N,) [m] and (N,) [rad].
        holder: lets a second arm hold the fixture.
        way: progress of a task with a depth.
        analytic: closed-form figures for the report.
        params: the parameters it was built from.
        places: named poses in the fixture frame for skills: position and quaternion.
        reached: points in the fixture frame that the tip has to reach, by which a machine's `[workspace]` is checked.

    Raises:
        InputError, UnknownName: a geom cannot collide as drawn, or is of unknown kind.
    """

    name: str
    fixture: tuple[Geom, ...]
    tool: Tool
    friction: float
    start_tip: Vector
    start_quaternion: tuple[float, float, float, float]
    goal: Callable[[State], NDArray[np.bool_]]
    goal_error: Callable[[State], tuple[Float, Float]]
    task: Task
    sprung: tuple[Sprung | Mover, ...] = ()
    start_lift: Callable[[Float, Float], Float] = field(default=lambda offset, tilt: np.zeros(len(offset)))
    holder: Holder | None = None
    way: Way | None = None
    analytic: dict[str, float] = field(default_factory=dict)
    params: dict[str, Any] = field(default_factory=dict)
    places: dict[str, tuple[Vector, tuple[float, float, float, float]]] = field(default_factory=dict)
    reached: tuple[Vector, ...] = ()

    def __post_init__(self) -> None:
        groups = {"fixture": self.fixture, "tool": self.tool.geoms}
        groups |= {f"sprung part {part.name!r}": part.geoms for part in self.sprung}
        for group, geoms in groups.items():
            for index, geom in enumerate(geoms):
                where = f"world {self.name}: {geom.kind} {index} of the {group}"
                if geom.kind not in KINDS:
                    raise UnknownName("kind", geom.kind, KINDS, where=where)
                if geom.kind != "mesh":
                    continue
                if geom.vertices is None:
                    raise InputError(where, "has no vertices", "give them as (V, 3) in metres")
                if geom.surface is not None and (any(geom.position) or geom.quaternion != IDENTITY):
                    raise InputError(where, "has a surface and a place of its own", "turn and move the surface")
                if geom.collide and geom.surface is None and (unfit := unfit_to_collide(geom.vertices, geom.faces)):
                    raise InputError(where, *unfit)
