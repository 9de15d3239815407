"""Records of `[[second]]` of a fixture file: further parts, their joints and goals."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from skillframe.config import texts
from skillframe.config.units import one_of, si, unit_of
from skillframe.errors import InputError

Units = Literal["m", "cm", "mm", "um", "in"]
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshPlace:
    """Pose of a mesh in the frame of assembly.

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
    """`[[second]]`, a further part of the fixture, drawn at the start, in the frame of `pose`.

    Attributes:
        name: unique name.
        joint: "fixed", "hinge" (turns about an axis), "slide" (moves along it), "free" (lies there), or "scene": a body
            of that name in the fixture's scene, which has all but `goal`.
        mesh: its file, or boxes and cylinders.
        units: of the file; GLB has metres.
        pose: of the mesh.
        boxes, cylinders: its shapes, in the frame of `pose`.
        density: of its material [kg/m3, 1 to 30000].
        mass: in place of its density [kg, 0.01g to 100kg].
        anchor: a point of the hinge's axis [m, -100m to 100m].
        axis: of the hinge or slide, of any length but 0.
        range: least and largest travel of a hinge or slide from the start [rad or m].
        stiffness: of a spring of a hinge or slide [Nm/rad or N/m, 0 to 1e6].
        rest: where the spring is slack [rad or m].
        damping: of the joint [Nms/rad or Ns/m, 0 to 1e5].
        friction: of the joint [Nm or N, 0 to 1e4].
        goal: least and largest travel at the end [rad or m]; of a free part the distance its centre moved [m].
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


def second_in_si(values: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The keys of a fixture file, with texts of `[[second]]` converted to the unit of the part's joint.

    Raises:
        InputError: a wrong unit for the joint, such as degrees of a slide.
    """
    units = {name: unit for name, about in texts(SecondPart).items() if " or " in (unit := unit_of(about))}
    ready = dict(values)
    if not isinstance(parts := values.get("second"), list):
        return ready
    ready["second"] = list(parts)
    for i, part in enumerate(parts):
        joint = part.get("joint") if isinstance(part, Mapping) else None
        if not isinstance(part, Mapping) or joint not in ("hinge", "slide", "free"):
            continue  # the joint is in the scene: either unit is taken
        own = dict(part)
        for name in (name for name in units if name in part):
            unit, at, value = one_of(units[name], joint != "hinge"), f"{where}: second[{i}].{name}", part[name]
            own[name] = [si(each, unit, at) for each in value] if isinstance(value, list) else si(value, unit, at)
        ready["second"][i] = own
    return ready


def check_second(declared: Sequence[SecondPart], index: int, where: str) -> None:
    """Refuse a second part with missing or superfluous keys.

    Raises:
        InputError: names the part and the key.
    """
    part, usual = declared[index], SecondPart(name="x", joint="hinge")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", part.name):
        raise InputError(f"{where}.name", f"is {part.name!r}", "take letters, digits and _, a letter first")
    if part.name in [each.name for each in declared[:index]]:
        raise InputError(f"{where}.name", f"{part.name!r} is there already", "give each part a name of its own")
    if part.joint == "scene":
        for key in ("mesh", "units", "pose", "boxes", "cylinders", "mass", "density"):
            if getattr(part, key) != getattr(usual, key):
                what = "means nothing for a part of the scene"
                raise InputError(f"{where}.{key}", what, "leave it out, or say it there")
    elif bool(part.mesh) == bool(part.boxes or part.cylinders):
        said = "has a mesh and shapes" if part.mesh else "has no shape"
        raise InputError(where, said, "give a mesh, or boxes and cylinders")
    if part.mass is not None and part.density is not None:
        raise InputError(where, "has mass and density", "keep one of the two")
    if not any(part.axis):
        raise InputError(f"{where}.axis", "is zero", "give for example [0, 0, 1]")
    jointed = ("anchor", "axis", "range", "stiffness", "rest", "damping", "friction")
    of_joint = {"fixed": (*jointed, "goal"), "free": jointed, "scene": jointed, "slide": ("anchor",)}
    for key in of_joint.get(part.joint, ()):
        if getattr(part, key) != getattr(usual, key):
            raise InputError(f"{where}.{key}", f"means nothing for a part that is {part.joint}", "leave it out")
    for key, pair in (("range", part.range), ("goal", part.goal)):
        if pair is not None and not pair[0] < pair[1]:
            raise InputError(f"{where}.{key}", f"is {list(pair)}", "give the least travel, then the largest")
    if part.range is not None and not part.range[0] <= 0.0 <= part.range[1]:
        what = f"{list(part.range)} leaves out 0, where it starts"
        raise InputError(f"{where}.range", what, "measure it from the start")
