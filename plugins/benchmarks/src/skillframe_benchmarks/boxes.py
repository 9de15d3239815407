"""Plugs and ports of the AI for Industry Challenge as worlds: boxes and cylinders of its SDF files, the user's copy.

Models and frames: github.com/intrinsic-dev/aic, aic_assets/models, as of 2026-03-13. A plug is home where the frame of
its tip is the frame of the port, whose z points into it. Nothing of the models is shipped here.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.frames import Float, rotation_matrix
from skillframe.parts.checks import THIN
from skillframe.parts.fit import thickness
from skillframe.parts.scenes import Shape
from skillframe.parts.sdformat import DrawnLink, read_links
from skillframe.parts.solid import of_shapes

MODELS = (Path("aic_assets/models"), Path("models"), Path())
"""Where the models lie below the folder: in a checkout of the published repository, in its assets, or right there."""
STRAIGHT, NANO = 1e-5, 9
"""Turns this near to right angles [rad] are meant as such, and places [m] to so many digits (ours): boxes that share a
face then share it, and are cut into few pieces."""
THICK = 1.01 * THIN
"""Of a plate at least [m]: contact does not hold thinner walls (ours)."""
LET_PASS, NOTHING, STEP = 1e-5, 1e-7, 1e-5
"""Overlap that is let pass, that is none, and the steps in which a plug is moved until it rests [m] (ours)."""
HIGHEST, LOWEST = 2e-4, -3e-3
"""From where it is published [m] (ours): published boxes reach into each other, or leave room below the plug."""
FIXTURE = """\
summary = "AI for Industry Challenge, {name}"
[fixture]
mesh = "port.sdf"
table = false
[tool]
mesh = "plug.sdf"
mass = {mass!r}
[contact]
friction = 0.5             # of the port, as published
"""


class Insertion(NamedTuple):
    """A plug and its port: model, link that collides, and link whose frame is the tip's or the port's."""

    plug: tuple[str, str, str]
    port: tuple[str, str, str]


INSERTIONS = {
    "sc": Insertion(("SC Plug", "sc_plug_link", "sc_tip_link"), ("SC Port", "sc_port_link", "sc_port_base_link")),
    "sfp": Insertion(
        ("SFP Module", "sfp_module_link", "sfp_tip_link"), ("NIC Card Mount", "nic_card_link", "sfp_port_0_link")
    ),
}


class Written(NamedTuple):
    """A fixture file, and how far the plug stands above the published frame [m]."""

    path: Path
    height: float


def write(folder: Path, name: str, out: Path) -> Written:
    """The world of one insertion, `out`/`name`/fixture.toml.

    Args:
        folder: the user's copy.
        name: of `INSERTIONS`.
        out: folder for all of them.

    Raises:
        InputError: the folder holds no such models, they are no SDF, or plug and port overlap by more than a touch.
    """
    held, standing = INSERTIONS[name]
    (plug, mass), (port, _) = (_in_frame(_model(folder, each[0]), *each[1:]) for each in (held, standing))
    height = _rest(of_shapes(plug, folder), of_shapes(port, folder), name)
    place = out / name
    place.mkdir(parents=True, exist_ok=True)
    up = np.array([0.0, 0.0, height])
    for model, shapes in (("plug", [replace(each, origin=each.origin + up) for each in plug]), ("port", port)):
        write_whole(place / f"{model}.sdf", _sdf(model, shapes).encode())
    write_whole(place / "fixture.toml", FIXTURE.format(name=name, mass=mass).encode())
    return Written(place / "fixture.toml", height)


def _rest(plug: Any, port: Any, name: str) -> float:
    """The least height over its published place from which on what the two have in common is a touch."""
    height = 0.0
    while height < HIGHEST and not _free(plug, port, height, LET_PASS):
        height += STEP
    if not _free(plug, port, height, LET_PASS):
        what = f"plug and port overlap even {1000.0 * HIGHEST:g} mm above where they are published"
        raise InputError(name, what, "give the models as they are published")
    while height > LOWEST and _free(plug, port, height - STEP, NOTHING):
        height -= STEP
    return round(height, NANO)


def _free(plug: Any, port: Any, height: float, most: float) -> bool:
    """Is no common body of plug and port thicker than that, in the mean [m]?"""
    return all(thickness(each) <= most for each in (plug.translate([0.0, 0.0, height]) ^ port).decompose())


def _model(folder: Path, model: str) -> Path:
    for each in MODELS:
        if (path := folder / each / model / "model.sdf").is_file():
            return path
    raise InputError(
        folder, f"holds no {model}/model.sdf", "give a checkout of intrinsic-dev/aic, or its aic_assets/models"
    )


def _in_frame(path: Path, body: str, frame: str) -> tuple[list[Shape], float]:
    """What a link consists of, from another's frame turned about x, so that z points out of the port, and its mass."""
    links = read_links(path)
    for name in (body, frame):
        if name not in links:
            raise InputError(path, f"has no link {name!r}", "give the models as they are published")
    turn, origin = rotation_matrix(np.array([np.pi, 0.0, 0.0])) @ links[frame].rotation.T, links[frame].origin
    shapes = [
        replace(each, rotation=_straight(turn @ each.rotation), origin=np.round(turn @ (each.origin - origin), NANO))
        for each in _thickened(path, links[body])
    ]
    return shapes, links[body].mass or 0.0


