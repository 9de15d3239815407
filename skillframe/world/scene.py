"""A scene: fixtures, the tool in the robot's grip, where a run starts and when the task is done. It holds data only.

Frames: the *fixture frame* is where the task is described (its z axis points up, out of the hole or valley); the *tool
frame* is the robot's `tool_frame` (flange, wrist), its z axis points out along the tool. A scene knows nothing of
robots or engines; the plant compiles it, the teacher reads `Scene.task`, the learner sees neither.
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
from skillframe.robot.convexity import unfit_to_collide
from skillframe.world.surfaces import Surface

Vector = tuple[float, float, float]
IDENTITY = (0.0, 0.0, 0.0, 1.0)
KINDS = ("box", "capsule", "cylinder", "mesh", "plane", "sphere")
REACTION_S = 0.2
"""How long a person takes to see that something is done [s]; ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Geom:
    """A primitive or convex mesh, placed in its body's frame.

    Attributes:
        kind: "box" (half sizes), "sphere" (radius), "capsule" and "cylinder" (radius, half length), "plane", "mesh".
        size: in MuJoCo's meaning for the kind; empty for a mesh.
        position: (3,) [m]; quaternion: x, y, z, w.
        vertices: (V, 3) of a convex mesh; faces: (F, 3) its triangles, closed; without them the hull is meant.
        surface: of a mesh that collides as it is, convex or not, with others that have one, and with nothing else;
            it lies in its body's frame, not turned or moved.
        collide: takes part in contact; a geom that does not is there to be seen.
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
    """What the robot holds, rigidly, behind its force-torque sensor, in the tool frame.

    Attributes:
        mass: [kg]; center_of_mass: [m]; inertia: xx, yy, zz about the centre of mass [kg m^2].
        frames: named points of the tool frame; "tip" is always there.
        hand: name of the frame where a teacher's hand holds it.
    """

    geoms: tuple[Geom, ...]
    mass: float
    center_of_mass: Vector
    inertia: Vector
    frames: dict[str, Vector]
    hand: str = "wrist"


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """How the second arm of a two-armed robot holds the scene's fixture. One-armed robots find it standing still.

    Attributes:
        tool: what that arm holds, fixture included, in its tool frame; it is drawn and touched as the fixture is, so
            it needs no geoms of its own.
        position: (3,) of the fixture frame in that arm's tool frame [m]; quaternion: its attitude.
    """

    tool: Tool
    position: Vector
    quaternion: tuple[float, float, float, float] = IDENTITY


@dataclass(frozen=True, slots=True, kw_only=True)
class Sprung:
    """A part of the fixture that yields: geoms on a massive plate that slides along one axis, on a spring and a damper.

    F = K s, with damping 2 zeta sqrt(K m): so a surface has a stiffness in N/m, which the contact itself, whose
    stiffness depends on the masses that touch, has not. Its weight is compensated; at rest it does not sag.

    Attributes:
        name: one of its own among the scene's sprung parts.
        geoms: in the fixture frame, undeflected.
        axis: unit vector of the fixture frame along which it slides.
        stiffness: K [N/m]; mass: m [kg]; damping_ratio: zeta.
    """

    name: str
    geoms: tuple[Geom, ...]
    axis: Vector
    stiffness: float
    mass: float = 40.0
    damping_ratio: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """A second part in the fixture that is moved by what touches it: it turns, slides, or lies there free.

    One that turns or slides meets the tool and other movers, but not what stands: its range stands for that. A free
    one has its weight and meets everything.

    Attributes:
        name: one of its own among the scene's sprung parts and movers.
        geoms: in the fixture frame, as it stands at the start.
        joint: "hinge", "slide" or "free".
        anchor: a point of the hinge's axis in the fixture frame [m].
        axis: unit vector of the fixture frame.
        mass: [kg]; center_of_mass: in the fixture frame [m]; inertia: (3, 3) about it [kg m^2].
        stiffness: of its spring [N/m or Nm/rad]; rest: where the spring is slack [m or rad].
        damping: [N s/m or Nm s/rad]; friction: that its joint has to be moved against [N or Nm].
        range: of its travel [m or rad] from the start, or None.
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
        """Names of what `State.second` says of it."""
        return tuple(f"{self.name}.{word}" for word in MOVES[self.joint])


MOVES = {"hinge": ("angle",), "slide": ("travel",), "free": ("moved", "turned")}
"""What is told of a mover, by joint: [rad], [m], and of a free one how far its centre went [m] and it turned [rad]."""


