"""Pictures of a stage by MuJoCo's renderer, where OpenGL works. Drawn by a child process from the trace's shapes.

Nobody knows whether OpenGL works before it has drawn: libraries may be missing, drivers crash or hang. So `backend`
lets a child draw a square and looks at it, and `pictures` reads the frames from a child under a deadline. EGL uses a
graphics card, or Mesa's software; OSMesa is software that needs neither card nor display.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.reports.raster import Image
from skillframe.reports.shapes import Mesh
from skillframe.reports.stage import Camera, Stage

BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",), "win32": ("wgl",)}
"""By system what MUJOCO_GL may be without a display, in the order in which it is tried."""
PATIENCE_S = 60.0
"""For a child to start, or to draw a frame."""
WORKER = "skillframe.reports.opengl_worker"
LEAST_VERTICES = 4
"""Of a mesh, by MuJoCo's rules."""


class NoPicture(SkillframeError):
    """The child drew nothing, or stopped drawing."""


@lru_cache(maxsize=1)
def backend() -> str | None:
    """The first backend of OpenGL that draws on this machine, or None. A few seconds, once a process."""
    return next((name for name in BACKENDS.get(sys.platform, ()) if _draws(name)), None)


def _draws(name: str) -> bool:
    command = [sys.executable, "-m", WORKER, "probe"]
    with suppress(OSError, subprocess.TimeoutExpired):
        run = subprocess.run(
            command, env=_environment(name), stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE_S,
            check=False,
        )  # fmt: skip
        return run.returncode == 0
    return False


def _environment(name: str) -> dict[str, str]:
    platform = {"PYOPENGL_PLATFORM": name} if name in ("egl", "osmesa") else {}
    return {**os.environ, "MUJOCO_GL": name, **platform}


def pictures(
    stage: Stage, samples: Sequence[int], cameras: Sequence[tuple[Camera, int]], height: int, name: str
) -> Iterator[list[Image]]:
    """Of every sample one picture (height, width, 3) for each camera.

    Args:
        stage: what is shown; fixtures that are cut open are shown so.
        samples: which samples.
        cameras: each with the width of its picture; they have one field of view.
        height: of all pictures.
        name: the backend.

    Raises:
        NoPicture: the child ended, or drew nothing for a minute.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.npz"
        _write_scene(file, stage, samples, cameras, height)
        words = Path(folder) / "words.txt"
        with words.open("wb") as said:
            child = subprocess.Popen(
                [sys.executable, "-m", WORKER, str(file)], env=_environment(name), stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=said,
            )  # fmt: skip
        try:
            for _ in samples:
                pair = [_picture(child, width, height) for _, width in cameras]
                if any(picture is None for picture in pair):
                    raise NoPicture(f"OpenGL stopped drawing{_why(words)}")
                yield [picture for picture in pair if picture is not None]
        finally:
            child.kill()
            child.communicate()


def _why(words: Path) -> str:
    """What the child said of its error, in brackets. "" if nothing."""
    lines = words.read_text("utf-8", "replace").splitlines()
    error = next((line.strip() for line in reversed(lines) if "Error: " in line), "")
    return f" ({error})" if error else ""


def _picture(child: subprocess.Popen[bytes], width: int, height: int) -> Image | None:
    assert child.stdout is not None
    deadline = threading.Timer(PATIENCE_S, child.kill)
    deadline.start()
    try:
        content = child.stdout.read(width * height * 3)
    finally:
        deadline.cancel()
    if len(content) < width * height * 3:
        return None
    return np.frombuffer(content, dtype=np.uint8).reshape(height, width, 3)


def _write_scene(
    file: Path, stage: Stage, samples: Sequence[int], cameras: Sequence[tuple[Camera, int]], height: int
) -> None:
    parts = [(body, part) for body in range(len(stage.names)) for part in _of_one_color(_shown(stage, body))]
    arrays: dict[str, Any] = {}
    for i, (_, part) in enumerate(parts):
        arrays |= {f"vertices_{i}": part.vertices, f"normals_{i}": part.normals, f"faces_{i}": part.faces}
        arrays[f"rgba_{i}"] = part.colors[0]
    bodies = [body for body, _ in parts]
    frames = np.asarray(samples)
    rows = [[*c.target, c.distance, c.azimuth, c.elevation, width] for c, width in cameras]
    np.savez(
        file, count=len(parts), position=stage.position[frames][:, bodies],
        quaternion=stage.quaternion[frames][:, bodies],
        cameras=np.array(rows, dtype=float), height=height, field_of_view=cameras[0][0].field_of_view, **arrays,
    )  # fmt: skip


def _shown(stage: Stage, body: int) -> Mesh:
    """A body's mesh in its frame, cut open if it is."""
    cut = stage.cut[body]
    return stage.meshes[body] if cut is None else cut


def _of_one_color(mesh: Mesh) -> Iterator[Mesh]:
    """A mesh in parts of one colour each. MuJoCo colours whole meshes."""
    if not len(mesh.faces):
        return
    colors, which = np.unique(mesh.colors, axis=0, return_inverse=True)
    of_face = which.ravel()[mesh.faces[:, 0]]
    for number in range(len(colors)):
        faces = mesh.faces[of_face == number]
        if not len(faces):
            continue
        used, renamed = np.unique(faces, return_inverse=True)
        used = np.concatenate([used, np.repeat(used[:1], max(0, LEAST_VERTICES - len(used)))])
        yield Mesh(mesh.vertices[used], mesh.normals[used], renamed.reshape(-1, 3), mesh.colors[used])
