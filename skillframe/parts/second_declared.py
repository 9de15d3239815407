"""`[[second]]` of a fixture file as checked records: further parts, how they are joined, and where they have to end."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from skillframe.errors import InputError

Units = Literal["m", "cm", "mm", "um", "in"]
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshPlace:
    """Where a mesh lies in the frame in which the two parts are assembled.

    Attributes:
        xyz: of the mesh's origin [m, -100m to 100m].
        rpy: roll, pitch and yaw about fixed x, y, z [rad, -360deg to 360deg].
    """

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxShape:
    """A box of a second part.

    Attributes:
        size: its three edges [m, 1um to 2m].
        xyz: of its middle [m, -100m to 100m].
        rpy: roll, pitch and yaw about fixed x, y, z [rad, -360deg to 360deg].
    """

    size: Triple
    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderShape:
    """A cylinder of a second part, along its z.

    Attributes:
        radius: [m, 1um to 1m].
        length: [m, 1um to 2m].
        xyz: of its middle [m, -100m to 100m].
        rpy: roll, pitch and yaw about fixed x, y, z [rad, -360deg to 360deg].
    """

    radius: float
    length: float
    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondPart:
    """`[[second]]`, a further part of the fixture, drawn as it stands at the start, in the frame of `pose`.

    Attributes:
        name: one of its own.
        joint: "fixed", "hinge" (turns about an axis), "slide" (moves along it), "free" (lies there), or "scene": a body
            of that name in the fixture's scene, which has all but `goal`.
        mesh: its file, or boxes and cylinders.
        units: of the file; GLB has metres.
        pose: of the mesh.
        boxes, cylinders: of which it consists, in the frame of `pose`.
        density: in kg/m3 [1 to 30000].
        mass: in place of its density [kg, 0.01g to 100kg].
        anchor: a point of the hinge's axis [m, -100m to 100m].
        axis: of the hinge or slide, of any length but 0.
        range: least and largest travel from the start, in rad of a hinge and m of a slide.
        stiffness: of a spring, in Nm/rad of a hinge and N/m of a slide [0 to 1e6].
        rest: where the spring is slack, in rad or m.
        damping: in Nms/rad or Ns/m [0 to 1e5].
        friction: of the joint, in Nm or N [0 to 1e4].
        goal: least and largest travel at the end, in rad or m (of a free part how far its centre went).
    """

    name: str
    joint: Literal["fixed", "hinge", "slide", "free", "scene"]
    mesh: str = ""
    units: Units | None = None
    pose: MeshPlace = field(default_factory=MeshPlace)
    boxes: tuple[BoxShape, ...] = ()
    cylinders: tuple[CylinderShape, ...] = ()
    density: float | None = None
    mass: float | None = None
    anchor: Triple = (0.0, 0.0, 0.0)
    axis: Triple = (0.0, 0.0, 1.0)
    range: tuple[float, float] | None = None
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    goal: tuple[float, float] | None = None


def check_second(declared: Sequence[SecondPart], index: int, where: str) -> None:
    """Refuse a second part whose keys say too much or too little.

    Raises:
        InputError: names the part and the key.
    """
    part = declared[index]
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", part.name):
        raise InputError(f"{where}.name", f"is {part.name!r}", "take letters, digits and _, a letter first")
    if part.name in [each.name for each in declared[:index]]:
        raise InputError(f"{where}.name", f"{part.name!r} is there already", "give each part a name of its own")
    if part.joint == "scene":
        _check_of_scene(part, where)
    elif bool(part.mesh) == bool(part.boxes or part.cylinders):
        said = "has a mesh and shapes" if part.mesh else "has no shape"
        raise InputError(where, said, "give a mesh, or boxes and cylinders")
    if part.mass is not None and part.density is not None:
        raise InputError(where, "has mass and density", "keep one of the two")
    if not any(part.axis):
        raise InputError(f"{where}.axis", "is zero", "give for example [0, 0, 1]")
    _check_joint(part, where)


def _check_of_scene(part: SecondPart, where: str) -> None:
    for key in ("mesh", "units", "pose", "boxes", "cylinders", "mass", "density"):
        if getattr(part, key) != getattr(SecondPart(name="x", joint="hinge"), key):
            raise InputError(f"{where}.{key}", "means nothing for a part of the scene", "leave it out, or say it there")


def _check_joint(part: SecondPart, where: str) -> None:
    jointed = ("anchor", "axis", "range", "stiffness", "rest", "damping", "friction")
    of_joint = {"fixed": (*jointed, "goal"), "free": jointed, "scene": jointed, "slide": ("anchor",)}
    usual = SecondPart(name="x", joint="hinge")
    for key in of_joint.get(part.joint, ()):
        if getattr(part, key) != getattr(usual, key):
            raise InputError(f"{where}.{key}", f"means nothing for a part that is {part.joint}", "leave it out")
    for key, pair in (("range", part.range), ("goal", part.goal)):
        if pair is not None and not pair[0] < pair[1]:
            raise InputError(f"{where}.{key}", f"is {list(pair)}", "give the least travel, then the largest")
    if part.range is not None and not part.range[0] <= 0.0 <= part.range[1]:
        raise InputError(
            f"{where}.range", f"{list(part.range)} leaves out 0, where it starts", "measure it from the start"
        )
