"""Pictures by MuJoCo's renderer in a child process, if OpenGL works.

Libraries may be missing, and drivers may crash or hang, so `backend` tests a picture in a child and `pictures` reads
frames under a deadline. EGL uses a graphics card or Mesa; OSMesa needs neither card nor display.
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
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe_reports.raster import Image
from skillframe_reports.shapes import Mesh
from skillframe_reports.stage import Camera, Stage

BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",), "win32": ("wgl",)}
"""Values of MUJOCO_GL by system, in the order of trial."""
PATIENCE_S = 60.0
"""Longest time for a child to start or draw a frame."""
WORKER = "skillframe_reports.opengl_worker"
LEAST_VERTICES = 4
"""Fewest vertices of a MuJoCo mesh."""


class NoPicture(SkillframeError):
    """The child failed to draw."""


@lru_cache(maxsize=1)
def backend() -> str | None:
    """Return the first OpenGL backend that draws here, or None. Takes seconds, once per process."""
    return next((name for name in BACKENDS.get(sys.platform, ()) if _draws(name)), None)


def found() -> str:
    """Return the working backend, or "" without MuJoCo or OpenGL."""
    return (backend() or "") if find_spec("mujoco") is not None else ""


def fix() -> str:
    """Return how to install a working backend."""
    there = find_spec("mujoco") is not None
    how = "sudo apt install libosmesa6" if there else f"{sys.executable} -m pip install 'skillframe[sim]'"
    return f"{how} (videos are drawn by skillframe's own renderer until then)"


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
    """Yield one picture (height, width, 3) per camera for each sample.

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
    """The child's error in brackets, or ""."""
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
    shown = zip(stage.meshes, stage.cut, strict=True)
    parts = [
        (body, part) for body, (whole, cut) in enumerate(shown) for part in _of_one_color(whole if cut is None else cut)
    ]
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


def _of_one_color(mesh: Mesh) -> Iterator[Mesh]:
    """Parts of a mesh with one colour each, as MuJoCo colours whole meshes."""
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
