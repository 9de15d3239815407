"""Plugs and ports of the AI for Industry Challenge as worlds of boxes and cylinders, from the user's SDF files.

Models and frames: github.com/intrinsic-dev/aic, aic_assets/models, as of 2026-03-13. A plug is seated where its tip
frame equals the port's, whose z points into it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from skillframe_parts.checks import THIN
from skillframe_parts.fit import thickness
from skillframe_parts.sdformat import DrawnLink, read_links
from skillframe_parts.shapes import Shape
from skillframe_parts.solid import of_shapes

from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.frames import Float, rotation_matrix

MODELS = (Path("aic_assets/models"), Path("models"), Path())
"""Folders of the models: in a checkout of the published repository, in its assets, or directly."""
NANO = 9
"""Digits of places [m], so that boxes share faces."""
THICK = 1.01 * THIN
"""Least thickness of a plate [m], which contact needs."""
LET_PASS, STEP = 1e-5, 1e-5
"""Overlap that is accepted, and steps of the plug until it rests [m]."""
HIGHEST = 2e-4
"""Above the published place [m], as published boxes overlap; or leave room below the plug, for 3 mm at most."""
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
    """A plug and its port: model, colliding link, and link of the tip's or port's frame."""

    plug: tuple[str, str, str]
    port: tuple[str, str, str]


INSERTIONS = {
    "sc": Insertion(("SC Plug", "sc_plug_link", "sc_tip_link"), ("SC Port", "sc_port_link", "sc_port_base_link")),
    "sfp": Insertion(
        ("SFP Module", "sfp_module_link", "sfp_tip_link"), ("NIC Card Mount", "nic_card_link", "sfp_port_0_link")
    ),
}


class Written(NamedTuple):
    """A fixture file, and the plug's height above the published frame [m]."""

    path: Path
    height: float


def write(folder: Path, name: str, out: Path) -> Written:
    """Write the world of one insertion, `out`/`name`/fixture.toml.

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
    height = 0.0
    while height < HIGHEST and not _free(plug, port, height, LET_PASS):
        height += STEP
    if not _free(plug, port, height, LET_PASS):
        what = f"plug and port overlap even {1000.0 * HIGHEST:g} mm above where they are published"
        raise InputError(name, what, "give the models as they are published")
    while height > -3e-3 and _free(plug, port, height - STEP, 1e-7):  # 0.1 um counts as no overlap
        height -= STEP
    return round(height, NANO)


def _free(plug: Any, port: Any, height: float, most: float) -> bool:
    """Whether no common body of plug and port is thicker than `most` on average [m]."""
    return all(thickness(each) <= most for each in (plug.translate([0.0, 0.0, height]) ^ port).decompose())


def _model(folder: Path, model: str) -> Path:
    for each in MODELS:
        if (path := folder / each / model / "model.sdf").is_file():
            return path
    raise InputError(
        folder, f"holds no {model}/model.sdf", "give a checkout of intrinsic-dev/aic, or its aic_assets/models"
    )


def _in_frame(path: Path, body: str, frame: str) -> tuple[list[Shape], float]:
    """Shapes of a link in another's frame turned about x, with z out of the port, and its mass."""
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
    """A rotation (3, 3), by exact right angles where nearly so."""
    near: Float = np.round(rotation)
    return near if np.abs(rotation - near).max() < 1e-5 else rotation  # rad, so that boxes share faces


def _thickened(path: Path, link: DrawnLink) -> list[Shape]:
    """Shapes with boxes thick enough for contact, grown towards the middle of all."""
    for each in link.shapes:
        if each.kind == "mesh":
            raise InputError(path, f"has {each.name}, where boxes and cylinders are", "give the models as published")
    middle = np.mean([each.origin for each in link.shapes], axis=0)
    found = list[Shape]()
    for each in link.shapes:
        if each.kind == "box" and min(each.size) < THICK:
            size = np.array(each.size)
            thin = int(np.argmin(size))
            across = each.rotation[:, thin]
            inwards = float(np.copysign(0.5 * (THICK - size[thin]), across @ (middle - each.origin)))
            size[thin] = THICK
            found.append(replace(each, size=tuple(size.tolist()), origin=each.origin + inwards * across))
        else:
            found.append(each)
    return found


def _sdf(model: str, shapes: Sequence[Shape]) -> str:
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
    """Roll, pitch and yaw about fixed x, y, z, yaw first, as roll is defined at a pitch of 90 degrees."""
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    left = rotation_matrix(np.array([0.0, 0.0, -yaw])) @ rotation
    return float(np.arctan2(-left[1, 2], left[1, 1])), float(np.arctan2(-left[2, 0], left[0, 0])), yaw
