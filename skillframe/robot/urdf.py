"""A URDF as a checked tree of links and joints, read without any robot library.

Everything that would make a URDF parser fail, print to the terminal or crash is found here first and said in one
sentence: markup errors, document types (entity bombs), missing or doubled names, unknown joint types, cycles, several
roots, numbers that are none. Prefixed elements (`xacro:`, `sensor:`) need no declared namespace, as URDF parsers do.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

from skillframe.errors import InputError, UnknownName
from skillframe.robot.numbers import check_joint_numbers, check_link_numbers

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_OTHER_FORMATS = {"sdf": "an SDF model", "mujoco": "a MuJoCo model", "COLLADA": "a COLLADA mesh", "KinBody": "OpenRAVE"}
_LARGEST_FILE = 64 * 2**20  # bytes; the largest humanoids are below 1 MB
_DEEPEST_CHAIN = 1000  # links; parsers recurse per link and overflow their stack near 4000


class Joint(NamedTuple):
    """A joint: its name, type and the names of the links that it joins."""

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
        """Joints whose parent is each link."""
        hanging: dict[str, list[Joint]] = {link: [] for link in self.links}
        for joint in self.joints.values():
            hanging[joint.parent].append(joint)
        return hanging


def read_urdf(path: Path) -> Urdf:
    """Read and check a URDF.

    Raises:
        InputError: it cannot be loaded; says what, where and what to do.
    """
    root = parse_xml(path, read_bytes(path))
    _check_root(path, root)
    links = _links(path, root)
    joints = _joints(path, root, links)
    return Urdf(path, root.get("name") or path.stem, links, joints, _find_root(path, links, joints))


def read_bytes(path: Path, kind: str = "a URDF") -> bytes:
    """The content of an XML file, which is not empty, not binary and not huge.

    Raises:
        InputError: it is, or cannot be read. `kind` is what it ought to be.
    """
    if path.is_dir():
        raise InputError(path, "is a folder", f"give {kind} file in it")
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(path, "is larger than 64 MB", f"is it {kind}?")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    if not content.strip():
        raise InputError(path, "is empty", f"give {kind}")
    if b"\0" in content[:1024] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(path, f"is a binary file, not {kind}", f"give {kind} itself, which is XML text")
    return content


def parse_xml(path: Path, content: bytes, text: bool = False) -> ET.Element:
    """The element tree, built on expat without namespaces. A document type is refused before its entities expand.

    Args:
        path: of the file, for messages.
        content: what it holds.
        text: keep what stands between elements, which says nothing in a URDF.

    Raises:
        InputError: it is no XML, or has a document type.
    """
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()

    def refuse(*_: object) -> NoReturn:
        raise InputError(f"{path}: line {parser.CurrentLineNumber}", "has a document type (DOCTYPE)", "remove it")

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    if text:
        parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        where = f"{path}: line {error.lineno}"
        raise InputError(where, f"is not valid XML ({expat.ErrorString(error.code)})", "correct that line") from None
    except (LookupError, ValueError) as error:
        raise InputError(path, f"is in an encoding that cannot be read ({error})", "save it as UTF-8") from None
    return builder.close()


def _check_root(path: Path, root: ET.Element) -> None:
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


def _links(path: Path, root: ET.Element) -> dict[str, ET.Element]:
    links: dict[str, ET.Element] = {}
    for element in root.findall("link"):
        name = _name(path, element, links)
        check_link_numbers(path, name, element)
        links[name] = element
    if not links:
        raise InputError(path, "has no link", "give a URDF with at least one <link>")
    return links


def _joints(path: Path, root: ET.Element, links: dict[str, ET.Element]) -> dict[str, Joint]:
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
    return joints


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
    """The one link without a parent, from which every other can be reached."""
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
    loose = _unreached(path, roots, joints)
    if not roots or (loose < set(links) and loose):
        text = f"its links form a cycle ({_some(sorted(loose))})" + ("" if roots else ", so there is no root link")
        raise InputError(path, text, "cut one joint; closed chains go into robot.toml as [[loop]]")
    return roots[0]


def _unreached(path: Path, roots: list[str], joints: dict[str, Joint]) -> set[str]:
    """Links that cannot be reached from the root."""
    hanging: dict[str, list[str]] = {}
    for joint in joints.values():
        hanging.setdefault(joint.parent, []).append(joint.child)
    loose, layer, depth = {j.child for j in joints.values()}, roots, 0
    while layer:
        layer = [child for link in layer for child in hanging.get(link, [])]
        loose -= set(layer)
        depth += 1
        if depth > _DEEPEST_CHAIN:
            raise InputError(
                path, f"is a chain of more than {_DEEPEST_CHAIN} links", "merge links that are fixed together"
            )
    return loose


def _some(names: list[str]) -> str:
    return ", ".join(repr(n) for n in names[:4]) + (", ..." if len(names) > 4 else "")
