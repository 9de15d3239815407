"""Reads an MJCF file as a `DrawnScene`, compiled by MuJoCo, which resolves defaults, frames, units and angles.

Ranges and springs are converted from MuJoCo's `ref` to travel from the start. Geoms without collision (contype and
conaffinity 0) are ignored.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from skillframe.errors import InputError
from skillframe_parts.shapes import DrawnScene, Moving, Shape, refuse

_JOINTS = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
           int(mujoco.mjtJoint.mjJNT_FREE): "free"}  # fmt: skip
_GEOMS = {int(mujoco.mjtGeom.mjGEOM_BOX): "box", int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
          int(mujoco.mjtGeom.mjGEOM_MESH): "mesh"}  # fmt: skip
_COUNTS = {
    "neq": "equality", "ntendon": "tendon", "nu": "actuator", "nflex": "flex", "npair": "pair", "nexclude": "exclude",
    "nmocap": "mocap",
}  # fmt: skip
"""Unsupported elements, by MuJoCo's counts."""
_REFUSED = ("include", "attach", "model", "replicate", "composite", "flexcomp", "plugin")
"""Elements that name other files, generate bodies, or load code."""
_OF_JOINT = {"dof_armature": "armature", "jnt_stiffnesspoly": "stiffness of a higher order",
             "dof_dampingpoly": "damping of a higher order"}  # fmt: skip


def read_mjcf(path: Path, root: ET.Element) -> DrawnScene:
    """Fixed and moving bodies of an MJCF file.

    Raises:
        InputError: MuJoCo refuses it, or it has unsupported elements.
    """
    for element in root.iter():
        if element.tag in _REFUSED:
            raise refuse(path, element)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        said = " ".join(str(error).replace("XML Error: ", "").split())
        raise InputError(path, f"is refused by MuJoCo ({said[:160]})", "correct it there") from None
    for count, name in _COUNTS.items():
        if getattr(model, count, 0):
            raise refuse(path, f"<{name}>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    roots = [b for b in range(1, model.nbody) if model.body_jntnum[b]]
    fixed = _shapes(path, model, data, 0)
    moving = tuple(_moving(path, model, data, body) for body in roots)
    folder = path.parent / spec.meshdir
    return DrawnScene(fixed=fixed, moving=moving, meshes=tuple(folder / m.file for m in spec.meshes if m.file))


def _shapes(path: Path, model: Any, data: Any, body: int) -> tuple[Shape, ...]:
    own = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] == body]
    return tuple(_shape(path, model, data, g) for g in own if model.geom_contype[g] or model.geom_conaffinity[g])


def _shape(path: Path, model: Any, data: Any, geom: int) -> Shape:
    name = model.geom(geom).name or f"geom {geom} of body {model.body(model.geom_bodyid[geom]).name or 'world'!r}"
    kind = _GEOMS.get(int(model.geom_type[geom]))
    if kind is None:
        shape = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
        raise refuse(path, name, f"is a {shape}, which is not read")
    x, y, z = (float(each) for each in model.geom_size[geom])
    size = {"box": (2.0 * x, 2.0 * y, 2.0 * z), "cylinder": (x, 2.0 * y), "mesh": ()}[kind]
    place = {"rotation": data.geom_xmat[geom].reshape(3, 3).copy(), "origin": data.geom_xpos[geom].copy()}
    if kind != "mesh":
        return Shape(name=name, kind=kind, size=size, **place)
    mesh = model.mesh(model.geom_dataid[geom])
    (v, nv), (f, nf) = ((int(a[0]), int(b[0])) for a, b in ((mesh.vertadr, mesh.vertnum), (mesh.faceadr, mesh.facenum)))
    vertices, faces = model.mesh_vert[v : v + nv].astype(float), model.mesh_face[f : f + nf].astype(np.int64)
    return Shape(name=name, kind=kind, vertices=vertices, faces=faces, **place)


def _moving(path: Path, model: Any, data: Any, body: int) -> Moving:
    name = model.body(body).name
    joint = int(model.body_jntadr[body])
    kind = _JOINTS.get(int(model.jnt_type[joint]))
    if not name:
        raise refuse(path, f"body {body}", "moves and has no name")
    if model.body_jntnum[body] != 1 or kind is None:
        raise refuse(path, f"body {name!r}", "has a ball joint or more than one joint, which is not read")
    if model.body_weldid[model.body_parentid[body]] != 0:
        raise refuse(path, f"body {name!r}", "hangs on a body that moves, which is not read")
    dof, at, free = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint]), kind == "free"
    for key, said in _OF_JOINT.items():
        if np.any(getattr(model, key)[joint if key.startswith("jnt") else dof]):
            raise refuse(path, f"body {name!r}: {said}")
    if free and (model.dof_damping[dof] or model.dof_frictionloss[dof]):
        raise refuse(path, f"body {name!r}: damping or friction of a free joint")
    if model.body_gravcomp[body]:
        raise refuse(path, f"body {name!r}: gravcomp")
    shapes = _shapes(path, model, data, body)
    if not shapes:
        raise refuse(path, f"body {name!r}", "moves and has nothing that collides")
    mass = float(model.body_mass[model.body_weldid == body].sum())
    if free:
        return Moving(name=name, joint=kind, shapes=shapes, mass=mass)
    start = float(model.qpos0[at])
    low, high = (float(x) - start for x in model.jnt_range[joint])
    stiffness = float(model.jnt_stiffness[joint])
    return Moving(
        name=name, joint=kind, shapes=shapes, mass=mass, anchor=data.xanchor[joint].copy(),
        axis=data.xaxis[joint].copy(), stiffness=stiffness,
        range=(low, high) if model.jnt_limited[joint] else None,
        rest=float(model.qpos_spring[at]) - start if stiffness else 0.0,
        damping=float(model.dof_damping[dof]), friction=float(model.dof_frictionloss[dof]),
    )  # fmt: skip
