"""`fixture.toml` as checked records: which mesh stands, which is held, how they touch, and when they are assembled.

Paths are relative to the file and may not leave its folder, so that a campaign's folder can hold all of it. STL, OBJ,
PLY and OFF carry no unit, and none is guessed. GLB has metres, STEP says its own.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError
from skillframe.parts.scenes import is_scene, read_scene, with_bodies
from skillframe.parts.second_declared import MeshPlace, SecondPart, Triple, Units, check_second
from skillframe.parts.step import ENDINGS

SCALES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
"""Metres per unit of a mesh file."""
DENSITY = 2700.0
"""Of the held part where the file gives neither mass nor density [kg/m3]: aluminium."""


OVERLAP = 1e-5
"""Overlap of assembled parts that is let pass where the file says nothing [m]: less than a contact sinks by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FixturePart:
    """`[fixture]`, the part that stands still.

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
    """`[tool]`, the part in the robot's grip.

    Attributes:
        mesh: its file.
        units: of the file; GLB has metres, STEP its own.
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
    tip: Literal["auto"] | Triple = "auto"
    grip: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactKeys:
    """`[contact]`.

    Attributes:
        friction: Coulomb coefficient [0 to 5].
        as_meshed: the meshes are the parts: facets and closed holes are not held against the curves once drawn.
        overlap: mean thickness of what both parts claim in the assembled pose that is let pass [m, 0mm to 0.1mm].
        by: what the parts collide with; "auto": convex pieces where these are exact, else surfaces.
    """

    friction: float = 0.2
    as_meshed: bool = False
    overlap: float = OVERLAP
    by: Literal["auto", "pieces", "surface"] = "auto"


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
        turned: how far a part with `turns` may be from the end of its turn [rad, 0.1deg to 180deg].
    """

    height: float = 0.001
    sideways: float = 0.002
    tilt: float = 0.035
    turned: float = 0.05


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
class TurnKeys:
    """`[[task.turns]]`, a point of the way out of a part that is screwed in, as a bayonet is.

    Attributes:
        lift: of the part above its assembled place [m, 1um to 200mm].
        turn: of it there against its assembled attitude, right-handed about the way out [rad, -360deg to 360deg].
    """

    lift: float
    turn: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskKeys:
    """`[task]`.

    Attributes:
        axis: of insertion in the frame of `pose` and `assembled`; "auto" takes the first free of -z, z, -x, x, -y, y.
        start: where runs start.
        seated: what counts as done.
        demonstration: how it is shown.
        turns: points of the way out, the lowest first, between which a part is lifted and turned evenly; it is turned
            no further above the last. Without any it goes straight.
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
    return _with_scene(file, path)


def _with_scene(file: FixtureFile, path: Path) -> FixtureFile:
    """The file with the bodies of its scene that move, if it has one."""
    scene = file.fixture.mesh if is_scene(file.fixture.mesh) else ""
    if not scene:
        for index, part in enumerate(file.second):
            if part.joint == "scene":
                what = f"means a body of the scene, and {file.fixture.mesh} is a mesh"
                raise InputError(f"{path}: second[{index}].joint", what, 'take "hinge", "slide", "free" or "fixed"')
        return file
    file = replace(file, second=with_bodies(file.second, path, scene, file.fixture.pose))
    for index, part in enumerate(file.second):
        check_second(file.second, index, f"{path.parent / scene}: body {part.name!r}")
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
    """Does a file say itself what its numbers are, by its ending? GLB and scenes have metres, STEP its own unit."""
    return mesh.lower().endswith((".glb", *ENDINGS)) or is_scene(mesh)


def mesh_files(path: Path) -> dict[str, Path]:
    """The mesh files of a fixture file by the names that it uses.

    Raises:
        InputError: as `read_fixture`.
    """
    file = read_fixture(path)
    names = [file.fixture.mesh, file.tool.mesh, *(part.mesh for part in file.second)]
    for scene in {name for name in names[:2] if is_scene(name)}:
        names += [_inside(mesh, path, scene) for mesh in read_scene(path.parent / scene).meshes]
    return {name: path.parent / name for name in names if name}


def _inside(mesh: Path, path: Path, scene: str) -> str:
    """A scene's mesh relative to the fixture file."""
    if not mesh.is_file():
        raise InputError(path.parent / scene, f"names {mesh.name}, which is not there", "it is relative to the scene")
    if not mesh.resolve().is_relative_to(path.parent.resolve()):
        what = f"names {mesh}, which lies outside the fixture file's folder"
        raise InputError(path.parent / scene, what, "put scene, meshes and fixture file into one folder")
    return mesh.resolve().relative_to(path.parent.resolve()).as_posix()
