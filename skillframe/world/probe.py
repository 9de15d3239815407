"""Overlaps of parts, from a MuJoCo model of their shapes alone.

Results depend on one posture only: `mj_geomDistance` gives the depth of pairs left by the broad phase.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.world.convert import add_geom
from skillframe.world.parts import BITS, OBSTACLE, STANDING, Pair, Solid, compared

TOLERANCE = 1e-3
"""Allowed depth [m], the accuracy of drawn primitives."""
FAR = 1.0
"""Largest distance measured [m]."""
_POINT = "point"


Posture = tuple[Float, Float, Float]
"""(7 F,) positions and quaternions of moving parts, (P, 3) and (P, 4) of parts placed by trial."""


class Overlap(NamedTuple):
    """Indices of two overlapping parts, and depth [m]."""

    pair: Pair
    depth: float


class Probe:
    """Overlaps and distances of parts, but for pairs in `skip` (smaller index first).

    Raises:
        InputError: MuJoCo refuses a shape.

    Attributes:
        free: indices of moving parts, in the order of postures.
        posed: indices of parts placed by each trial.
        reach: (F + P,) their largest distance from the origin [m].
        bounded: all shapes are convex and finite.
    """

    def __init__(self, parts: Sequence[Solid], skip: Collection[Pair]) -> None:
        self.free = [i for i, part in enumerate(parts) if part.role not in (OBSTACLE, STANDING)]
        self.posed = [i for i, part in enumerate(parts) if part.role == STANDING]
        spec = mujoco.MjSpec()
        spec.memory = 4 * 1024 * 1024  # bytes
        for index in (*self.free, *self.posed, *(i for i, p in enumerate(parts) if p.role == OBSTACLE)):
            part = parts[index]
            body = spec.worldbody.add_body(name=_body(index), mocap=part.role == STANDING)
            if part.role not in (OBSTACLE, STANDING):
                body.add_joint(name=_body(index), type=mujoco.mjtJoint.mjJNT_FREE)
                body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
            bits, meets = BITS[part.role]
            for k, (geom, _) in enumerate(part.shapes):
                solid = replace(geom, collide=True)
                add_geom(spec, body, solid, f"{_body(index)}_{k}", contype=bits, conaffinity=meets, friction=0.0)
        for one, two in skip:
            spec.add_exclude(bodyname1=_body(one), bodyname2=_body(two))
        point = spec.worldbody.add_geom(name=_POINT, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-9, 0, 0])
        point.contype = point.conaffinity = 0
        try:
            self._model = spec.compile()
        except ValueError as error:
            text = f"cannot be compared: {' '.join(str(error).removeprefix('Error: ').split())}"
            fix = "correct them in the URDF, or write enabled = false under [collisions] in robot.toml"
            raise InputError("the shapes of the robot's links", text, fix) from None
        self._data = mujoco.MjData(self._model)
        self._point = int(self._model.geom(_POINT).id)
        self._part = np.full(self._model.ngeom, -1)
        self._surface: dict[int, Float] = {}
        for i, part in enumerate(parts):
            for k, (_, surface) in enumerate(part.shapes):
                at = int(self._model.geom(f"{_body(i)}_{k}").id)
                self._part[at] = i
                if surface is not None:
                    turn = np.zeros(9)
                    mujoco.mju_quat2Mat(turn, self._model.geom_quat[at])
                    self._surface[at] = np.asarray((surface - self._model.geom_pos[at]) @ turn.reshape(3, 3))
        self._pairs = np.array([*self._convex_pairs(parts, skip)], dtype=np.int64).reshape(-1, 2)
        planes = self._model.geom_type[self._pairs] == mujoco.mjtGeom.mjGEOM_PLANE
        self._reach = np.where(planes.any(axis=1), np.inf, self._model.geom_rbound[self._pairs].sum(axis=1))
        self.reach = np.array([self._furthest(i) for i in (*self.free, *self.posed)])
        self.bounded = not self._surface and bool(np.isfinite(self.reach).all())

    def _furthest(self, index: int) -> float:
        geoms, model = np.flatnonzero(self._part == index), self._model
        far = np.sqrt(np.square(model.geom_pos[geoms]).sum(axis=-1)) + model.geom_rbound[geoms]
        plane = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_PLANE
        return float(np.where(plane, np.inf, far).max(initial=0.0))

    def _convex_pairs(self, parts: Sequence[Solid], skip: Collection[Pair]) -> Iterator[tuple[int, int]]:
        solid = [g for g in range(self._model.ngeom) if self._part[g] >= 0 and g not in self._surface]
        for one, two in combinations(solid, 2):
            i, k = sorted((int(self._part[one]), int(self._part[two])))
            if i != k and (i, k) not in skip and compared(parts[i].role, parts[k].role):
                yield one, two

    def overlaps(self, free: Float, position: Float, quaternion: Float, tolerance: float = TOLERANCE) -> list[Overlap]:
        """Overlaps above a tolerance [m] in a posture, the deepest first."""
        self._pose(free, position, quaternion)
        mujoco.mj_collision(self._model, self._data)
        if not self._data.ncon:
            return []
        deepest: dict[Pair, float] = {}
        for one, two in np.unique(self._data.contact.geom, axis=0).tolist():
            i, k = sorted((int(self._part[one]), int(self._part[two])))
            depth = -self._distance(one, two)
            for geom, other in ((one, two), (two, one)):
                if geom in self._surface and depth > tolerance:
                    depth = min(depth, self._deepest_point(geom, other))
            if depth > max(tolerance, deepest.get((i, k), 0.0)):
                deepest[i, k] = depth
        return sorted((Overlap(*item) for item in deepest.items()), key=lambda found: -found.depth)

    def _pose(self, free: Float, position: Float, quaternion: Float) -> None:
        data = self._data
        data.qpos[:] = free
        if self.posed:
            data.mocap_pos[:], data.mocap_quat[:] = position, quaternion
        mujoco.mj_kinematics(self._model, data)

    def distances(self, postures: Sequence[Posture], known: Float) -> Float:
        """Smallest distance (N,) of convex shapes that may not touch [m], at most `known` (N,).

        Negative is a depth. Pairs are tested in the order of their bounding spheres' distance until none can be nearer.
        """
        if not len(self._pairs):
            return np.full(len(known), np.nan)
        data = self._data
        at, turn = (np.empty((len(known), *frames.shape)) for frames in (data.geom_xpos, data.geom_xmat))
        for k, posture in enumerate(postures):
            self._pose(*posture)
            at[k], turn[k] = data.geom_xpos, data.geom_xmat
        least = norm(at.take(self._pairs[:, 0], axis=1) - at.take(self._pairs[:, 1], axis=1)) - self._reach
        rows, pairs = np.nonzero(least < known[:, None])
        bounds = least[rows, pairs]
        found, shown = known.tolist(), -1
        for i in np.lexsort((bounds, rows)).tolist():
            k = int(rows[i])
            if bounds[i] < found[k]:
                if k != shown:
                    data.geom_xpos[:], data.geom_xmat[:], shown = at[k], turn[k], k
                one, two = self._pairs[pairs[i]].tolist()
                found[k] = min(found[k], mujoco.mj_geomDistance(self._model, data, one, two, max(found[k], 0.0), None))
        return np.array(found)

    def _deepest_point(self, geom: int, other: int) -> float:
        at, turn = self._frame(geom)
        points = at + self._surface[geom] @ turn.T
        deepest = 0.0
        for point in points[self._inside_box(other, points)]:
            self._data.geom_xpos[self._point] = point
            deepest = max(deepest, -self._distance(self._point, other))
        return deepest

    def _frame(self, geom: int) -> tuple[Float, Float]:
        return self._data.geom_xpos[geom], self._data.geom_xmat[geom].reshape(3, 3)

    def _inside_box(self, geom: int, points: Float) -> Float:
        at, turn = self._frame(geom)
        local = (points - at) @ turn
        if self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            return np.asarray(local[:, 2] < 0.0)
        box = self._model.geom_aabb[geom]
        return np.asarray((np.abs(local - box[:3]) <= box[3:]).all(axis=1))

    def _distance(self, one: int, two: int) -> float:
        return float(mujoco.mj_geomDistance(self._model, self._data, one, two, 0.0, None))


def _body(index: int) -> str:
    return f"p{index}"
