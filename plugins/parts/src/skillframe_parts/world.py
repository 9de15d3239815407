"""Scene of a fixture file: collision geometry, the goal "seated", and the task for a simulated teacher.

The robot holds the part and a light gripper of 0.5 kg, whose mass is half way between wrist and part. The fixture frame
is `fit`'s: origin in the middle of the hole entrance, z pointing out.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.config import require_ranges
from skillframe.frames import Float, matrix_from_quaternion, norm, quaternion_from_matrix
from skillframe.world import (
    FIXTURE_COLOUR,
    REACTION_S,
    TOOL_COLOUR,
    TOOL_DOWN,
    Geom,
    HandStop,
    Scene,
    State,
    Task,
    Tool,
    insertion,
    shaft,
    tilt_of,
)
from skillframe_parts.declared import FixtureFile, read_fixture
from skillframe_parts.fit import corners, lowest, nothing_stops
from skillframe_parts.load import LoadedParts, PreparedPart, load
from skillframe_parts.second_part import in_place, second_parts, vector
from skillframe_parts.solid import arrays_of

GRIPPER = 0.5
_FLIP = np.array([1.0, -1.0, -1.0])  # fixture axes to axes of a downward tool


@dataclass(frozen=True, slots=True, kw_only=True)
class PartsParams:
    """Parameters of a world of a fixture file.

    Attributes:
        friction: Coulomb coefficient [0 to 5].
        above_mouth: nominal height of the tip over the hole entrance at the start [m, 0m to 200mm].
        height: distance along the axis from the assembled pose that counts as seated [m, 1um to 100mm].
        sideways: distance across the axis, likewise [m, 1um to 100mm].
        tilt: of the axis, likewise [rad, 0.1deg to 90deg].
    """

    friction: float = 0.2
    above_mouth: float = 0.001
    height: float = 0.001
    sideways: float = 0.002
    tilt: float = 0.035


def params_of(path: Path) -> type:
    """The parameters of a fixture file's world, with the file's values as defaults.

    Raises:
        InputError: as `read_fixture`.
    """
    given = defaults(read_fixture(path))
    fields = [(name, float, dataclasses.field(default=value)) for name, value in given.items()]
    made: type = dataclasses.make_dataclass(
        PartsParams.__name__, fields, bases=(PartsParams,), frozen=True, kw_only=True,
        namespace={"__doc__": PartsParams.__doc__},
    )  # fmt: skip
    return made


def defaults(file: FixtureFile) -> dict[str, float]:
    """The values of `PartsParams` in a file."""
    seated = file.task.seated
    return {
        "friction": file.contact.friction, "above_mouth": file.task.start.above_mouth, "height": seated.height,
        "sideways": seated.sideways, "tilt": seated.tilt,
    }  # fmt: skip


def build_world(path: Path, params: PartsParams) -> Scene:
    """The scene of a fixture file.

    Raises:
        InputError: the file, its meshes or the parameters are unusable.
    """
    loaded = load(path)
    require_ranges(params, f"world {loaded.name}")
    found, depth = loaded.fit, loaded.fit.depth
    points = corners(found)

    def lift(offset: Float, tilt: Float) -> Float:
        return -lowest(points, tilt)

    fixed, movers = second_parts(path, loaded, params.above_mouth)

    screwed = bool(loaded.file.task.turns)

    def leans(state: State) -> Float:
        return np.maximum(tilt_of(state), _turn_left(state)) if screwed else tilt_of(state)

    def seated(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = np.abs(state.tip.position[..., 2] + depth) < params.height
        there = there & (norm(state.tip.position[..., :2]) < params.sideways) & (tilt_of(state) < params.tilt)
        if screwed:
            there = there & (_turn_left(state) < loaded.file.task.seated.turned)
        return there & in_place(loaded.file.second, state)

    stop = None
    if not (movers or fixed) and nothing_stops(found, loaded.file.fixture.table, loaded.file.task.seated.height):
        stop = HandStop((0.0, 0.0, loaded.file.tool.grip), (0.0, 0.0, -depth))
    starts = tuple(
        {
            "start.offset_z": height - params.above_mouth + float(lowest(points, tilt[None])[0]),
            **{f"start.tilt_{axis}": float(angle) for axis, angle in zip("xyz", tilt, strict=True) if angle},
        }
        for height, tilt in loaded.starts
    )
    x, y, z, w = quaternion_from_matrix(found.way.before @ matrix_from_quaternion(TOOL_DOWN)).tolist()
    return Scene(
        name=loaded.name,
        fixture=(*_geoms(loaded.socket, np.eye(3), np.zeros(3), FIXTURE_COLOUR), *fixed, *_table(loaded)),
        sprung=movers,
        tool=_tool(loaded),
        friction=params.friction,
        start_tip=(0.0, 0.0, params.above_mouth),
        start_quaternion=(x, y, z, w) if screwed else TOOL_DOWN,
        start_lift=lift,
        goal=seated,
        goal_error=lambda state: (norm(state.tip.position - np.array([0.0, 0.0, -depth])), leans(state)),
        way=insertion(depth, found.radius),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=starts, stop=stop, held_s=REACTION_S,
            waits_s=0.3,  # longer than the initial phase of a recording (`conditioning.contact.LEVEL_TIME`)
        ),
        params=stated(loaded),
    )  # fmt: skip


def _turn_left(state: State) -> Float:
    """Angle (N,) [rad] of a tip about the fixture's z from its assembled orientation."""
    turned = state.tip.rotation * _FLIP  # relative to the assembled orientation
    left: Float = np.abs(np.arctan2(turned[..., 1, 0] - turned[..., 0, 1], turned[..., 0, 0] + turned[..., 1, 1]))
    return left


