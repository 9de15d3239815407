"""`task_board`: five places on one board, worked in order by a pin with a round end.

    hole     insert the pin to the bottom            slot     set it down and slide it to the slot's end
    groove   slide down either side                  corner   set it down and push it into the corner
    button   press on a face with 8 N

Each place has its own frame, with z up. `x`, `y`, `yaw` and `tilt` move the board. A skill is given the poses of the
places, to which `fixture.*` adds an error. The goal is that of the last place; `done_in_order` checks the whole run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, matrix_from_quaternion, norm, quaternion_from_matrix, rotate, rotation_matrix
from skillframe.world import (
    FIXTURE_COLOUR,
    TOOL_COLOUR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Geom,
    Scene,
    State,
    Task,
    Vector,
    hole,
    require,
    shaft,
    slope,
    tilt_of,
    tool,
)
from skillframe_worlds.turned import as_vector

R, PLAY, LENGTH = 0.006, 0.0005, 0.05  # radius, play and length of the pin [m]
DEEP, SLOT_DEEP, SLOT_HALF = 0.020, 0.008, 0.03  # [m]
NEAR = 0.001  # tolerance at a place's end [m]
ABOVE, BEFORE = 0.05, 0.014  # height at which the tool is carried, and from which it sets off [m]
Quaternion = tuple[float, float, float, float]
Done = Callable[[State], NDArray[np.bool_]]


class Place(NamedTuple):
    """A place in its own frame: geoms, first and last tip position [m], and (push, done) of its stages."""

    geoms: tuple[Geom, ...]
    begin: Vector
    end: Vector
    stages: tuple[tuple[Vector, Done], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardParams:
    """Parameters of `task_board`.

    Attributes:
        layout: which of three boards [1 to 3].
        count: number of places, from the first [1 to 5].
        x, y: position of the board [m, -0.1m to 0.1m].
        yaw: rotation about its normal [rad, -180deg to 180deg].
        tilt: rotation about its own x axis [rad, -20deg to 20deg].
        friction: Coulomb coefficient [0 to 5].
    """

    layout: int = 1
    count: int = 5
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    tilt: float = 0.0
    friction: float = 0.2


# in working order: kind, x, y, height [m], tilts about x and y, turn about z [degrees]
LAYOUTS = {
    1: (
        ("hole", -0.10, 0.06, 0.00, 0, 0, 0),
        ("slot", 0.00, 0.06, 0.00, 0, 0, 0),
        ("button", 0.10, 0.06, 0.01, 0, 20, 0),
        ("groove", 0.06, -0.06, 0.01, 0, 0, 30),
        ("corner", -0.07, -0.06, 0.00, 0, 0, 0),
    ),
    2: (
        ("corner", 0.10, 0.07, 0.00, 0, 0, 90),
        ("button", 0.00, 0.05, 0.02, 25, 0, 0),
        ("hole", -0.10, 0.05, 0.01, 0, -15, 0),
        ("slot", -0.06, -0.07, 0.00, 0, 0, 45),
        ("groove", 0.07, -0.06, 0.00, 10, 0, -60),
    ),
    3: (
        ("groove", -0.10, -0.06, 0.02, 0, 10, 90),
        ("hole", 0.00, -0.06, 0.00, 20, 0, 0),
        ("corner", 0.10, -0.05, 0.00, 0, 0, 180),
        ("button", 0.07, 0.07, 0.00, -20, 15, 0),
        ("slot", -0.06, 0.07, 0.01, 0, 12, -90),
    ),
}  # fmt: skip


def build(params: BoardParams) -> Scene:
    """The scene."""
    require("task_board", {"layout = 1, 2 or 3": params.layout in LAYOUTS}, params)
    board = Pose(
        np.array([params.x, params.y, 0.0]),
        rotation_matrix([0.0, 0.0, params.yaw]) @ rotation_matrix([params.tilt, 0.0, 0.0]),
    )
    placed = [(name, board.compose(pose), PLACES[name]) for name, pose in layout_poses(params.layout)[: params.count]]
    stages = [task for name, pose, place in placed for task in _tasks(pose, place)]
    _, last, place = placed[-1]
    stages = stages[:-1]  # without the last withdrawal
    done = _seen_from(last, place.stages[-1][1])
    end = last.position
    plate = Geom(kind="box", size=(0.17, 0.13, 0.005), position=(0.0, 0.0, -0.06), rgba=FIXTURE_COLOUR)
    pin = Geom(
        kind="capsule", size=(R, 0.5 * LENGTH), position=(0.0, 0.0, WRIST_TO_TIP - 0.5 * LENGTH), rgba=TOOL_COLOUR
    )
    return Scene(
        name="task_board",
        fixture=(_moved(plate, board), *(_moved(geom, pose) for _, pose, place in placed for geom in place.geoms)),
        tool=tool((pin, shaft(0.01, 0.01, WRIST_TO_TIP - LENGTH - R)), hand="grip"),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.14),
        start_quaternion=TOOL_DOWN,
        goal=done,
        goal_error=lambda state: (norm(state.tip.position - end), 0.0 * tilt_of(state)),
        task=replace(stages[0], then=tuple(stages[1:])),
        places={name: (as_vector(pose.position), _quaternion(pose.rotation)) for name, pose, _ in placed},
    )


def layout_poses(layout: int) -> list[tuple[str, Pose]]:
    """Names and poses of a layout's places in the board's frame, in working order."""
    rows = []
    for name, x, y, height, about_x, about_y, turn in LAYOUTS[layout]:
        angles = np.deg2rad([about_x, about_y, turn])
        orientation = [rotation_matrix(angle * axis) for angle, axis in zip(angles, np.eye(3), strict=True)]
        rows.append((name, Pose(np.array([x, y, height]), orientation[0] @ orientation[1] @ orientation[2])))
    return rows


def done_in_order(scene: Scene, tip: Pose, wrench: Float) -> int:
    """Number of places that a whole run did in order.

    Args:
        scene: of this world.
        tip: (T, 3), (T, 3, 3) in the fixture frame.
        wrench: (T, 6) of the environment on the tool at the tip, fixture axes.
    """
    first, count = 0, 0
    for name, (position, quaternion) in scene.places.items():
        pose = Pose(np.array(position), matrix_from_quaternion(quaternion))
        later = State(Pose(tip.position[first:], tip.rotation[first:]), wrench[first:])
        for _, done in PLACES[name].stages[-1:]:
            met = np.flatnonzero(_seen_from(pose, done)(later))
            if not met.size:
                return count
            first += int(met[0])
        count += 1
    return count


def _tasks(pose: Pose, place: Place) -> list[Task]:
    aligned = _quaternion(pose.rotation @ matrix_from_quaternion(TOOL_DOWN))
    up = pose.rotation[:, 2]

    def carry(tip: Float, last: bool = False) -> Task:
        def there(state: State) -> NDArray[np.bool_]:
            near: NDArray[np.bool_] = norm(state.tip.position - tip) < (0.01 if last else 0.002)
            return near

        return Task(direction=None, to=as_vector(tip + 0.04 * up), aligned=aligned, hand="carrying", done=there)

    begin = pose.at(np.array(place.begin)).position
    work = [
        Task(direction=as_vector(rotate(pose.rotation, np.array(push))), hand="sliding", done=_seen_from(pose, done))
        for push, done in place.stages
    ]
    end = pose.at(np.array(place.end)).position
    return [carry(begin + ABOVE * up), carry(begin), *work, carry(end + ABOVE * up, last=True)]


def _seen_from(pose: Pose, done: Done) -> Done:
    back = pose.inverse()

    def predicate(state: State) -> NDArray[np.bool_]:
        turn = np.broadcast_to(back.rotation, state.tip.rotation.shape)
        tip = Pose(rotate(turn, state.tip.position) + back.position, turn @ state.tip.rotation)
        here = norm(tip.position) < 0.045  # m, the extent of a place
        halves = [rotate(turn, half) for half in (state.wrench[..., :3], state.wrench[..., 3:])]
        met: NDArray[np.bool_] = here & done(State(tip, np.concatenate(halves, axis=-1)))
        return met

    return predicate


def _moved(geom: Geom, pose: Pose) -> Geom:
    inner = pose.compose(Pose(np.array(geom.position), matrix_from_quaternion(geom.quaternion)))
    return replace(geom, position=as_vector(inner.position), quaternion=_quaternion(inner.rotation))


def _quaternion(rotation: Float) -> Quaternion:
    x, y, z, w = quaternion_from_matrix(rotation)
    return (float(x), float(y), float(z), float(w))


def _box(low: Sequence[float], high: Sequence[float]) -> Geom:
    a, b = np.array(low), np.array(high)
    return Geom(kind="box", size=as_vector(0.5 * (b - a)), position=as_vector(0.5 * (a + b)), rgba=FIXTURE_COLOUR)


def _hole() -> Place:
    def inside(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = (state.tip.position[..., 2] < R - DEEP + NEAR) & (state.wrench[..., 2] > 5.0)  # N
        return there

    return Place(
        hole(R + PLAY, DEEP, 24, 0.015), (0.0, 0.0, BEFORE), (0.0, 0.0, R - DEEP), (((0.0, 0.0, -1.0), inside),)
    )


def _slot() -> Place:
    half, floor = R + PLAY, R - SLOT_DEEP
    geoms = (
        _box((-0.045, -0.03, -0.03), (0.045, 0.03, -SLOT_DEEP)),
        *(_box((-0.045, min(s * half, s * 0.03), -SLOT_DEEP), (0.045, max(s * half, s * 0.03), 0.0)) for s in (1, -1)),
        *(_box((min(s * SLOT_HALF, s * 0.045), -half, -SLOT_DEEP), (max(s * SLOT_HALF, s * 0.045), half, 0.0))
          for s in (1, -1)),
    )  # fmt: skip

    def down(state: State) -> NDArray[np.bool_]:
        return state.tip.position[..., 2] < floor + NEAR

    def at_end(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = down(state) & (state.tip.position[..., 0] > SLOT_HALF - R - NEAR)
        return there

    return Place(
        geoms,
        (-0.015, 0.0, BEFORE),
        (SLOT_HALF - R, 0.0, floor),
        (((0.0, 0.0, -1.0), down), ((0.8, 0.0, -0.6), at_end)),
    )


def _button() -> Place:
    def pressed(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = (state.wrench[..., 2] > 8.0) & (np.abs(state.tip.position[..., 2] - R) < 0.002)
        return there

    face = _box((-0.02, -0.02, -0.05), (0.02, 0.02, 0.0))
    return Place((face,), (0.0, 0.0, R + BEFORE), (0.0, 0.0, R), (((0.0, 0.0, -1.0), pressed),))


def _groove() -> Place:
    resting = float(R * np.sqrt(2.0))

    def at_bottom(state: State) -> NDArray[np.bool_]:
        x, z = state.tip.position[..., 0], state.tip.position[..., 2]
        there: NDArray[np.bool_] = (np.abs(x) < NEAR) & (np.abs(z - resting) < 0.002)
        return there

    sides = (slope(np.pi / 4, 0.0, 0.04, 0.05), slope(np.pi / 4, np.pi, 0.04, 0.05))
    return Place(sides, (0.012, 0.0, resting + 0.012 + BEFORE), (0.0, 0.0, resting), (((0.0, 0.0, -1.0), at_bottom),))


def _corner() -> Place:
    geoms = (
        _box((-0.035, -0.035, -0.04), (R + 0.01, R + 0.01, -R)),
        _box((R, -0.035, -0.04), (R + 0.01, R + 0.01, 0.008)),
        _box((-0.035, R, -0.04), (R, R + 0.01, 0.008)),
    )

    def down(state: State) -> NDArray[np.bool_]:
        return state.tip.position[..., 2] < NEAR

    def in_corner(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = np.all(np.abs(state.tip.position) < 0.0015, axis=-1)
        return there

    return Place(
        geoms, (-0.018, -0.018, BEFORE), (0.0, 0.0, 0.0), (((0.0, 0.0, -1.0), down), ((0.6, 0.6, -0.53), in_corner))
    )


PLACES = {"hole": _hole(), "slot": _slot(), "button": _button(), "groove": _groove(), "corner": _corner()}