def _straight(rotation: Float) -> Float:
    """A rotation (3, 3), exactly by right angles where it nearly is."""
    near: Float = np.round(rotation)
    return near if np.abs(rotation - near).max() < STRAIGHT else rotation


def _thickened(path: Path, link: DrawnLink) -> list[Shape]:
    """Shapes whose boxes are thick enough for contact to hold: thinner ones grow towards the middle of all shapes."""
    for each in link.shapes:
        if each.kind == "mesh":
            raise InputError(path, f"has {each.name}, where boxes and cylinders are", "give the models as published")
    middle = np.mean([each.origin for each in link.shapes], axis=0)
    return [_grown(each, middle) if each.kind == "box" and min(each.size) < THICK else each for each in link.shapes]


def _grown(box: Shape, middle: Float) -> Shape:
    size = np.array(box.size)
    thin = int(np.argmin(size))
    across = box.rotation[:, thin]
    inwards = float(np.copysign(0.5 * (THICK - size[thin]), across @ (middle - box.origin)))
    size[thin] = THICK
    return replace(box, size=tuple(size.tolist()), origin=box.origin + inwards * across)


def _sdf(model: str, shapes: Sequence[Shape]) -> str:
    """An SDFormat file of a model that stands and consists of these shapes."""
    root = ET.Element("sdf", version="1.9")
    drawn = ET.SubElement(root, "model", name=model)
    ET.SubElement(drawn, "static").text = "true"
    link = ET.SubElement(drawn, "link", name=model)
    for number, shape in enumerate(shapes):
        each = ET.SubElement(link, "collision", name=f"{shape.kind}_{number}")
        pose = [*shape.origin, *_rpy(shape.rotation)]
        ET.SubElement(each, "pose").text = " ".join(repr(float(x)) for x in pose)
        keys = {"size": shape.size} if shape.kind == "box" else dict(zip(("radius", "length"), shape.size, strict=True))
        kind = ET.SubElement(ET.SubElement(each, "geometry"), shape.kind)
        for key, value in keys.items():
            ET.SubElement(kind, key).text = " ".join(repr(float(x)) for x in np.atleast_1d(value))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _rpy(rotation: Float) -> tuple[float, float, float]:
    """Roll, pitch and yaw about fixed x, y, z. Yaw is taken off first: roll is known where pitch is 90 degrees."""
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    left = rotation_matrix(np.array([0.0, 0.0, -yaw])) @ rotation
    return float(np.arctan2(-left[1, 2], left[1, 1])), float(np.arctan2(-left[2, 0], left[0, 0])), yaw
