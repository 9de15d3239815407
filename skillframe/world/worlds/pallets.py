"""`pallets`: a machine's load pushed into the corner of a stack of pallets and a stop, bare or under styrofoam.

After the seed's Fig. 11: a) wooden pallets, stiff; b) styrofoam sheets on wooden pallets, soft. Both surfaces of the
corner are plates on springs of so many N/m (`skillframe.world.scene.Sprung`): wood 1e6, styrofoam 3e4, as measured to
work in trials of the whole crane; stacks, sizes and the stop are ours. Pallets are 1.2 x 0.8 x 0.144 m (EN 13698-1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world.scene import Geom, Scene, Sprung, State, Task, Tool, Vector
from skillframe.world.shapes import TOOL_COLOUR
from skillframe.world.worlds.common import TOOL_DOWN, require

RADIUS = 0.05
LENGTH, WIDTH, STEP = 1.2, 0.8, 0.144
POST = 0.2
"""Width of the stop [m]: it stands before the middle of the stack and leaves the view open."""
WOOD, FOAM = (0.76, 0.60, 0.42, 1.0), (0.93, 0.94, 0.96, 1.0)
STIFFNESS = {"wood": 1e6, "styrofoam": 3e4}
SHEETS = 0.2
"""Thickness of the styrofoam sheets [m]: the deepest that a tool may sink into them."""
PLATE = 0.2
"""Half thickness of the plates that are touched, and how far they reach behind each other [m]."""
ABOVE_STOP = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PalletsParams:
    """Parameters of `pallets`.

    Ranges end where parts are too small for a gripper, or too large for a crane (our choice).

    Attributes:
        surface: "wood" or "styrofoam", what stack and stop are covered with.
        stiffness: of both surfaces [N/m, 0 to 5e6]; 0 takes the surface's own, 1e6 of wood and 3e4 of styrofoam.
        friction: Coulomb coefficient [0 to 1].
        pallets: number in the stack; its top is 0.144 m higher with each, styrofoam included [1 to 6].
        plate_mass: mass that moves with each surface [kg, 10kg to 200kg].
        damping_ratio: of that mass on its spring [0.1 to 2].
        above: nominal height of the tool over the stack [m, 1mm to 0.8m].
        away: nominal distance of the tool from the stop [m, 1mm to 0.8m].
        tolerance: distance from the undeflected corner that counts as there [m, 10um to 100mm]. In styrofoam the tool
            sinks as far as its force takes it: there it counts as there once it is no further than this from both
            surfaces, and deeper in both by less than the sheets' thickness.
    """

    surface: Literal["wood", "styrofoam"] = "wood"
    stiffness: float = 0.0
    friction: float = 0.3
    pallets: int = 3
    plate_mass: float = 40.0
    damping_ratio: float = 0.5
    above: float = 0.35
    away: float = 0.45
    tolerance: float = 0.01


def build(params: PalletsParams) -> Scene:
    """Ground is z = 0. The stop's face touches the tool where its x is 0.5 m, the stack's top where z is its height."""
    stiffness = params.stiffness or STIFFNESS[params.surface]
    _check(params, stiffness)
    top, face = params.pallets * STEP, 0.5 + RADIUS
    corner = np.array([face - RADIUS, 0.0, top + RADIUS])

    def distance(state: State) -> Float:
        return norm((state.tip.position - corner)[..., [0, 2]])

    def there(state: State) -> NDArray[np.bool_]:
        return distance(state) < params.tolerance

    def sunk_in(state: State) -> NDArray[np.bool_]:
        left = (corner - state.tip.position)[..., [0, 2]] * [1.0, -1.0]  # the way still to go to stop and stack
        reached: NDArray[np.bool_] = np.all((left < params.tolerance) & (left > -SHEETS), axis=-1)
        return reached

    def sprung(name: str, axis: Vector, geoms: tuple[Geom, ...]) -> Sprung:
        return Sprung(
            name=name, geoms=geoms, axis=axis, stiffness=stiffness, mass=params.plate_mass,
            damping_ratio=params.damping_ratio,
        )  # fmt: skip

    over_stack, by_stop = ({"start.offset_x": sign * 0.2, "start.offset_z": sign * 0.15} for sign in (-1.0, 1.0))
    return Scene(
        name="pallets",
        fixture=(*_stack(top, params.surface), *_wall(top, face + 2.0 * _cover(params.surface))),
        sprung=(
            sprung("stack", (0.0, 0.0, 1.0), _top(top, face, params.surface)),
            sprung("stop", (1.0, 0.0, 0.0), _face(top, face, params.surface)),
        ),
        tool=_tool(),
        friction=params.friction,
        start_tip=(float(corner[0]) - params.away, 0.0, float(corner[2]) + params.above),
        start_quaternion=TOOL_DOWN,
        goal=sunk_in if params.surface == "styrofoam" else there,
        goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
        task=Task(
            direction=(float(np.sqrt(0.5)), 0.0, -float(np.sqrt(0.5))), hand="sliding", starts=(over_stack, by_stop),
            done=sunk_in,
        ),
    )  # fmt: skip


def _check(params: PalletsParams, stiffness: float) -> None:
    require(
        "pallets",
        {
            "1e3 <= stiffness N/m, or 0 for the surface's own": stiffness >= 1e3,
            "a natural frequency of the surfaces below 60 Hz (stiffness over plate_mass below 1.42e5 1/s^2)":
                stiffness < 1.42e5 * params.plate_mass,
        },
        params,
    )  # fmt: skip


def _tool() -> Tool:
    """What touches is a sphere at the machine's tool frame. The load itself is part of the machine."""
    return Tool(
        geoms=(Geom(kind="sphere", size=(RADIUS,), rgba=TOOL_COLOUR),), mass=1e-3, center_of_mass=(0.0, 0.0, 0.0),
        inertia=(1e-6, 1e-6, 1e-6), frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, 0.0)},
    )  # fmt: skip


