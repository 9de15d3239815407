"""MuJoCo's renderer in a child process: same picture as our own, and a child that crashes or hangs costs nothing."""

import os
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from skillframe_reports import opengl, skillframe_requirements, video
from skillframe_reports.opengl import NoPicture, backend, pictures
from skillframe_reports.opengl_worker import scene_model
from skillframe_reports.shapes import Mesh
from skillframe_reports.stage import stage_of

from tests.report_fakes import trace

CRASH = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
HANG = "import time; time.sleep(600)"
HALF = "import os, time; os.write(1, bytes(1000))"


def stage(count=3):
    run = trace(samples=101)
    arrays = {f.name: getattr(run, f.name)[:count] for f in fields(run) if f.name not in ("machine", "meta")}
    return stage_of(replace(run, **arrays))


@pytest.fixture
def child(monkeypatch):
    """Start another program in the worker's place."""
    monkeypatch.setattr(opengl, "PATIENCE_S", 2.0)
    real_popen, real_run = subprocess.Popen, subprocess.run

    def does(code):
        started = []

        def popen(command, **settings):
            started.append(real_popen([sys.executable, "-c", code], **settings))
            return started[-1]

        monkeypatch.setattr(opengl.subprocess, "Popen", popen)
        return started

    def runs(code):
        monkeypatch.setattr(
            opengl.subprocess, "run",
            lambda command, **settings: real_run([sys.executable, "-c", code], **settings),
        )  # fmt: skip

    does.run = runs
    return does


@pytest.mark.parametrize("code", [CRASH, HALF], ids=["crash", "half a picture"])
def test_a_child_that_ends_is_no_picture(child, code):
    started = child(code)
    with pytest.raises(NoPicture, match="stopped drawing"):
        list(pictures(stage(), [0, 1], video._views(stage()), 480, "egl"))
    assert started[0].poll() is not None


def test_what_the_child_says_of_its_error_is_told(child):
    child("raise ValueError('Error: no such card')")
    with pytest.raises(NoPicture, match=r"stopped drawing \(ValueError: Error: no such card\)$"):
        list(pictures(stage(), [0], video._views(stage()), 480, "egl"))


def test_the_flat_pieces_of_a_cut_are_a_scene():
    """A + B = C holds for the inertia of what is flat, and rounding decides whether MuJoCo takes it for impossible."""
    rng = np.random.default_rng(3)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, (20, 12)), axis=1)
    rims = np.stack([0.04 * np.cos(angles), np.full_like(angles, 2.3e-5), 0.03 * np.sin(angles)], axis=-1)
    faces = np.array([[0, i, i + 1] for i in range(1, 11)])
    pieces = [
        {"vertices": rim, "normals": np.tile([0.0, -1.0, 0.0], (12, 1)), "faces": faces, "rgba": np.ones(4)}
        for rim in rims
    ]
    assert scene_model(pieces, (40, 30), 0.5).ngeom == 20


@pytest.mark.slow
def test_a_child_that_hangs_is_ended(child):
    started = child(HANG)
    with pytest.raises(NoPicture, match="stopped drawing"):
        list(pictures(stage(), [0], video._views(stage()), 480, "egl"))
    assert started[0].poll() is not None


def test_a_film_that_nobody_wants_any_more_ends_its_child(child):
    started = child("import os\nwhile True: os.write(1, bytes(65536))")
    made = pictures(stage(), [0, 1, 2], video._views(stage()), 480, "egl")
    assert [picture.shape for picture in next(made)] == [(480, 400, 3), (480, 560, 3)]
    made.close()
    assert started[0].poll() is not None


@pytest.mark.parametrize(("code", "draws"), [("", True), ("raise SystemExit(1)", False), (CRASH, False), (HANG, False)])
@pytest.mark.slow
def test_a_backend_is_what_draws_in_a_child(child, code, draws):
    child.run(code)
    assert opengl._draws("egl") is draws


def test_every_colour_of_a_mesh_is_drawn_as_a_mesh_of_its_own_and_no_face_is_lost():
    red, blue = (1.0, 0, 0, 1), (0, 0, 1.0, 1)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
    mesh = Mesh(corners, corners, np.array([[0, 1, 2], [3, 4, 5]]), np.array([red] * 3 + [blue] * 3))
    parts = list(opengl._of_one_color(mesh))
    assert sorted(tuple(part.colors[0]) for part in parts) == sorted([red, blue])
    assert all(len(part.vertices) >= opengl.LEAST_VERTICES for part in parts)
    shown = sorted(part.vertices[part.faces].tolist() for part in parts)
    assert shown == sorted([mesh.vertices[mesh.faces[:1]].tolist(), mesh.vertices[mesh.faces[1:]].tolist()])


@pytest.mark.slow
def test_mujoco_s_renderer_and_ours_draw_the_same_scene_from_the_same_place():
    name = backend()
    if name is None:
        pytest.skip("OpenGL draws nothing here (sudo apt install libosmesa6)")
    seen = stage(60)
    red = tuple(tuple(mesh.painted((0.7, 0.2, 0.1, 1.0)) for mesh in body) for body in seen.whole)
    shown, samples = replace(seen, whole=red), np.array([0, 59])  # a white arm is no silhouette on white paper
    for theirs, ours in zip(video._by_opengl(shown, samples, name), video._by_hand(shown, samples), strict=True):
        for one, other in zip(theirs, ours, strict=True):
            there, here = (each[..., 2] < 225 for each in (one, other))  # 25 of 255 from the paper
            edge = np.zeros_like(here)
            edge[1:] |= here[1:] != here[:-1]
            edge[:, 1:] |= here[:, 1:] != here[:, :-1]
            # ours has an outline of a pixel, theirs has smooth edges: two pixels across every edge
            assert np.logical_xor(there, here).sum() <= 2 * edge.sum() < here.sum()
            inside = there & here & ~edge
            assert np.median(one[inside][:, 0]) > 2 * np.median(one[inside][:, 2])  # red, as it was painted


@pytest.mark.slow
def test_the_probe_asks_mujoco_and_believes_no_backend_that_is_not_there():
    environment = {**os.environ, "MUJOCO_GL": "disable"}
    command = [sys.executable, "-m", opengl.WORKER, "probe"]
    assert subprocess.run(command, env=environment, capture_output=True, timeout=60, check=False).returncode != 0


@pytest.mark.parametrize("found", ["egl", None])
def test_the_renderer_of_videos_is_told_or_how_to_get_one(monkeypatch, found):
    monkeypatch.setattr("skillframe_reports.opengl.backend", lambda: found)
    (row,) = skillframe_requirements()
    assert row.find() == (found or "") and "libosmesa6" in row.fix()
    monkeypatch.setattr("skillframe_reports.opengl.find_spec", lambda name: None)
    (row,) = skillframe_requirements()
    assert row.find() == "" and "pip install 'skillframe[sim]'" in row.fix()
