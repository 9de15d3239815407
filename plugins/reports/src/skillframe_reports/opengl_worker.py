"""Child process that draws with MuJoCo's renderer, so that driver crashes stay contained.

Run as a module with MUJOCO_GL set. It reads a scene (.npz: meshes, poses, cameras) and writes raw RGB pictures to
standard output, per frame and camera; see `opengl`. `probe` tests one picture.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np


def scene_model(meshes: list[dict[str, Any]], size: tuple[int, int], field_of_view: float) -> Any:
    """Return a model with one movable, never simulated body per mesh.

    Args:
        meshes: `vertices` (V, 3), `normals` (V, 3), `faces` (F, 3) and `rgba` (4,) of each, in its body's frame.
        size: largest width and height of a picture.
        field_of_view: vertical [rad].
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    spec.visual.global_.fovy = np.rad2deg(field_of_view)
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.45] * 3
    spec.visual.headlight.specular = [0.1] * 3
    spec.visual.map.znear = 0.001
    paper = [level / 255 for level in (250, 250, 251)]  # `raster.PAPER`
    spec.add_texture(
        name="paper", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=paper, rgb2=paper, width=32, height=32,
    )  # fmt: skip
    sun = spec.worldbody.add_light(pos=[0.5, -1.0, 2.5], dir=[-0.2, 0.4, -1.0], diffuse=[0.35] * 3, castshadow=False)
    sun.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    for i, mesh in enumerate(meshes):
        body = spec.worldbody.add_body(  # unused inertia, since a flat piece has none
            name=f"{i}", mocap=True, explicitinertial=True, mass=1.0, inertia=[1.0, 1.0, 1.0]
        )  # fmt: skip
        asset = spec.add_mesh(name=f"{i}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        asset.uservert, asset.userface = mesh["vertices"].ravel(), mesh["faces"].ravel()
        asset.usernormal = mesh["normals"].ravel()
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{i}", rgba=mesh["rgba"], contype=0, conaffinity=0
        )  # fmt: skip
    return spec.compile()


def draw(scene: Mapping[str, Any], out: int) -> None:
    """Write every picture of a scene to a file descriptor.

    Args:
        scene: `count`; of mesh i `vertices_i`, `normals_i`, `faces_i`, `rgba_i`; `position` (K, count, 3) and
            `quaternion` (K, count, 4) of the frames; `cameras` (C, 7): target, distance [m], azimuth, elevation [rad],
            width; `height`; `field_of_view` [rad].
        out: the descriptor.
    """
    import mujoco

    keys = ("vertices", "normals", "faces", "rgba")
    meshes = [{key: scene[f"{key}_{i}"] for key in keys} for i in range(int(scene["count"]))]
    widths, height = [int(camera[6]) for camera in scene["cameras"]], int(scene["height"])
    model = scene_model(meshes, (max(widths), height), float(scene["field_of_view"]))
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, height, max(widths)) as renderer:
        for position, quaternion in zip(scene["position"], scene["quaternion"], strict=True):
            data.mocap_pos[:], data.mocap_quat[:] = position, quaternion[:, [3, 0, 1, 2]]
            mujoco.mj_forward(model, data)
            for camera, width in zip(scene["cameras"], widths, strict=True):
                view = mujoco.MjvCamera()
                view.type = mujoco.mjtCamera.mjCAMERA_FREE
                view.lookat[:], view.distance = camera[:3], camera[3]
                view.azimuth, view.elevation = np.rad2deg(camera[4]) + 180.0, -np.rad2deg(camera[5])  # of the gaze
                renderer.update_scene(data, view)
                first = (max(widths) - width) // 2
                left = memoryview(np.ascontiguousarray(renderer.render()[:, first : first + width]).tobytes())
                while left:
                    left = left[os.write(out, left) :]


def probe() -> bool:
    """Return whether a drawn red square is visible."""
    square = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=float)
    tip = np.array([[-1.0, 0.0, 0.0]])
    vertices = np.concatenate([square, tip])
    normals = np.tile([1.0, 0.0, 0.0], (5, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]])
    scene = {
        "count": 1, "vertices_0": vertices, "normals_0": normals, "faces_0": faces, "rgba_0": np.array([1.0, 0, 0, 1]),
        "position": np.zeros((1, 1, 3)), "quaternion": np.array([[[0.0, 0.0, 0.0, 1.0]]]), "height": 32,
        "cameras": np.array([[0.0, 0, 0, 8.0, 0.0, 0.0, 32]]), "field_of_view": 0.5,
    }  # fmt: skip
    read, write = os.pipe()
    draw(scene, write)
    red, green, _ = np.frombuffer(os.read(read, 32 * 32 * 3), dtype=np.uint8).reshape(32, 32, 3)[16, 16]
    return bool(red > 100 and green < red / 2)


if __name__ == "__main__":
    pictures = os.dup(1)
    os.dup2(2, 1)  # a driver's messages are no pictures
    if sys.argv[1] == "probe":
        sys.exit(not probe())
    with np.load(sys.argv[1]) as given:
        draw({key: given[key] for key in given.files}, pictures)
