"""Records of `fixture.toml`: the standing and the held mesh, their contact, and their assembled pose.

Paths are relative to the file and stay in its folder, which a campaign can copy. STL, OBJ, PLY and OFF have no unit and
need one; GLB is in metres, STEP has its own.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError
from skillframe.files.documents import refuse_other
from skillframe_parts.scenes import is_scene, read_scene, with_bodies
from skillframe_parts.second_declared import MeshPlace, SecondPart, Triple, Units, check_second, second_in_si
from skillframe_parts.step import ENDINGS

SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
"""Metres per unit of a mesh file."""
DENSITY = 2700.0
"""Density of a held part without mass or density [kg/m3]: aluminium."""
OVERLAP = 1e-5
"""Default tolerance for overlap of assembled parts [m], less than contact penetration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FixturePart:
    """`[fixture]`, the standing part.

    Attributes:
        mesh: its file.
        units: of the file; GLB has metres, STEP its own.
        pose: of the mesh; the identity if both parts were exported from one assembly.
        table: whether it stands on a table, a plane under its lowest point.
    """

    mesh: str
    units: Units | None = None
    pose: MeshPlace = field(default_factory=MeshPlace)
    table: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPart:
    """`[tool]`, the held part.

    Attributes:
        mesh: its file.
        units: of the file; GLB has metres, STEP its own.
        assembled: pose of the mesh when done.
        density: of the part [kg/m3, 1 to 30000].
        mass: of the part, in place of its density [kg, 0.1g to 100kg].
        tip: point of the assembled part in the frame of `assembled` [m], or "auto": its lowest end, in the middle.
        grip: from the wrist to the tip [m, 20mm to 1m].
    """

    mesh: str
    units: Units | None = None
    assembled: MeshPlace = field(default_factory=MeshPlace)
    density: float | None = None
    mass: float | None = None
    tip: Literal["auto"] | Triple = "auto"
    grip: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactKeys:
    """`[contact]`.

    Attributes:
        friction: Coulomb coefficient [0 to 5].
        as_meshed: the meshes are the parts: facets and closed holes are not checked against the original curves.
        overlap: tolerated mean thickness of overlap in the assembled pose [m, 0mm to 0.1mm].
        by: collision geometry; "auto": convex pieces where these are exact, else surfaces.
    """

    friction: float = 0.2
    as_meshed: bool = False
    overlap: float = OVERLAP
    by: Literal["auto", "pieces", "surface"] = "auto"


