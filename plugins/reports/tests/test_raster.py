import struct
import zlib

import numpy as np
import pytest
from skillframe_reports.raster import draw, png, project, view_axes
from skillframe_reports.shapes import mesh_of
from skillframe_reports.stage import Camera

CAMERA = Camera(np.array([0.1, 0.2, 0.3]), 2.0)
SPHERE = mesh_of({"kind": "sphere", "size": [0.3], "position": [0.1, 0.2, 0.3], "rgba": [1.0, 0.0, 0.0, 1.0]})
WALL = mesh_of({"kind": "box", "size": [0.3, 0.3, 0.3], "position": [0.1, 0.2, 0.3], "rgba": [0.0, 0.0, 1.0, 1.0]})


def decoded(content):
    """Pixels of a PNG of filter 2, by its definition: each row holds differences to the row above."""
    width, height = struct.unpack(">II", content[16:24])
    start = content.index(b"IDAT") + 4
    size = struct.unpack(">I", content[start - 8 : start - 4])[0]
    rows = np.frombuffer(zlib.decompress(content[start : start + size]), dtype=np.uint8).reshape(height, -1)
    assert set(rows[:, 0]) == {2}
    return np.cumsum(rows[:, 1:].astype(np.int64), axis=0).astype(np.uint8).reshape(height, width, 4)


def test_a_png_holds_the_pixels():
    image = np.random.default_rng(0).integers(0, 256, (7, 5, 4)).astype(np.uint8)
    assert (decoded(png(image)) == image).all()


def test_the_target_lies_in_the_middle_and_up_is_up():
    points = CAMERA.target + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])
    pixels = project(points, CAMERA, 200, 100)
    assert pixels[0] == pytest.approx([100.0, 50.0, 2.0])
    assert pixels[1, 1] < 50.0
    assert view_axes(CAMERA) @ view_axes(CAMERA).T == pytest.approx(np.eye(3))


def test_a_sphere_covers_the_disc_that_perspective_gives_it():
    image = draw([SPHERE], CAMERA, 160, 120)
    covered = (image[..., 3] / 255.0).sum()
    radius = 60.0 / np.tan(0.5 * CAMERA.field_of_view) * np.tan(np.arcsin(0.3 / 2.0))
    assert covered == pytest.approx(np.pi * radius**2, rel=0.05)  # 32 facets, and half a pixel of outline all round


def test_what_is_nearer_hides_what_is_behind_whatever_the_order():
    near = SPHERE._replace(vertices=SPHERE.vertices + 0.8 * CAMERA.backward)
    for meshes in ([near, WALL], [WALL, near]):
        red, _, blue, solid = draw(meshes, CAMERA, 80, 60)[30, 40].astype(int)
        assert solid == 255
        assert red > 2 * blue


def test_nothing_behind_the_eye_is_drawn():
    behind = SPHERE._replace(vertices=SPHERE.vertices + 4.0 * CAMERA.backward)
    assert draw([behind], CAMERA, 40, 30).max() == 0
