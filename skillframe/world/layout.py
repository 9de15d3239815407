"""Addresses of an arm in a compiled model, and its Jacobian from MuJoCo's quantities.

For a point p, the column of a hinge with axis a through c is [a x (p - c); a], of a slide [a; 0], of a free base [1,
-[r]x R; 0, R] (linear velocity in base axes, angular in body axes).
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross
from skillframe.robot.model import RobotModel
from skillframe.world.convert import BASE, FIXTURE, MOUNT, SECOND, SENSOR, SPRUNG, TOOL


class Layout:
    """Body ids, joint addresses and coordinate orders of an arm in a compiled model."""

    def __init__(self, model: mujoco.MjModel, sensor: str = SENSOR, tool: str = TOOL) -> None:
        self.model = model
        self.sensor, self.tool, self.fixture = (model.body(name).id for name in (sensor, tool, FIXTURE))
        self.root = int(model.body_rootid[self.tool])
        first = int(model.sensor(f"{sensor}_force").adr[0])
        self.readings = slice(first, first + 6)
        names, others = [model.body(b).name for b in range(model.nbody)], (BASE, FIXTURE, TOOL, SENSOR, SECOND)
        self.links = np.array([b for b, n in enumerate(names) if b and n not in others and not n.startswith(SPRUNG)])
        self.free = bool(model.njnt and model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE)
        named = [model.joint(j).name.startswith(SPRUNG) for j in range(model.njnt)]
        self.sprung = np.flatnonzero(np.array(named, dtype=bool)[model.dof_jntid])
        balls = [j for j in range(model.njnt) if named[j] and model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL]
        self.balls = model.jnt_qposadr[balls].astype(np.int64)
        mount = [j for j in range(model.njnt) if model.joint(j).name.startswith(MOUNT)]
        self.mount, self.mount_places = (part[mount].astype(np.int64) for part in (model.jnt_dofadr, model.jnt_qposadr))
        joints = model.dof_jntid
        single = (model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE) | (
            model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        )
        self.places = np.where(single, model.jnt_qposadr[joints], 0).astype(np.int64)
        ancestors, body = set(), self.sensor
        while body:
            ancestors.add(body)
            body = int(model.body_parentid[body])
        joints = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in ancestors]
        hinge, slide = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
        hinges = np.array([j for j in joints if model.jnt_type[j] == hinge], dtype=int)
        slides = np.array([j for j in joints if model.jnt_type[j] == slide], dtype=int)
        self.turns, self.shifts = len(hinges) > 0, len(slides) > 0
        self.hinges, self.hinge_dofs = _span(hinges), _span(model.jnt_dofadr[hinges])
        self.slides, self.slide_dofs = _span(slides), _span(model.jnt_dofadr[slides])
        self.dofs = np.sort(model.jnt_dofadr[np.concatenate([hinges, slides])]).astype(np.int64)
        rows = np.repeat(np.arange(model.nv), model.M_rownnz)
        columns = np.concatenate(
            [model.M_colind[a : a + n] for a, n in zip(model.M_rowadr, model.M_rownnz, strict=True)]
            or [np.zeros(0, int)]
        )
        self._rows, self._columns = rows.astype(np.int64), columns.astype(np.int64)
        self._ordered: tuple[Any, list[tuple[int, int, int]]] = (None, [])
        """Cached Pinocchio model and, of each joint, size and both addresses."""

    def body_of(self, geom: int) -> str:
        """Readable name of a geom's body: "the tool", "the fixture", "the part 'lid'"."""
        name = self.model.body(int(self.model.geom_bodyid[geom])).name
        return f"the part {name.removeprefix(SPRUNG)!r}" if name.startswith(SPRUNG) else f"the {name}"

    def friction_share(self, robot: RobotModel) -> Float:
        """(nv,) share of the sampled joint friction."""
        share = np.ones(self.model.nv)
        share[self.sprung] = 0.0
        for name, part in robot.spec.friction_share.items():
            share[self.model.joint(name).dofadr[0]] = part
        return share

    def jacobian(self, anchor: Float, axis: Float, xmat: Float, point: Float) -> Float:
        """(N, 6, nv) Jacobian at a point (N, 3), by the formula of the module."""
        jacobian = np.zeros((len(point), 6, self.model.nv))
        if self.turns:
            a = axis[:, self.hinges]
            lever = point[:, None] - anchor[:, self.hinges]
            jacobian[:, :3, self.hinge_dofs] = np.swapaxes(cross(a, lever), 1, 2)
            jacobian[:, 3:, self.hinge_dofs] = np.swapaxes(a, 1, 2)
        if self.shifts:
            jacobian[:, :3, self.slide_dofs] = np.swapaxes(axis[:, self.slides], 1, 2)
        if self.free:
            body = int(self.model.jnt_bodyid[0])
            rotation = xmat[:, body].reshape(-1, 3, 3)
            r = point - anchor[:, 0]
            jacobian[:, [0, 1, 2], [0, 1, 2]] = 1.0
            jacobian[:, 3:, 3:6] = rotation
            jacobian[:, :3, 3:6] = np.swapaxes(cross(np.swapaxes(rotation, 1, 2), r[:, None]), 1, 2)
        return jacobian

    def dense(self, sparse: Float) -> Float:
        """Symmetric matrices (N, nv, nv) from MuJoCo's sparse lower triangles."""
        nv = self.model.nv
        result = np.zeros((len(sparse), nv, nv))
        result[:, self._rows, self._columns] = sparse
        result[:, self._columns, self._rows] = sparse
        return result

    def _order(self, model: Any) -> list[tuple[int, int, int]]:
        if self._ordered[0] is not model:
            joints = [(model.joints[i], model.names[i]) for i in range(1, model.njoints)]
            places = [(j.nq, j.idx_q, int(self.model.joint(name).qposadr[0])) for j, name in joints]
            self._ordered = model, places
            single = np.array([place[1:] for place in places if place[0] == 1], dtype=np.int64).reshape(-1, 2)
            self._single = _span(single[:, 0]), single[:, 1]
        return self._ordered[1]

    def to_mujoco(self, model: Any, configuration: Float) -> Float:
        """Convert a Pinocchio configuration (N, nq): quaternions w first, continuous joints as angles."""
        qpos = np.zeros((len(configuration), self.model.nq))
        for size, start, address in self._order(model):
            if size == 7:
                qpos[:, address : address + 7] = configuration[:, start + np.array([0, 1, 2, 6, 3, 4, 5])]
            elif size == 2:
                qpos[:, address] = np.arctan2(configuration[:, start + 1], configuration[:, start])
            else:
                qpos[:, address] = configuration[:, start]
        return qpos

    def to_pinocchio(self, model: Any, qpos: Float) -> Float:
        """The inverse of `to_mujoco`."""
        configuration = np.zeros((len(qpos), model.nq))
        order = self._order(model)
        starts, addresses = self._single
        configuration[:, starts] = qpos.take(addresses, axis=1)
        for size, start, address in order:
            if size == 7:
                configuration[:, start : start + 7] = qpos[:, address + np.array([0, 1, 2, 4, 5, 6, 3])]
            elif size == 2:
                angle = qpos[:, address]
                configuration[:, start], configuration[:, start + 1] = np.cos(angle), np.sin(angle)
        return configuration


def _span(indices: NDArray[np.int64]) -> slice | NDArray[np.int64]:
    first, count = (int(indices[0]) if len(indices) else 0), len(indices)
    return slice(first, first + count) if np.array_equal(indices, np.arange(first, first + count)) else indices