class State(NamedTuple):
    """Where the tool is, seen from the fixture, for goal predicates, for N trials.

    Attributes:
        tip: pose of the tool's "tip" in the true fixture frame: (N, 3), (N, 3, 3), tool axes.
        wrench: (N, 6) true wrench of the environment on the tool at the tip, fixture axes.
        second: (N,) by name how far movers are from where they stood at the start ("gear.angle", see `MOVES`); one
            that is not named has not moved.
    """

    tip: Pose
    wrench: Float
    second: Mapping[str, Float] = MappingProxyType({})


class HandStop(NamedTuple):
    """Where a person stops a part that nothing else stops.

    Attributes:
        point: (3,) of the tool, seen from the hand, in tool axes [m].
        at: (3,) where it is to stand, in the fixture frame [m].
    """

    point: Vector
    at: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What a person who sees the scene knows, for the simulated teacher only, in the fixture frame.

    Attributes:
        direction: unit vector along which the teacher pushes, or None to hold still.
        aligned: attitude (quaternion) of the tool the teacher turns it to, or None to leave the attitude.
        turn: rotation vector along which a levering teacher turns the tool, or None.
        to: where the teacher's hand carries the tool in free air, in place of a direction, or None.
        hand: "aligning" (soft and active in rotation), "sliding", "hold" or "lever".
        starts: nominal starts of the demonstrations, cycled through: dicts of `start.*` quantities.
        done: predicate of a finished demonstration, or of a finished stage; the goal if None.
        then: stages that follow, in order, once `done` has held for a person's reaction time; the last one's `done`
            ends the demonstration, their starts are not looked at.
        stop: where the person stops pushing along `direction`, where nothing else stops the part.
        waits_s: how long the person holds still before moving, so that a recording begins in free air [s].
        held_s: how long the person goes on once it is done and goes no further along `direction` [s].
        believed: what a blindfolded person knows instead of all this: standard deviations of where the goal is,
            relative to the start, along and across the surface [m] and about its normal [rad].
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
    """How far a task has got, for people: "inserted 58 of 60 mm".

    Attributes:
        word: what was done, "inserted".
        of_m: the whole of it [m].
        reached: how much of it is done, (N,) [m].
    """

    word: str
    of_m: float
    reached: Callable[[State], Float]

    def told(self, reached_m: float | None) -> dict[str, Any]:
        """As plain values for a trace: `word`, `of_m`, `reached_m` [m], which is None where it is not known."""
        return {"word": self.word, "of_m": self.of_m, "reached_m": reached_m}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Everything about a task but the robot.

    Attributes:
        fixture: geoms in the fixture frame.
        sprung: parts of the fixture that yield, and second parts that are moved.
        friction: Coulomb coefficient of every contact between tool and fixture.
        start_tip: (3,) nominal start of the tip in the fixture frame.
        start_quaternion: nominal attitude of the tool frame in the fixture frame.
        start_lift: extra height of the start (N,) [m] for offsets (N, 3) [m] and tilts (N, 3) [rad] of the tip, so that
            no declared start penetrates the fixture.
        goal: predicate per trial.
        goal_error: distance to the goal: (N,) [m] and (N,) [rad].
        holder: lets a second arm hold the fixture; None: it always stands still.
        way: how far a run has got, of a task that has a depth; None for any other.
        analytic: figures of closed-form theory for the report (e.g. {"largest_tilt": ...}).
        params: the parameters it was built from, plain values.
        places: named poses in the fixture frame that skills may go by: position and quaternion of each.

    Raises:
        InputError: a mesh that collides is not convex, not closed, flat or of the wrong scale.
        UnknownName: a geom is of no known kind.
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

    def __post_init__(self) -> None:
        groups = {"fixture": self.fixture, "tool": self.tool.geoms}
        groups |= {f"sprung part {part.name!r}": part.geoms for part in self.sprung}
        for group, geoms in groups.items():
            for index, geom in enumerate(geoms):
                _check(geom, f"world {self.name}: {geom.kind} {index} of the {group}")


def _check(geom: Geom, where: str) -> None:
    """Refuse a geom that would collide as something else than it is drawn."""
    if geom.kind not in KINDS:
        raise UnknownName("kind", geom.kind, KINDS, where=where)
    if geom.kind != "mesh":
        return
    if geom.vertices is None:
        raise InputError(where, "has no vertices", "give them as (V, 3) in metres")
    if geom.surface is not None and (any(geom.position) or geom.quaternion != IDENTITY):
        raise InputError(where, "has a surface and a place of its own", "turn and move the surface")
    if geom.collide and geom.surface is None and (unfit := unfit_to_collide(geom.vertices, geom.faces)):
        raise InputError(where, *unfit)
