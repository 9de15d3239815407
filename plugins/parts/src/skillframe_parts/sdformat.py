"""Reads an SDFormat file (1.5 to 1.12) as a `DrawnScene`: links with boxes, cylinders and meshes, and joints.

Poses are x y z and roll pitch yaw about fixed axes, of a link in its model and of a joint in its child link unless
`relative_to` names another frame. An axis is in the joint's frame, or in the model's by `expressed_in` or, up to 1.6,
`use_parent_model_frame` (sdformat.org, "Pose frame semantics"). Links of static models and those fixed to `world`
stand. A link without a joint is free.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.files.documents import parse_xml, read_bytes
from skillframe.frames import Float
from skillframe_parts.shapes import DrawnScene, Moving, Shape, refuse, turned

_KNOWN = {
    "sdf": ("world", "model"),
    "world": ("model",),
    "model": ("static", "pose", "link", "joint"),
    "link": ("pose", "inertial", "collision", "gravity"),
    "collision": ("pose", "geometry"),
    "geometry": ("box", "cylinder", "mesh"),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "mesh": ("uri", "scale"),
    "joint": ("pose", "parent", "child", "axis"),
    "axis": ("xyz", "limit", "dynamics", "use_parent_model_frame"),
    "limit": ("lower", "upper"),
    "dynamics": ("damping", "friction", "spring_reference", "spring_stiffness"),
}
"""Supported elements by parent."""
_PASSED = {
    "world": ("physics", "gravity", "magnetic_field", "atmosphere", "scene", "light", "gui", "plugin", "wind", "audio",
              "spherical_coordinates"),
    "model": ("self_collide", "allow_auto_disable", "enable_wind"),
    "link": ("visual", "light", "sensor", "audio_source", "self_collide", "enable_wind", "must_be_base_link"),
    "collision": ("surface", "max_contacts", "laser_retro", "density"),
    "joint": ("sensor", "physics"),
    "limit": ("effort", "velocity", "stiffness", "dissipation"),
}  # fmt: skip
"""Ignored elements: visual, or specific to a simulator."""
_JOINTS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": "fixed"}
_WORLD = "world"


class _Pose(NamedTuple):
    """A frame: rotation (3, 3) and origin (3,)."""

    rotation: Float
    origin: Float

    def __matmul__(self, other: _Pose) -> _Pose:
        return _Pose(self.rotation @ other.rotation, self.rotation @ other.origin + self.origin)


_NONE = _Pose(np.eye(3), np.zeros(3))


class DrawnLink(NamedTuple):
    """A link in its model: rotation (3, 3) and origin (3,) of its frame, its shapes, and its mass [kg]."""

    rotation: Float
    origin: Float
    shapes: tuple[Shape, ...]
    mass: float | None


def read_links(path: Path) -> dict[str, DrawnLink]:
    """The links of an SDFormat file by name, regardless of joints.

    Raises:
        InputError: it cannot be read, or has unsupported elements.
    """
    return {
        name: DrawnLink(*model.frame(name), tuple(model.shapes(name)), model.mass([name]))
        for model in _models(path, parse_xml(path, read_bytes(path, "an SDFormat"), text=True))
        for name in model.links
    }


def read_sdformat(path: Path, root: ET.Element) -> DrawnScene:
    """Fixed and moving bodies of an SDFormat file.

    Raises:
        InputError: unsupported elements, or an invalid number.
    """
    models = _models(path, root)
    shapes = [shape for model in models for shape in model.standing]
    moving = [body for model in models for body in model.moving()]
    names = [body.name for body in moving]
    for name in names:
        if names.count(name) > 1:
            raise refuse(path, f"link {name!r}", "is there twice, in two models")
    drawn = [*shapes, *(shape for body in moving for shape in body.shapes)]
    files = dict.fromkeys(shape.file for shape in drawn if shape.file is not None)
    return DrawnScene(fixed=tuple(shapes), moving=tuple(moving), meshes=tuple(files))


def _models(path: Path, root: ET.Element) -> list[_Model]:
    version = root.get("version", "")
    if version not in [f"1.{k}" for k in range(5, 13)]:
        what = f"is SDFormat {version or 'of no version'}; 1.5 to 1.12 are read"
        raise InputError(path, what, 'say <sdf version="1.9">, and what that means')
    _check_known(path, root)
    return [_Model(path, each) for each in (*root.findall("model"), *root.findall("world/model"))]


def _check_known(path: Path, element: ET.Element) -> None:
    for child in element:
        if child.tag in _PASSED.get(element.tag, ()):
            continue
        if element.tag in _KNOWN and child.tag not in _KNOWN[element.tag]:
            raise refuse(path, f"<{child.tag}> of <{element.tag}>")
        _check_known(path, child)


class _Model:
    """A model: its links and joints by name, and its fixed parts."""

    def __init__(self, path: Path, element: ET.Element) -> None:
        self.path, self.name = path, element.get("name", "model")
        self.links = {each.get("name", ""): each for each in element.findall("link")}
        self.joints = {each.get("name", ""): each for each in element.findall("joint")}
        self.place, static = self._pose(element), element.findtext("static", "").strip() in ("true", "1")
        if element.get("placement_frame") or self._relative(element):
            raise refuse(path, f"placement_frame or relative_to of model {self.name!r}")
        if len(self.links) != len(element.findall("link")) or "" in self.links:
            raise refuse(path, f"model {self.name!r}", "has links without a name of their own")
        self.parents: dict[str, tuple[str, str, str]] = {}
        self.groups = {name: name for name in (_WORLD, *self.links)}
        """First link of each group joined by fixed joints, by link."""
        for name, joint in self.joints.items():
            kind = _JOINTS.get(joint.get("type", ""))
            if kind is None:
                raise refuse(path, f"joint {name!r}", f"is of type {joint.get('type')!r}, which is not read")
            parent, child = (joint.findtext(tag, "").strip() for tag in ("parent", "child"))
            for tag, end in (("parent", parent), ("child", child)):
                if end not in self.links and end != _WORLD:
                    raise refuse(path, f"joint {name!r}", f"has the {tag} {end!r}, which is no link of its model")
            self.parents[name] = kind, parent, child
        for kind, parent, child in self.parents.values():
            if kind == "fixed":
                ends = self.groups[parent], self.groups[child]
                kept, lost = sorted(ends, key=list(self.groups).index)
                self.groups = {name: kept if group == lost else group for name, group in self.groups.items()}
        self.fixed = [name for name in self.links if static or self.groups[name] == self.groups[_WORLD]]
        self.standing = [shape for name in self.fixed for shape in self.shapes(name)]

    def moving(self) -> list[Moving]:
        found = []
        for first in dict.fromkeys(self.groups[name] for name in self.links if name not in self.fixed):
            own = [name for name in self.links if self.groups[name] == first]
            hung = [
                (name, *ends) for name, ends in self.parents.items() if ends[0] != "fixed" and set(ends[1:]) & {*own}
            ]
            shapes = tuple(shape for name in own for shape in self.shapes(name))
            where = f"link {own[0]!r}"
            if not shapes:
                raise refuse(self.path, where, "moves and has nothing that collides")
            if any(self.links[name].findtext("gravity", "1").strip() in ("0", "false") for name in own):
                raise refuse(self.path, f"{where} without gravity")
            mass = self.mass(own)
            if not hung:
                found.append(Moving(name=own[0], joint="free", shapes=shapes, mass=mass))
                continue
            (name, kind, parent, child), *more = hung
            if more or child not in own or not (parent == _WORLD or parent in self.fixed):
                what = f"hangs on joint {name!r} whose parent does not stand, or on more than one"
                raise refuse(self.path, where, f"{what}; fix the parent to the world, or make it a static model")
            found.append(self._jointed(name, kind, child, shapes, mass))
        return found

    def mass(self, own: list[str]) -> float | None:
        given = [each for name in own if (each := self.links[name].find("inertial")) is not None]
        masses = [self._least(each, "mass") for each in given if each.find("mass") is not None]
        if masses and len(masses) < len(own):
            raise refuse(
                self.path, f"link {own[0]!r}", "is fixed to links of which some have a mass and some have none"
            )
        if masses and not sum(masses) > 0.0:
            raise refuse(self.path, f"link {own[0]!r}", "has a mass of 0")
        return sum(masses) if masses else None

    def _jointed(self, name: str, kind: str, child: str, shapes: tuple[Shape, ...], mass: float | None) -> Moving:
        joint = self.joints[name]
        axis = joint.find("axis")
        if axis is None:
            raise refuse(self.path, f"joint {name!r}", "has no axis")
        frame, element = self.frame(name), axis.find("xyz")
        along = np.array([0.0, 0.0, 1.0]) if element is None else np.array(self._numbers(axis, "xyz", 3))
        within = "" if element is None else element.get("expressed_in", "")
        if axis.findtext("use_parent_model_frame", "0").strip() in ("1", "true"):
            within = "__model__"
        if within:
            along = frame.rotation.T @ self.frame(within).rotation @ along
        along = frame.rotation @ along
        low, high = (
            self._number(axis, f"limit/{tag}", default) for tag, default in (("lower", -1e16), ("upper", 1e16))
        )
        most = 1e9  # m or rad; an endless joint has larger limits
        endless = (low <= -most and high >= most) or joint.get("type") == "continuous"
        stiffness = self._least(axis, "dynamics/spring_stiffness")
        return Moving(
            name=child, joint=kind, shapes=shapes, mass=mass, anchor=frame.origin, axis=along,
            range=None if endless else (max(low, -most), min(high, most)), stiffness=stiffness,
            rest=self._number(axis, "dynamics/spring_reference") if stiffness else 0.0,
            damping=self._least(axis, "dynamics/damping"), friction=self._least(axis, "dynamics/friction"),
        )  # fmt: skip

    def frame(self, name: str, deep: int = 0) -> _Pose:
        if name == "__model__":
            return self.place
        if deep > 50:
            raise refuse(self.path, f"the frame {name!r}", "is named in a ring")
        if name in self.links:
            element, usual = self.links[name], "__model__"
        elif name in self.joints:
            element, usual = self.joints[name], self.parents[name][2]
        elif name == _WORLD:
            return _NONE
        else:
            raise refuse(self.path, f"the frame {name!r}", f"is no link or joint of model {self.name!r}")
        return self.frame(self._relative(element) or usual, deep + 1) @ self._pose(element)

    def _relative(self, element: ET.Element) -> str:
        pose = element.find("pose")
        return "" if pose is None else pose.get("relative_to", pose.get("frame", ""))

    def shapes(self, link: str) -> list[Shape]:
        found = []
        for element in self.links[link].findall("collision"):
            if self._relative(element):
                raise refuse(self.path, f"relative_to of a collision of link {link!r}")
            place = self.frame(link) @ self._pose(element)
            shape = element.find("geometry/*")
            if shape is None:
                raise refuse(self.path, f"a collision of link {link!r}", "has no geometry")
            name, file = f"a {shape.tag} of link {link!r}", None
            size: tuple[float, ...]
            if shape.tag == "box":
                size = self._numbers(shape, "size", 3)
            elif shape.tag == "cylinder":
                size = (*self._numbers(shape, "radius", 1), *self._numbers(shape, "length", 1))
            else:
                uri = shape.findtext("uri", "").strip()
                if "://" in uri or not uri:
                    raise refuse(self.path, f"the uri {uri!r} of {name}", "is no path relative to the scene")
                file, size = self.path.parent / uri, (1.0, 1.0, 1.0)
                size = self._numbers(shape, "scale", 3) if shape.find("scale") is not None else size
            turn, origin = place
            found.append(Shape(name=name, kind=shape.tag, size=size, rotation=turn, origin=origin, file=file))
        return found

    def _pose(self, element: ET.Element) -> _Pose:
        pose = element.find("pose")
        if pose is None or not (pose.text or "").strip():
            return _NONE
        if pose.get("rotation_format", "euler_rpy") != "euler_rpy":
            raise refuse(self.path, f"rotation_format of a pose in model {self.name!r}")
        x, y, z, *rpy = self._numbers(element, "pose", 6)
        share = math.pi / 180.0 if pose.get("degrees", "false") in ("true", "1") else 1.0
        roll, pitch, yaw = (share * angle for angle in rpy)
        return _Pose(turned((roll, pitch, yaw)), np.array([x, y, z]))

    def _number(self, element: ET.Element, tag: str, default: float = 0.0) -> float:
        return default if element.find(tag) is None else self._numbers(element, tag, 1)[0]

    def _least(self, element: ET.Element, tag: str) -> float:
        value = self._number(element, tag)
        if value < 0.0:
            raise refuse(self.path, f"<{tag.rpartition('/')[2]}> in model {self.name!r}", "is below 0")
        return value

    def _numbers(self, element: ET.Element, tag: str, count: int) -> tuple[float, ...]:
        text = element.findtext(tag, "")
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        limit = tag.startswith("limit/")
        if len(values) != count or any(math.isnan(x) or (math.isinf(x) and not limit) for x in values):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            said = f"<{tag.rpartition('/')[2]}> of <{element.tag}> in model {self.name!r}"
            raise InputError(self.path, f"{said} is {text.strip()!r:.60}, not {wanted}", "correct it")
        return values
