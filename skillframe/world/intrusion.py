"""Does a link of the robot stand in the fixture? Links do not collide: a run could pass through a wall and succeed.

The depth of a pair of convex shapes is MuJoCo's own (`mj_geomDistance`: the shortest way that parts them), asked of a
model of its own in which nothing touches anything. Most pairs are ruled out before: the sphere around a link's shape
against sphere and box around all of a body of the fixture, then against the box of each shape. All of it looks at one
trial at a time, so that a trial's answer does not depend on its neighbours.

The tool, the payload and the second arm that holds the fixture are meant to touch it and are left out (`link_shapes`).
Only shapes of the fixture that collide count. A link may be `TOLERANCE` deep: drawn shapes are no better than that.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, matrix_from_quaternion, norm, rotate
from skillframe.world.convert import FIXTURE, SPRUNG, TOOL, add_geom
from skillframe.world.link_shapes import LinkShape, link_shapes
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom

TOLERANCE = 1e-3
"""Depth of a link in the fixture that is let pass [m]; ours: the resolution of drawn primitives."""
_PROBE = "probe"
_FAR = 1e3  # m; half size of a plane, which has no end


class _Shapes(NamedTuple):
    """Shapes of one side: geom ids in the probe model, body ids in the plant, pose in the body, half sizes and radius.

    The box (centre and half sizes) and the sphere around it are in the geom's own frame.
    """

    geom: NDArray[np.int64]
    body: NDArray[np.int64]
    position: Float
    rotation: Float
    centre: Float
    half: Float
    radius: Float


class _Box(NamedTuple):
    """A box in a body's frame: the body's id, middle, half sizes, squared distances (L,) within which links count."""

    body: int
    middle: Float
    half: Float
    reach_squared: Float


class LinkIntrusion:
    """Looks for links inside the fixture of a plant.

    Args:
        plant: its robot, its scene, and in each call its state.
    """

    def __init__(self, plant: Plant) -> None:
        self._model = plant.model
        links = [shape for shape in link_shapes(plant.robot) if not self._holds_fixture(self._body(shape.body))]
        fixture = [(FIXTURE, g) for g in plant.scene.fixture if g.collide]
        fixture += [(SPRUNG + part.name, g) for part in plant.scene.sprung for g in part.geoms if g.collide]
        self.nothing = not links or not fixture
        if self.nothing:
            return
        self._names = [shape.link for shape in links]
        self._points = [shape.surface for shape in links]
        self._compile(links, fixture)

    def _body(self, name: str) -> int:
        return 0 if name == "universe" else int(self._model.body(name).id)

    def _ancestors(self, body: int) -> set[int]:
        found = set()
        while body:
            found.add(body)
            body = int(self._model.body_parentid[body])
        return found

    def _holds_fixture(self, body: int) -> bool:
        """Is it part of the arm that holds the fixture, and of no other?"""
        fixture, tool = (self._ancestors(int(self._model.body(name).id)) for name in (FIXTURE, TOOL))
        return bool(self._ancestors(body) & (fixture - tool))

    def _compile(self, links: list[LinkShape], fixture: list[tuple[str, Geom]]) -> None:
        spec = mujoco.MjSpec()
        geoms = [(shape.body, shape.geom) for shape in links] + fixture
        for index, (_, geom) in enumerate(geoms):
            add_geom(spec, spec.worldbody, geom, f"g{index}", contype=0, conaffinity=0, friction=0.0)
        spec.worldbody.add_geom(name=_PROBE, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-9, 0, 0])
        self._probe = spec.compile()
        self._data = mujoco.MjData(self._probe)
        ids = np.array([self._probe.geom(f"g{index}").id for index in range(len(geoms))])
        bodies = np.array([self._body(body) for body, _ in geoms])
        self._links = self._shapes(ids[: len(links)], bodies[: len(links)])
        self._inside = self._links.position + rotate(self._links.rotation, self._links.centre)
        self._fixture = self._shapes(ids[len(links) :], bodies[len(links) :])
        self._boxes = [self._box_around(body) for body in dict.fromkeys(self._fixture.body.tolist())]
        self._point_geom = int(self._probe.geom(_PROBE).id)

    def _shapes(self, geom: NDArray[np.int64], body: NDArray[np.int64]) -> _Shapes:
        probe = self._probe
        centre, half = probe.geom_aabb[geom, :3].copy(), probe.geom_aabb[geom, 3:].copy()
        endless = probe.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE  # all that is below it counts as inside
        centre[endless], half[endless] = (0.0, 0.0, -_FAR), _FAR
        rotation = matrix_from_quaternion(probe.geom_quat[geom][:, [1, 2, 3, 0]])
        return _Shapes(geom, body, probe.geom_pos[geom].copy(), rotation, centre, half, norm(half))

    def _box_around(self, body: int) -> _Box:
        """The box around all fixture shapes of a body."""
        mine = self._fixture.body == body
        rotation = self._fixture.rotation[mine]
        centre = self._fixture.position[mine] + rotate(rotation, self._fixture.centre[mine])
        half = rotate(np.abs(rotation), self._fixture.half[mine])
        low, high = (centre - half).min(axis=0), (centre + half).max(axis=0)
        box = 0.5 * (high - low)
        return _Box(body, 0.5 * (low + high), box, (self._links.radius + norm(box)) ** 2)

    def causes(self, plant: Plant, rows: NDArray[np.int64]) -> list[tuple[int, str]]:
        """Of some trials those with a link in the fixture, each with the deepest link in words."""
        if self.nothing:
            return []
        position, rotation = plant.body_frames()
        centre = self._centres(position, rotation, rows)
        found: dict[int, tuple[float, int]] = {}
        for box in self._boxes:
            for k, link in self._near(centre, position[rows, box.body], rotation[rows, box.body], box):
                row = int(rows[k])
                depth = self._depth(position[row], rotation[row], link, box.body, centre[k, link])
                if depth > max(TOLERANCE, found.get(row, (0.0, 0))[0]):
                    found[row] = depth, link
        return [(row, _in_words(self._names[link], depth)) for row, (depth, link) in sorted(found.items())]

    def _centres(self, position: Float, rotation: Float, rows: NDArray[np.int64]) -> Float:
        """(R, L, 3) middles of the links' shapes in base."""
        bodies, inside = self._links.body, self._inside
        at, turn = position[rows[:, None], bodies], rotation[rows[:, None], bodies]
        for k in range(3):  # sums of columns: a stack of small matrix products takes several times as long
            at += turn[..., k] * inside[:, k, None]
        return at

    def _near(self, centre: Float, position: Float, rotation: Float, box: _Box) -> list[tuple[int, int]]:
        """Pairs of a row and a link whose spheres reach into the box around a body of the fixture."""
        around = centre - (position + rotate(rotation, box.middle))[:, None]
        k, link = np.nonzero(np.vecdot(around, around) < box.reach_squared)
        if not len(k):
            return []
        local = _into(around[k, link], rotation[k])
        close = _beyond(local, box.half) < self._links.radius[link]
        return list(zip(k[close].tolist(), link[close].tolist(), strict=True))

    def _depth(self, position: Float, rotation: Float, link: int, body: int, centre: Float) -> float:
        """How deep a link's shape stands in a body of the fixture at worst [m], 0 if it does not. For one trial."""
        fixture = self._fixture
        mine = np.flatnonzero(fixture.body == body)
        at = position[body] + rotate(rotation[body], fixture.position[mine])
        turn = rotation[body] @ fixture.rotation[mine]
        local = _into(centre - at, turn) - fixture.centre[mine]
        near = _beyond(local, fixture.half[mine]) < self._links.radius[link]
        if not near.any():
            return 0.0
        self._place(self._links, link, position, rotation)
        deepest = 0.0
        for k in np.flatnonzero(near).tolist():
            self._set(int(fixture.geom[mine[k]]), at[k], turn[k])
            deepest = max(deepest, self._pair(link, int(fixture.geom[mine[k]]), position, rotation))
        return deepest

    def _pair(self, link: int, wall: int, position: Float, rotation: Float) -> float:
        """Depth of two shapes in each other. For a mesh that is not convex, that of its deepest point."""
        depth = -self._distance(int(self._links.geom[link]), wall)
        points = self._points[link]
        if points is None or depth <= TOLERANCE:
            return depth
        body = int(self._links.body[link])
        deepest = 0.0
        for point in position[body] + rotate(rotation[body], points):
            self._data.geom_xpos[self._point_geom] = point
            deepest = max(deepest, -self._distance(self._point_geom, wall))
        return deepest

    def _distance(self, first: int, second: int) -> float:
        return float(mujoco.mj_geomDistance(self._probe, self._data, first, second, 0.0, None))

    def _place(self, shapes: _Shapes, index: int, position: Float, rotation: Float) -> None:
        body = int(shapes.body[index])
        at = position[body] + rotate(rotation[body], shapes.position[index])
        self._set(int(shapes.geom[index]), at, rotation[body] @ shapes.rotation[index])

    def _set(self, geom: int, position: Float, rotation: Float) -> None:
        self._data.geom_xpos[geom] = position
        self._data.geom_xmat[geom] = rotation.ravel()


def _into(vector: Float, rotation: Float) -> Float:
    """Vectors (..., 3) in the axes that a rotation (..., 3, 3) stands for."""
    return rotate(np.swapaxes(rotation, -1, -2), vector)


def _beyond(point: Float, half: Float) -> Float:
    """Distance of points (..., 3) from a box around the origin, 0 inside."""
    return norm(np.maximum(np.abs(point) - half, 0.0))


def _in_words(link: str, depth: float) -> str:
    return f"link {link!r} is {1000.0 * depth:.0f} mm inside the fixture"
