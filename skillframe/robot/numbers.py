"""Numbers in a URDF, checked before a parser stumbles over them: each must be present, finite and as many as needed."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

from skillframe.errors import InputError

LARGEST = 1e15  # SI; squares and products of such numbers still fit a double; limits may be any number
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
    """Numbers of an attribute, `default` where element or attribute is absent. `ValueError` where they are none."""
    text = element.get(attribute) if element is not None else None
    if text is None:
        return default
    values = tuple(float(word) for word in text.split())
    if len(values) != count or not all(map(math.isfinite, values)) or "_" in text:
        raise ValueError(text)
    return values


def check_link_numbers(path: Path, name: str, link: ET.Element) -> None:
    """Check inertia and geometry of a link.

    Raises:
        InputError: a number is missing or is none.
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
    """Check origin, axis, limits and couplings of a joint.

    Raises:
        InputError: a number is none.
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
