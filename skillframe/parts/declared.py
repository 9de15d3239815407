"""`fixture.toml` as checked records: which mesh stands, which is held, how they touch, and when they are assembled.

Paths are relative to the file and may not leave its folder, so that a campaign's folder can hold all of it. STL, OBJ,
PLY and OFF carry no unit, and none is guessed.
"""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError

Units = Literal["m", "cm", "mm", "um", "in"]
SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
"""Metres per unit of a mesh file."""
DENSITY = 2700.0
"""Of the held part where the file gives neither mass nor density [kg/m3]: aluminium."""
_Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshPlace:
    """Where a mesh lies in the frame in which the two parts are assembled.

    Attributes:
        xyz: of the mesh's origin [m, -100m to 100m].
        rpy: roll, pitch and yaw about fixed x, y, z [rad, -360deg to 360deg].
    """

    xyz: _Vector = (0.0, 0.0, 0.0)
    rpy: _Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FixturePart:
    """`[fixture]`, the part that stands still.

    Attributes:
        mesh: its file.
        units: of the file; GLB has metres.
        pose: of the mesh; the identity if both parts were exported from one assembly.
        table: whether it stands on a table, a plane under its lowest point.
    """

    mesh: str
    units: Units | None = None
    pose: MeshPlace = field(default_factory=MeshPlace)
    table: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPart:
    """`[tool]`, the part in the robot's grip.

    Attributes:
        mesh: its file.
        units: of the file; GLB has metres.
        assembled: where the mesh is when done.
        density: of the part in kg/m3 [1 to 30000].
        mass: of the part, in place of its density [kg, 0.1g to 100kg].
        tip: point of the assembled part in the frame of `assembled` [m], or "auto": its lowest end, in the middle.
        grip: from the wrist to the tip [m, 20mm to 1m].
    """

    mesh: str
    units: Units | None = None
    assembled: MeshPlace = field(default_factory=MeshPlace)
    density: float | None = None
    mass: float | None = None
    tip: Literal["auto"] | _Vector = "auto"
    grip: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactKeys:
    """`[contact]`.

    Attributes:
        friction: Coulomb coefficient [0 to 5].
    """

    friction: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class StartKeys:
    """Where runs start.

    Attributes:
        above_mouth: height of the tip over the mouth [m, 0m to 200mm].
    """

    above_mouth: float = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatedKeys:
    """How near the assembled pose counts as seated.

    Attributes:
        height: along the axis [m, 1um to 100mm].
        sideways: [m, 1um to 100mm].
        tilt: of the axis [rad, 0.1deg to 90deg].
    """

    height: float = 0.001
    sideways: float = 0.002
    tilt: float = 0.035


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownKeys:
    """How a simulated person shows it: from the mouth, tilted about y, then about x.

    Attributes:
        tilt: at the start [rad, 0deg to 30deg].
        deep: how far the lowest corner is in the mouth at the start, or less where it does not fit [m, 0m to 50mm].
    """

    tilt: float = 0.13962634015954636
    deep: float = 0.0007


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskKeys:
    """`[task]`.

    Attributes:
        axis: of insertion in the frame of `pose` and `assembled`; "auto" takes the first free of -z, z, -x, x, -y, y.
        start: where runs start.
        seated: what counts as done.
        demonstration: how it is shown.
    """

    axis: Literal["auto"] | _Vector = (0.0, 0.0, -1.0)
    start: StartKeys = field(default_factory=StartKeys)
    seated: SeatedKeys = field(default_factory=SeatedKeys)
    demonstration: ShownKeys = field(default_factory=ShownKeys)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxShape:
    """A box of a second part.

    Attributes:
        size: its three edges [m, 1um to 2m].
        xyz: of its middle [m, -100m to 100m].
        rpy: roll, pitch and yaw about fixed x, y, z [rad, -360deg to 360deg].
    """

    size: _Vector
    xyz: _Vector = (0.0, 0.0, 0.0)
    rpy: _Vector = (0.0, 0.0, 0.0)


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
    xyz: _Vector = (0.0, 0.0, 0.0)
    rpy: _Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondPart:
    """`[[second]]`, a further part of the fixture, drawn as it stands at the start, in the frame of `pose`.

    Attributes:
        name: one of its own.
        joint: "fixed", "hinge" (turns about an axis), "slide" (moves along it) or "free" (lies there).
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
    joint: Literal["fixed", "hinge", "slide", "free"]
    mesh: str = ""
    units: Units | None = None
    pose: MeshPlace = field(default_factory=MeshPlace)
    boxes: tuple[BoxShape, ...] = ()
    cylinders: tuple[CylinderShape, ...] = ()
    density: float | None = None
    mass: float | None = None
    anchor: _Vector = (0.0, 0.0, 0.0)
    axis: _Vector = (0.0, 0.0, 1.0)
    range: tuple[float, float] | None = None
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    goal: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureFile:
    """A whole `fixture.toml`.

    Attributes:
        second: further parts of the fixture.
        summary: what it is, for people.
    """

    fixture: FixturePart
    tool: HeldPart
    contact: ContactKeys = field(default_factory=ContactKeys)
    task: TaskKeys = field(default_factory=TaskKeys)
    second: tuple[SecondPart, ...] = ()
    summary: str = ""


def read_fixture(path: Path) -> FixtureFile:
    """A checked fixture file.

    Raises:
        InputError: a key or value that cannot be used, a mesh without units, or a mesh that is not there.
    """
    check_file(path, path, "check the path")
    file = build(FixtureFile, read_toml(path), str(path))
    for key, part in (("fixture", file.fixture), ("tool", file.tool)):
        _check_mesh(part, path, key)
    if file.tool.mass is not None and file.tool.density is not None:
        raise InputError(f"{path}: tool", "has mass and density", "keep one of the two")
    if not isinstance(file.task.axis, str) and not any(file.task.axis):
        raise InputError(f"{path}: task.axis", "is zero", 'give for example [0, 0, -1], or "auto"')
    for index, second in enumerate(file.second):
        _check_second(file, index, path)
        if second.mesh:
            _check_mesh(second, path, f"second[{index}]")
    return file


def check_file(path: Path, where: object, fix: str, *, name: str = "") -> None:
    """Refuse what is not there, and what would never end: a folder, a pipe, a device, a link to itself.

    Args:
        path: the file.
        where: for the message.
        fix: what to do if it is not there.
        name: it as its user wrote it, if that is not `where`.

    Raises:
        InputError: says what is there in its place.
    """
    named = f": {name}" if name else ""
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        link = path.is_symlink()
        what = f"is a link to {os.readlink(path)!r}, which is not there" if link else "no such file"
        raise InputError(where, what + named, fix) from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise InputError(where, f"cannot be opened ({getattr(error, 'strerror', None) or error}){named}", fix) from None
    if not stat.S_ISREG(kind):
        what = "is a folder" if stat.S_ISDIR(kind) else "is a pipe or a device, not a file"
        raise InputError(where, what + named, "name a file")


def _check_second(file: FixtureFile, index: int, path: Path) -> None:
    """Refuse a second part whose keys say too much or too little."""
    part, where = file.second[index], f"{path}: second[{index}]"
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", part.name):
        raise InputError(f"{where}.name", f"is {part.name!r}", "take letters, digits and _, a letter first")
    if part.name in [each.name for each in file.second[:index]]:
        raise InputError(f"{where}.name", f"{part.name!r} is there already", "give each part a name of its own")
    if bool(part.mesh) == bool(part.boxes or part.cylinders):
        said = "has a mesh and shapes" if part.mesh else "has no shape"
        raise InputError(where, said, "give a mesh, or boxes and cylinders")
    if part.mass is not None and part.density is not None:
        raise InputError(where, "has mass and density", "keep one of the two")
    if not any(part.axis):
        raise InputError(f"{where}.axis", "is zero", "give for example [0, 0, 1]")
    _check_joint(part, where)


def _check_joint(part: SecondPart, where: str) -> None:
    jointed = ("anchor", "axis", "range", "stiffness", "rest", "damping", "friction")
    unused = {"fixed": (*jointed, "goal"), "free": jointed, "slide": ("anchor",), "hinge": ()}[part.joint]
    usual = SecondPart(name="x", joint="hinge")
    for key in unused:
        if getattr(part, key) != getattr(usual, key):
            raise InputError(f"{where}.{key}", f"means nothing for a part that is {part.joint}", "leave it out")
    for key, pair in (("range", part.range), ("goal", part.goal)):
        if pair is not None and not pair[0] < pair[1]:
            raise InputError(f"{where}.{key}", f"is {list(pair)}", "give the least travel, then the largest")
    if part.range is not None and not part.range[0] <= 0.0 <= part.range[1]:
        raise InputError(
            f"{where}.range", f"{list(part.range)} leaves out 0, where it starts", "measure it from the start"
        )


def _check_mesh(part: FixturePart | HeldPart | SecondPart, path: Path, key: str) -> None:
    file = path.parent / part.mesh
    check_file(file, f"{path}: {key}.mesh", "it is relative to the fixture file", name=repr(part.mesh))
    if not file.resolve().is_relative_to(path.parent.resolve()):
        what = f"{part.mesh} lies outside the fixture file's folder"
        raise InputError(f"{path}: {key}.mesh", what, "put meshes and fixture file into one folder")
    if part.units is None and file.suffix.lower() != ".glb":
        what = f"is missing: {part.mesh} does not say what its numbers are"
        raise InputError(f"{path}: {key}.units", what, 'write for example units = "mm"')


def mesh_files(path: Path) -> dict[str, Path]:
    """The mesh files of a fixture file by the names that it uses.

    Raises:
        InputError: as `read_fixture`.
    """
    file = read_fixture(path)
    names = (file.fixture.mesh, file.tool.mesh, *(part.mesh for part in file.second))
    return {name: path.parent / name for name in names if name}
