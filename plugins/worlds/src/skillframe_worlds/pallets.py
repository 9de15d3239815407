"""`pallets`: a machine's load pushed into the corner of a stack of pallets and a stop (seed, Fig. 11), or of two stops.

The surfaces are plates on springs (`skillframe.world.scene.Sprung`), of 1e6 N/m for wood and 3e4 N/m for styrofoam.
Pallets are 1.2 x 0.8 x 0.144 m (EN 13698-1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import TOOL_COLOUR, TOOL_DOWN, Geom, Scene, Sprung, State, Task, Tool, Vector, require

RADIUS = 0.05
WIDTH, STEP = 0.8, 0.144
POST = 0.2
"""Width of the stop [m], which leaves the view open."""
WOOD, FOAM = (0.76, 0.60, 0.42, 1.0), (0.93, 0.94, 0.96, 1.0)
STIFFNESS = {"wood": 1e6, "styrofoam": 3e4}
SHEETS = 0.2
"""Thickness of the styrofoam [m], the deepest a tool may sink."""
PLATE = 0.2
"""Half thickness of the touched plates, and their overlap [m]."""
ABOVE_STOP = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PalletsParams:
    """Parameters of `pallets`.

    Attributes:
        surface: "wood" or "styrofoam", the cover of stack and stop.
        stiffness: of the surfaces [N/m, 0 to 5e6]; 0 for the surface's own, 1e6 of wood and 3e4 of styrofoam.
        friction: Coulomb coefficient [0 to 1].
        pallets: number in the stack; its top is 0.144 m higher with each, styrofoam included [1 to 6].
        length: of the stack, from the stop towards the machine [m, 0.3m to 1.2m]; the arm of a loader
            needs a short one.
        plate_mass: mass that moves with each surface [kg, 10kg to 200kg].
        damping_ratio: of that mass on its spring [0.1 to 2].
        above: nominal height of the tool over the stack [m, 1mm to 0.8m].
        away: nominal distance of the tool from the stop [m, 1mm to 0.8m].
        aside: nominal distance of the tool from a second stop, to its left, for a corner of three surfaces; 0 for
            none [m, 0 to 0.6m].
        tolerance: distance from the undeflected corner that counts as reached [m, 10um to 100mm]. In styrofoam the tool
            may also be deeper, by less than the sheets' thickness.
    """

    surface: Literal["wood", "styrofoam"] = "wood"
    stiffness: float = 0.0
    friction: float = 0.3
    pallets: int = 3
    length: float = 1.2
    plate_mass: float = 40.0
    damping_ratio: float = 0.5
    above: float = 0.35
    away: float = 0.45
    aside: float = 0.0
    tolerance: float = 0.01


def build(params: PalletsParams) -> Scene:
    """The scene, with the ground at z = 0. The stop touches the tool at x = 0.5 m, the second stop at y = 0."""
    stiffness = params.stiffness or STIFFNESS[params.surface]
    require(
        "pallets",
        {
            "1e3 <= stiffness N/m, or 0 for the surface's own": stiffness >= 1e3,
            "a natural frequency of the surfaces below 60 Hz (stiffness over plate_mass below 1.42e5 1/s^2)":
                stiffness < 1.42e5 * params.plate_mass,
        },
        params,
    )  # fmt: skip
    top, face = params.pallets * STEP, 0.5 + RADIUS
    corner = np.array([face - RADIUS, 0.0, top + RADIUS])
    into = np.array([1.0, 1.0, -1.0]) if params.aside else np.array([1.0, 0.0, -1.0])  # the surfaces' directions
    across = np.flatnonzero(into)

    def distance(state: State) -> Float:
        return norm((state.tip.position - corner)[..., across])

    def there(state: State) -> NDArray[np.bool_]:
        return distance(state) < params.tolerance

    def sunk_in(state: State) -> NDArray[np.bool_]:
        left = ((corner - state.tip.position) * into)[..., across]  # distance left to each surface
        reached: NDArray[np.bool_] = np.all((left < params.tolerance) & (left > -SHEETS), axis=-1)
        return reached

    def sprung(name: str, axis: Vector, geoms: tuple[Geom, ...]) -> Sprung:
        return Sprung(
            name=name, geoms=geoms, axis=axis, stiffness=stiffness, mass=params.plate_mass,
            damping_ratio=params.damping_ratio,
        )  # fmt: skip

    grey, behind, high = (0.45, 0.48, 0.52, 1.0), face + 2.0 * _cover(params.surface), 0.5 * (top + ABOVE_STOP)
    wall = [_drawn((0.06, 0.5 * POST, high), (behind + 0.07, 0.0, high), grey)]
    x, y, z = min(0.2, 0.7 * params.away), min(0.15, 0.7 * params.aside), min(0.15, 0.7 * params.above)
    starts = [{"start.offset_x": sign * x, "start.offset_z": sign * z} for sign in (-1.0, 1.0)]
    plates = [
        sprung("stack", (0.0, 0.0, 1.0), _top(params, top, face)),
        sprung("stop", (1.0, 0.0, 0.0), _face(params, top, face)),
    ]
    if params.aside:
        plates.append(sprung("side_stop", (0.0, 1.0, 0.0), _side(params, top, face)))
        wall, starts = [], [start | {"start.offset_y": -y} for start in starts]
        starts.append({"start.offset_y": y, "start.offset_z": z})
    return Scene(
        name="pallets",
        fixture=(*_stack(params, top), *wall),
        sprung=tuple(plates),
        tool=Tool(
            geoms=(Geom(kind="sphere", size=(RADIUS,), rgba=TOOL_COLOUR),), mass=1e-3, center_of_mass=(0.0, 0.0, 0.0),
            inertia=(1e-6, 1e-6, 1e-6), frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, 0.0)},
        ),
        friction=params.friction,
        start_tip=(
            float(corner[0]) - params.away, 0.0 - params.aside, float(corner[2]) + params.above,
        ),
        start_quaternion=TOOL_DOWN,
        goal=sunk_in if params.surface == "styrofoam" else there,
        goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
        task=Task(
            direction=tuple((into / norm(into)).tolist()), hand="sliding", starts=tuple(starts), done=sunk_in,
        ),
        reached=((float(corner[0]), 0.0, float(corner[2])),),
    )  # fmt: skip


def _across(params: PalletsParams) -> float:
    """Where the stack has its middle, across [m]: below the tool, or with its edge at the second stop."""
    return RADIUS - 0.5 * WIDTH if params.aside else 0.0


def _top(params: PalletsParams, top: float, face: float) -> tuple[Geom, ...]:
    """The plate under the tool, which overlaps the stops so that nothing slips between."""
    low, high, across = face - params.length - PLATE, face + PLATE, _across(params)
    wide = 0.5 * WIDTH + (PLATE if params.aside else 0.0)
    solid = Geom(
        kind="box", size=(0.5 * (high - low), wide, PLATE), position=(0.5 * (low + high), across, top - PLATE),
        visible=False,
    )  # fmt: skip
    half, middle = 0.5 * params.length, face - 0.5 * params.length
    if params.surface == "styrofoam":
        thick = 0.5 * SHEETS
        sheets = [_drawn((half, 0.5 * WIDTH, thick), (middle, across, top - thick), FOAM)]
    else:
        boards = (-0.33, -0.165, 0.0, 0.165, 0.33)
        sheets = [_drawn((half, 0.06, 0.011), (middle, across + y, top - 0.011), WOOD) for y in boards]
    return (solid, *sheets)


def _face(params: PalletsParams, top: float, face: float) -> tuple[Geom, ...]:
    """The stop's plate, which reaches as deep below the stack's top as styrofoam yields."""
    half, across = (0.5 * WIDTH + PLATE if params.aside else 0.5 * POST), _across(params)
    low, high = top - SHEETS - PLATE, top + ABOVE_STOP
    size = (PLATE, half, 0.5 * (high - low))
    solid = Geom(kind="box", size=size, position=(face + PLATE, across, 0.5 * (low + high)), visible=False)
    thick, colour = _cover(params.surface), _colour(params)
    seen = (thick, min(half, 0.5 * WIDTH), 0.5 * ABOVE_STOP)
    return (solid, _drawn(seen, (face + thick, across, top + seen[2]), colour))


def _side(params: PalletsParams, top: float, face: float) -> tuple[Geom, ...]:
    """The second stop's plate, as long as the stack."""
    low, high, half = top - SHEETS - PLATE, top + ABOVE_STOP, 0.5 * params.length
    size, middle = (half + PLATE, PLATE, 0.5 * (high - low)), face - half
    solid = Geom(kind="box", size=size, position=(middle, RADIUS + PLATE, 0.5 * (low + high)), visible=False)
    thick, colour = _cover(params.surface), _colour(params)
    seen = (half, thick, 0.5 * ABOVE_STOP)
    return (solid, _drawn(seen, (middle, RADIUS + thick, top + seen[2]), colour))