@dataclass(frozen=True, slots=True, kw_only=True)
class StartKeys:
    """Where runs start.

    Attributes:
        above_mouth: height of the tip over the hole entrance [m, 0m to 200mm].
    """

    above_mouth: float = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatedKeys:
    """How near the assembled pose counts as seated.

    Attributes:
        height: along the axis [m, 1um to 100mm].
        sideways: [m, 1um to 100mm].
        tilt: of the axis [rad, 0.1deg to 90deg].
        turned: distance of a part with `turns` from the end of its turn [rad, 0.1deg to 180deg].
    """

    height: float = 0.001
    sideways: float = 0.002
    tilt: float = 0.035
    turned: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownKeys:
    """Starts of the simulated teacher: at the hole entrance, tilted about y, then about x.

    Attributes:
        tilt: at the start [rad, 0deg to 30deg].
        deep: depth of the lowest corner in the hole at the start, or less where it does not fit [m, 0m to 50mm].
    """

    tilt: float = 0.13962634015954636
    deep: float = 0.0007


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnKeys:
    """`[[task.turns]]`, a point of the way out of a part that is screwed in, as a bayonet.

    Attributes:
        lift: of the part above its assembled place [m, 1um to 200mm].
        turn: rotation there from its assembled orientation, right-handed about the way out [rad, -360deg to 360deg].
    """

    lift: float
    turn: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskKeys:
    """`[task]`.

    Attributes:
        axis: of insertion in the frame of `pose` and `assembled`; "auto" takes the first free of -z, z, -x, x, -y, y,
            and of the normals of the held part's largest flat sides.
        start: of runs.
        seated: tolerances of the goal.
        demonstration: starts of the simulated teacher.
        turns: points of the way out, the lowest first, interpolated linearly and constant above the last. Without any
            it is straight.
    """

    axis: Literal["auto"] | Triple = (0.0, 0.0, -1.0)
    start: StartKeys = field(default_factory=StartKeys)
    seated: SeatedKeys = field(default_factory=SeatedKeys)
    demonstration: ShownKeys = field(default_factory=ShownKeys)
    turns: tuple[TurnKeys, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FixtureFile:
    """A whole `fixture.toml`.

    Attributes:
        second: further parts of the fixture.
        summary: description for people.
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
        InputError: an invalid key or value, a mesh without units, or a missing mesh.
    """
    check_file(path, path, "check the path")
    refuse_other(path, "fixture")
    file = build(FixtureFile, second_in_si(read_toml(path), str(path)), str(path))
    for key, side in (("fixture", file.fixture), ("tool", file.tool)):
        _check_mesh(side, path, key)
    if file.tool.mass is not None and file.tool.density is not None:
        raise InputError(f"{path}: tool", "has mass and density", "keep one of the two")
    if not isinstance(file.task.axis, str) and not any(file.task.axis):
        raise InputError(f"{path}: task.axis", "is zero", 'give for example [0, 0, -1], or "auto"')
    lifts = [each.lift for each in file.task.turns]
    if lifts != sorted(set(lifts)):
        raise InputError(f"{path}: task.turns", "do not rise", "give the lowest lift first, each once")
    for index, second in enumerate(file.second):
        check_second(file.second, index, f"{path}: second[{index}]")
        if second.mesh:
            _check_mesh(second, path, f"second[{index}]")
            if is_scene(second.mesh):
                fix = "name it as [fixture] mesh, and its bodies come with it"
                raise InputError(f"{path}: second[{index}].mesh", f"{second.mesh} is a scene", fix)
    scene = file.fixture.mesh if is_scene(file.fixture.mesh) else ""
    if scene:
        file = replace(file, second=with_bodies(file.second, path, scene, file.fixture.pose))
    for index, part in enumerate(file.second):
        if scene:
            check_second(file.second, index, f"{path.parent / scene}: body {part.name!r}")
        elif part.joint == "scene":
            what = f"means a body of the scene, and {file.fixture.mesh} is a mesh"
            raise InputError(f"{path}: second[{index}].joint", what, 'take "hinge", "slide", "free" or "fixed"')
    return file


def check_file(path: Path, where: object, fix: str, *, name: str = "") -> None:
    """Refuse a path that is no readable file, such as a folder, a pipe, a device, or a link to itself.

    `where`, `fix` and `name` (as written by the user) are for the message.

    Raises:
        InputError: with what is there instead.
    """
    named = f": {name}" if name else ""
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        link = path.is_symlink()
        what = f"is a link to {os.readlink(path)!r}, which is not there" if link else "no such file"
        raise InputError(where, what + named, fix) from None
    except (OSError, ValueError) as error:  # ValueError: zero byte in the name
        raise InputError(where, f"cannot be opened ({getattr(error, 'strerror', None) or error}){named}", fix) from None
    if not stat.S_ISREG(kind):
        what = "is a folder" if stat.S_ISDIR(kind) else "is a pipe or a device, not a file"
        raise InputError(where, what + named, "name a file")


def _check_mesh(part: FixturePart | HeldPart | SecondPart, path: Path, key: str) -> None:
    file = path.parent / part.mesh
    check_file(file, f"{path}: {key}.mesh", "it is relative to the fixture file", name=repr(part.mesh))
    if not file.resolve().is_relative_to(path.parent.resolve()):
        what = f"{part.mesh} lies outside the fixture file's folder"
        raise InputError(f"{path}: {key}.mesh", what, "put meshes and fixture file into one folder")
    if is_scene(part.mesh):
        if part.units not in (None, "m"):
            raise InputError(f"{path}: {key}.units", f"is {part.units!r}, and a scene is in metres", "leave it out")
        return
    if part.units is None and not has_units(part.mesh):
        what = f"is missing: {part.mesh} does not say what its numbers are"
        raise InputError(f"{path}: {key}.units", what, 'write for example units = "mm"')


def has_units(mesh: str) -> bool:
    """Whether a file's format defines its unit, by its suffix: GLB and scenes are in metres, STEP has its own."""
    return mesh.lower().endswith((".glb", *ENDINGS)) or is_scene(mesh)


def mesh_files(path: Path) -> dict[str, Path]:
    """The mesh files of a fixture file by the names that it uses.

    Raises:
        InputError: as `read_fixture`.
    """
    file = read_fixture(path)
    names = [file.fixture.mesh, file.tool.mesh, *(part.mesh for part in file.second)]
    folder = path.parent.resolve()
    for scene in {name for name in names[:2] if is_scene(name)}:
        where = path.parent / scene
        for mesh in read_scene(where).meshes:
            if not mesh.is_file():
                raise InputError(where, f"names {mesh.name}, which is not there", "it is relative to the scene")
            if not mesh.resolve().is_relative_to(folder):
                what = f"names {mesh}, which lies outside the fixture file's folder"
                raise InputError(where, what, "put scene, meshes and fixture file into one folder")
            names.append(mesh.resolve().relative_to(folder).as_posix())
    return {name: path.parent / name for name in names if name}