def stated(loaded: LoadedParts) -> dict[str, Any]:
    """Figures [m] and hashes of a file's world that every result states."""
    pieces = [len(side.pieces.hulls) for side in (loaded.plug, loaded.socket) if side.pieces is not None]
    return {
        "depth": loaded.fit.depth, "clearance": loaded.fit.clearance, "backend": loaded.backend,
        "contact_error": loaded.contact_error, "pieces": sum(pieces),
        "origin": [float(x) for x in loaded.fit.origin],
        **({"notes": " ".join(f"{note}." for note in loaded.notes)} if loaded.notes else {}),
        **{f"sha256 of {name}": value for name, value in loaded.hashes.items()},
    }  # fmt: skip


def _geoms(side: PreparedPart, turn: Float, shift: Float, rgba: tuple[float, float, float, float]) -> tuple[Geom, ...]:
    if side.surface is not None:
        vertices, faces = arrays_of(side.solid)
        placed = dataclasses.replace(side.surface, turn=turn, shift=shift)
        return (Geom(kind="mesh", vertices=vertices @ turn.T + shift, faces=faces, rgba=rgba, surface=placed),)
    assert side.pieces is not None
    shapes = [(hull.vertices, hull.faces, True) for hull in side.pieces.hulls]
    if side.rest is not None and not side.rest.is_empty():
        shapes.append((*arrays_of(side.rest), False))
    return tuple(
        Geom(kind="mesh", vertices=vertices @ turn.T + shift, faces=faces, rgba=rgba, collide=collide)
        for vertices, faces, collide in shapes
    )


def _tool(loaded: LoadedParts) -> Tool:
    grip, turn = loaded.file.tool.grip, np.diag(_FLIP)
    shift = turn @ np.array([0.0, 0.0, loaded.fit.depth]) + np.array([0.0, 0.0, grip])
    top = grip - float(np.ptp(corners(loaded.fit)[:, 2])) - 0.012
    mass = loaded.mass + GRIPPER
    own, light = turn @ loaded.center + np.array([0.0, 0.0, grip]), np.array([0.0, 0.0, 0.5 * grip])
    center = (loaded.mass * own + GRIPPER * light) / mass
    inertia = loaded.inertia + GRIPPER * grip**2 / 12.0 * np.array([1.0, 1.0, 0.01])
    for weight, place in ((loaded.mass, own), (GRIPPER, light)):
        away = place - center
        inertia = inertia + weight * (away @ away - away**2)
    handle = (shaft(0.012, 0.012, top),) if top > 0.03 else ()
    return Tool(
        geoms=(*_geoms(loaded.plug, turn, shift, TOOL_COLOUR), *handle), mass=mass, center_of_mass=vector(center),
        inertia=vector(inertia),
        frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, grip), "grip": (0.0, 0.0, max(grip - 0.04, 0.0))},
    )  # fmt: skip


def _table(loaded: LoadedParts) -> tuple[Geom, ...]:
    if not loaded.file.fixture.table:
        return ()
    low, high = np.reshape(loaded.fit.socket.bounding_box(), (2, 3))
    middle, half, thick = 0.5 * (low + high), np.maximum(0.75 * (high - low), 0.06), 0.005  # half widths [m]
    place, size = (float(middle[0]), float(middle[1]), float(low[2]) - thick), (float(half[0]), float(half[1]), thick)
    return (Geom(kind="box", size=size, position=place, rgba=(0.8, 0.78, 0.74, 1.0)),)