def _colour(params: PalletsParams) -> tuple[float, float, float, float]:
    """Of the stops, translucent where they are wide and would hide the tool."""
    colour = FOAM if params.surface == "styrofoam" else WOOD
    return (*colour[:3], 0.3) if params.aside else colour


def _drawn(size: Vector, position: Vector, colour: tuple[float, float, float, float]) -> Geom:
    return Geom(kind="box", size=size, position=position, rgba=colour, collide=False)


def _cover(surface: str) -> float:
    """Half thickness of the stop's cover [m]."""
    return 0.5 * SHEETS if surface == "styrofoam" else 0.011


def _stack(params: PalletsParams, top: float) -> tuple[Geom, ...]:
    ground = Geom(
        kind="box", size=(2.5, 1.2, 0.01), position=(-0.9, 0.0, -0.01), rgba=(0.62, 0.64, 0.66, 1.0), collide=False
    )
    height = top - (SHEETS if params.surface == "styrofoam" else 0.022)
    half, across, count = 0.5 * params.length, _across(params), max(1, round(height / STEP))
    middle, parts = 0.5 + RADIUS - half, [ground]
    for level in range(count):
        low, step = level * height / count, height / count
        parts += [_drawn((half, 0.05, 0.5 * step - 0.011), (middle, across + y, low + 0.5 * step - 0.011), WOOD)
                  for y in (-0.34, 0.0, 0.34)]  # fmt: skip
        deck = (0.80, 0.65, 0.47, 1.0)
        parts.append(_drawn((half, 0.5 * WIDTH, 0.011), (middle, across, low + step - 0.011), deck))
    return tuple(parts)
