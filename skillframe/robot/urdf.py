"""Reading of a URDF as a checked tree of links and joints, without any robot library.

It reports everything that would make a URDF parser fail or crash, in one sentence.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

from skillframe.errors import InputError, UnknownName
from skillframe.files.documents import parse_xml, read_bytes

LARGEST = 1e15  # SI; squares and products still fit a double
INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_JOINT_NUMBERS = {
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("multiplier", "offset"),
    "dynamics": ("damping", "friction"),
}
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
}


def numbers(element: ET.Element | None, attribute: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
    """Numbers of an attribute, or `default` if absent. Raises `ValueError` for anything else."""
    text = element.get(attribute) if element is not None else None
    if text is None:
        return default
    values = tuple(float(word) for word in text.split())
    if len(values) != count or not all(map(math.isfinite, values)) or "_" in text:
        raise ValueError(text)
    return values


def check_link_numbers(path: Path, name: str, link: ET.Element) -> None:
    """Check the inertia and geometry of a link.

    Raises:
        InputError: a number is missing or invalid.
    """
    where = f"{path}: link {name!r}"
    inertial = link.find("inertial")
    if inertial is not None:
        _check_origin(where + " inertial", inertial)
        _required(where + " inertial", inertial, "mass", ("value",))
        _required(where + " inertial", inertial, "inertia", INERTIA)
    for drawn in [*link.findall("visual"), *link.findall("collision")]:
        _check_origin(f"{where} {drawn.tag}", drawn)
        for shape in drawn.findall("geometry/*"):
            for attribute, count in _SHAPES.get(shape.tag, {}).items():
                _check(f"{where} {drawn.tag} {shape.tag}", shape, attribute, count, required=True)


def check_joint_numbers(path: Path, name: str, joint: ET.Element) -> None:
    """Check the origin, axis, limits and couplings of a joint.

    Raises:
        InputError: a number is invalid.
    """
    where = f"{path}: joint {name!r}"
    _check_origin(where, joint)
    axis = joint.find("axis")
    if axis is not None:
        _check(f"{where} axis", axis, "xyz", 3, required=True)
    for tag, attributes in _JOINT_NUMBERS.items():
        element = joint.find(tag)
        for attribute in attributes if element is not None else ():
            _check(f"{where} {tag}", element, attribute, 1)
    limit = joint.find("limit")
    for attribute in ("effort", "velocity"):
        if numbers(limit, attribute, 1, (0.0,))[0] < 0.0:
            raise InputError(f"{where} limit", f"{attribute} is below zero", "give its size")
    mimic = joint.find("mimic")
    if mimic is not None and not mimic.get("joint"):
        raise InputError(f"{where} mimic", "names no joint to follow", 'write <mimic joint="..."/>')


def _check_origin(where: str, element: ET.Element) -> None:
    origin = element.find("origin")
    if origin is not None:
        _check(f"{where} origin", origin, "xyz", 3)
        _check(f"{where} origin", origin, "rpy", 3)


def _required(where: str, parent: ET.Element, tag: str, attributes: tuple[str, ...]) -> None:
    element = parent.find(tag)
    if element is None:
        raise InputError(where, f"has no <{tag}>", f"add it, or remove <{parent.tag}>")
    for attribute in attributes:
        _check(f"{where} {tag}", element, attribute, 1, required=True)


def _check(where: str, element: ET.Element | None, attribute: str, count: int, required: bool = False) -> None:
    given = element.get(attribute) if element is not None else None
    if required and given is None:
        raise InputError(where, f"has no {attribute!r}", "add it")
    try:
        large = max((abs(x) for x in numbers(element, attribute, count, ())), default=0.0)
    except ValueError:
        wanted = "one finite number" if count == 1 else f"{count} finite numbers"
        raise InputError(f"{where}: {attribute}", f"expected {wanted}, got {given!r}", "correct it") from None
    if large > LARGEST and not where.endswith("limit"):
        raise InputError(f"{where}: {attribute}", f"{given} is beyond any physical size", "correct it")


JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_OTHER_FORMATS = {"sdf": "an SDF model", "mujoco": "a MuJoCo model", "COLLADA": "a COLLADA mesh", "KinBody": "OpenRAVE"}


class Joint(NamedTuple):
    """A joint with the names of its links."""

    name: str
    type: str
    parent: str
    child: str
    element: ET.Element


class Urdf(NamedTuple):
    """A checked tree.

    Attributes:
        links: elements by name; joints: by name, in file order; root: name of the root link.
    """

    path: Path
    name: str
    links: dict[str, ET.Element]
    joints: dict[str, Joint]
    root: str

    def children(self) -> dict[str, list[Joint]]:
        """Child joints of each link."""
        hanging: dict[str, list[Joint]] = {link: [] for link in self.links}
        for joint in self.joints.values():
            hanging[joint.parent].append(joint)
        return hanging


def read_urdf(path: Path) -> Urdf:
    """Read and check a URDF.

    Raises:
        InputError: it cannot be loaded.
    """
    root = parse_xml(path, read_bytes(path))
    if root.tag != "robot":
        kind = _OTHER_FORMATS.get(root.tag, f"an XML file of <{root.tag}>")
        raise InputError(path, f"is {kind}, not a URDF (its first element must be <robot>)", "give a URDF")
    for element in root.iter():
        macro = element.tag.startswith("xacro:")
        if macro or (
            any("${" in v for v in element.attrib.values() if v) and element.tag in ("link", "joint", "origin")
        ):
            raise InputError(
                path, "is a xacro, not yet a URDF", f"type: xacro {path.name} > {path.stem.split('.')[0]}.urdf"
            )
    links: dict[str, ET.Element] = {}
    for element in root.findall("link"):
        name = _name(path, element, links)
        check_link_numbers(path, name, element)
        links[name] = element
    if not links:
        raise InputError(path, "has no link", "give a URDF with at least one <link>")
    joints: dict[str, Joint] = {}
    for element in root.findall("joint"):
        name = _name(path, element, joints)
        kind = element.get("type", "")
        if kind not in JOINT_TYPES:
            known = ", ".join(JOINT_TYPES)
            raise InputError(f"{path}: joint {name!r}", f"has the unknown type {kind!r}", f"URDF knows {known}")
        ends = [_end(path, name, element, end, links) for end in ("parent", "child")]
        check_joint_numbers(path, name, element)
        joints[name] = Joint(name, kind, ends[0], ends[1], element)
    return Urdf(path, root.get("name") or path.stem, links, joints, _find_root(path, links, joints))


def _name(path: Path, element: ET.Element, taken: dict[str, ET.Element] | dict[str, Joint]) -> str:
    name = element.get("name", "")
    if not name.strip():
        raise InputError(path, f"has a <{element.tag}> without a name", f"give every {element.tag} a name")
    if name in taken:
        raise InputError(path, f"has two {element.tag}s named {name!r}", "rename one of them")
    return name


def _end(path: Path, joint: str, element: ET.Element, end: str, links: dict[str, ET.Element]) -> str:
    found = element.find(end)
    link = found.get("link", "") if found is not None else ""
    if not link:
        raise InputError(f"{path}: joint {joint!r}", f"has no {end} link", f'add <{end} link="..."/>')
    if link not in links:
        raise InputError(
            f"{path}: joint {joint!r}", f"{end}: {UnknownName('link', link, links)}", "add or rename the link"
        )
    return link


def _find_root(path: Path, links: dict[str, ET.Element], joints: dict[str, Joint]) -> str:
    parent: dict[str, Joint] = {}
    for joint in joints.values():
        if joint.child in parent:
            both = f"{parent[joint.child].name!r} and {joint.name!r}"
            raise InputError(
                f"{path}: link {joint.child!r}",
                f"is the child of two joints, {both}, so the links form no tree",
                "remove one joint; closed chains go into robot.toml as [[loop]]",
            )
        parent[joint.child] = joint
    roots = [link for link in links if link not in parent]
    if len(roots) > 1:
        raise InputError(path, f"has {len(roots)} root links ({_some(roots)})", "join them with a fixed joint")
    hanging: dict[str, list[str]] = {}
    for joint in joints.values():
        hanging.setdefault(joint.parent, []).append(joint.child)
    loose, layer, depth = {j.child for j in joints.values()}, roots, 0
    while layer:
        layer = [child for link in layer for child in hanging.get(link, [])]
        loose -= set(layer)
        depth += 1
        if depth > 1000:  # parsers recurse by link and overflow the stack near 4000
            raise InputError(path, "is a chain of more than 1000 links", "merge links that are fixed together")
    if not roots or (loose < set(links) and loose):
        text = f"its links form a cycle ({_some(sorted(loose))})" + ("" if roots else ", so there is no root link")
        raise InputError(path, text, "cut one joint; closed chains go into robot.toml as [[loop]]")
    return roots[0]


def _some(names: list[str]) -> str:
    return ", ".join(repr(n) for n in names[:4]) + (", ..." if len(names) > 4 else "")