def _top(top: float, face: float, surface: str) -> tuple[Geom, ...]:
    """The plate under the tool: reaches below the stop, so that nothing slips between. Boards or sheets."""
    low, high = face - LENGTH - PLATE, face + PLATE
    solid = Geom(
        kind="box", size=(0.5 * (high - low), 0.5 * WIDTH, PLATE), position=(0.5 * (low + high), 0.0, top - PLATE),
        visible=False,
    )  # fmt: skip
    middle = face - 0.5 * LENGTH
    if surface == "styrofoam":
        half = 0.5 * SHEETS
        sheets = [_drawn((0.5 * LENGTH, 0.5 * WIDTH, half), (middle, 0.0, top - half), FOAM)]
    else:
        sheets = [_drawn((0.5 * LENGTH, 0.06, 0.011), (middle, y, top - 0.011), WOOD) for y in _BOARDS]
    return (solid, *sheets)


def _face(top: float, face: float, surface: str) -> tuple[Geom, ...]:
    """The stop's plate: reaches as deep below the stack's top as styrofoam may yield."""
    low, high = top - SHEETS - PLATE, top + ABOVE_STOP
    size, middle = (PLATE, 0.5 * POST, 0.5 * (high - low)), 0.5 * (low + high)
    solid = Geom(kind="box", size=size, position=(face + PLATE, 0.0, middle), visible=False)
    thick, colour = _cover(surface), FOAM if surface == "styrofoam" else WOOD
    half = 0.5 * ABOVE_STOP
    return (solid, _drawn((thick, 0.5 * POST, half), (face + thick, 0.0, top + half), colour))


_BOARDS = (-0.33, -0.165, 0.0, 0.165, 0.33)


def _drawn(size: Vector, position: Vector, colour: tuple[float, float, float, float]) -> Geom:
    return Geom(kind="box", size=size, position=position, rgba=colour, collide=False)


def _cover(surface: str) -> float:
    """Half the thickness of what the stop is covered with [m]."""
    return 0.5 * SHEETS if surface == "styrofoam" else 0.011


def _stack(top: float, surface: str) -> tuple[Geom, ...]:
    """Pallets as they look, under the sheets if there are any: three skids and a deck each."""
    ground = Geom(
        kind="box", size=(2.5, 1.2, 0.01), position=(-0.9, 0.0, -0.01), rgba=(0.62, 0.64, 0.66, 1.0), collide=False
    )
    height = top - (SHEETS if surface == "styrofoam" else 0.022)
    middle, count = 0.5 + RADIUS - 0.5 * LENGTH, max(1, round(height / STEP))
    parts = [ground]
    for level in range(count):
        low, step = level * height / count, height / count
        parts += [_drawn((0.5 * LENGTH, 0.05, 0.5 * step - 0.011), (middle, y, low + 0.5 * step - 0.011), WOOD)
                  for y in (-0.34, 0.0, 0.34)]  # fmt: skip
        deck = (0.80, 0.65, 0.47, 1.0)
        parts.append(_drawn((0.5 * LENGTH, 0.5 * WIDTH, 0.011), (middle, 0.0, low + step - 0.011), deck))
    return tuple(parts)


def _wall(top: float, behind: float) -> tuple[Geom, ...]:
    """What holds the stop: a post behind it, with 10 mm for the stop to yield."""
    grey = (0.45, 0.48, 0.52, 1.0)
    height = 0.5 * (top + ABOVE_STOP)
    return (_drawn((0.06, 0.5 * POST, height), (behind + 0.07, 0.0, height), grey),)
