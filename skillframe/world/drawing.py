"""A scene's bodies as plain JSON values, so that a trace can be drawn without the world that made it."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.robot.convexity import hull_of
from skillframe.world.convert import BASE, FIXTURE, SPRUNG, TOOL
from skillframe.world.parts import obstacle_geoms
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom
from skillframe.world.visuals import link_geoms


def drawn_bodies(plant: Plant) -> list[dict[str, Any]]:
    """Name and geoms of every body of the plant but the world, in the order of `Plant.body_poses`."""
    scene = plant.scene
    links = link_geoms(plant.robot)
    still = (*links[plant.robot.model.names[0]], *obstacle_geoms(plant.robot).values())
    known = {**links, BASE: still, FIXTURE: scene.fixture, TOOL: scene.tool.geoms}
    known.update({SPRUNG + part.name: part.geoms for part in scene.sprung})
    bodies = []
    for body in range(1, plant.model.nbody):
        name = mujoco.mj_id2name(plant.model, mujoco.mjtObj.mjOBJ_BODY, body)
        bodies.append({"name": name, "geoms": [geom_json(g) for g in known.get(name, ()) if g.visible]})
    return bodies


def geom_json(geom: Geom) -> dict[str, Any]:
    """One geom as plain values, lengths rounded to a micrometre."""
    result: dict[str, Any] = {
        "kind": geom.kind, "size": [round(float(s), 6) for s in geom.size],
        "position": [round(float(p), 6) for p in geom.position],
        "quaternion": [round(float(q), 8) for q in geom.quaternion], "rgba": list(geom.rgba),
    }  # fmt: skip
    if geom.vertices is not None:
        vertices, faces = _surface(geom.vertices, geom.faces)
        result["vertices"], result["faces"] = np.round(vertices, 6).tolist(), faces.tolist()
    return result


def _surface(vertices: Float, faces: NDArray[np.int64] | None) -> tuple[Float, NDArray[np.int64]]:
    """Vertices and triangles of a mesh as it collides: without triangles of its own, those of its hull."""
    hull = hull_of(vertices) if faces is None else None
    if hull is not None:
        return hull.vertices, hull.faces
    return vertices, np.zeros((0, 3), dtype=np.int64) if faces is None else np.asarray(faces)
