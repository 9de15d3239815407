"""Parts for tests, in millimetres, written as meshes beside a fixture file."""

import manifold3d
import numpy as np
import trimesh
from skillframe_parts.solid import arrays_of

SIDES = 12
"""Of what is round: few, so that tests are fast."""
FILE = """\
[fixture]
mesh = "socket.stl"
units = "mm"
[tool]
mesh = "plug.stl"
units = "mm"
[contact]
friction = 0.2
"""


def box(low, high):
    return manifold3d.Manifold.cube([float(b - a) for a, b in zip(low, high, strict=True)]).translate(
        [float(a) for a in low]
    )


def rod(radius, low, high, sides=SIDES, outside=False):
    """An upright prism around z, its sides tangent to the circle from outside, or its corners on it."""
    radius = radius / np.cos(np.pi / sides) if outside else radius
    return manifold3d.Manifold.cylinder(high - low, radius, circular_segments=sides).translate([0.0, 0.0, low])


def hole(radius, depth, sides=SIDES, half=15.0, bottom=5.0):
    """A block with a blind hole from its top, z = 0. The play is never less than stated."""
    block = box((-half, -half, -depth - bottom), (half, half, 0.0))
    return block - rod(radius, -depth, 1.0, sides, outside=True)


def keyed(radius, key, out, low, high, sides=48, outside=False):
    """A shaft with a key of a width that reaches out beyond its radius, towards +x."""
    return rod(radius, low, high, sides, outside) + box((0.0, -0.5 * key, low), (radius + out, 0.5 * key, high))


def round_pair(play=0.2, sides=SIDES):
    """A pin of 5 mm, 12 mm deep in its hole."""
    return rod(5.0, -12.0, 8.0, sides), hole(5.0 + play, 12.0, sides)


def export(solid, path):
    vertices, faces = arrays_of(solid)
    trimesh.Trimesh(vertices, faces, process=False).export(path)


def write(folder, plug, socket, text=FILE):
    """The fixture file of two solids."""
    folder.mkdir(parents=True, exist_ok=True)
    export(plug, folder / "plug.stl")
    export(socket, folder / "socket.stl")
    (folder / "fixture.toml").write_text(text)
    return folder / "fixture.toml"


def in_metres(solid):
    return solid.scale([1e-3] * 3)
