r"""Payload of a robot as a parameter.

A load m other than that of robot.toml's `[payload]` scales the inertia of link and load,

    I(m) = I_published (m_link - m_declared + m) / m_link,

because only their sum is published.
"""

from __future__ import annotations

import dataclasses

import pinocchio as pin

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.spec import LinkInertia, RobotSpec
from skillframe.robot.urdf import INERTIA, read_urdf


def with_payload(spec: RobotSpec, mass: float) -> RobotSpec:
    """Return the robot with another payload [kg].

    Raises:
        InputError: no payload is declared, or the mass is negative or above the rating.
        UnknownName: the URDF lacks the declared link.
    """
    where = f"{spec.folder / 'robot.toml'}: payload"
    if spec.payload is None:
        raise InputError(where, "the robot declares no payload", "add [payload] with link, mass and rating")
    if not 0.0 <= mass <= spec.payload.rating:
        text = f"{mass:g} kg is not within 0 and the rating of {spec.payload.rating:g} kg"
        raise InputError(where, text, "carry less")
    mass = float(mass)  # the repr of NumPy scalars is not valid in a URDF
    link, published = spec.payload.link, published_inertia(spec)
    left = published.mass - spec.payload.mass
    if left < 0.0:
        text = f"link {link!r} weighs {published.mass:g} kg, less than the payload of {spec.payload.mass:g} kg in it"
        raise InputError(where, text, "correct the payload's mass")
    scale = (left + mass) / published.mass
    xx, yy, zz, xy, xz, yz = (scale * x for x in published.inertia)
    loaded = dataclasses.replace(published, mass=scale * published.mass, inertia=(xx, yy, zz, xy, xz, yz))
    return dataclasses.replace(
        spec, inertia=spec.inertia | {link: loaded}, payload=dataclasses.replace(spec.payload, mass=mass)
    )


def published_inertia(spec: RobotSpec) -> LinkInertia:
    """Inertia of the payload's link, from robot.toml's overlay or else the URDF."""
    assert spec.payload is not None
    name = spec.payload.link
    if name in spec.inertia:
        return spec.inertia[name]
    links = read_urdf(spec.urdf).links
    if name not in links:
        raise UnknownName("link", name, links, f"named in {spec.name}'s [payload]")
    inertial = links[name].find("inertial")
    origin = inertial.find("origin") if inertial is not None else None
    mass, inertia = (inertial.find(tag) if inertial is not None else None for tag in ("mass", "inertia"))
    turned = origin is not None and any(float(x) for x in origin.get("rpy", "0").split())
    if mass is None or inertia is None or turned:
        text = f"the inertia of link {name!r} is missing, or given in turned axes"
        raise InputError(spec.urdf, text, "write it in the link's axes")
    com = tuple(float(x) for x in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split())
    values = {key: float(inertia.get(key, 0.0)) for key in INERTIA}
    in_order = tuple(values[key] for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return LinkInertia(mass=float(mass.get("value", 0.0)), com=com, inertia=in_order)  # type: ignore[arg-type]


def loaded_inertias(robot: RobotModel, masses: Float) -> tuple[str, list[pin.Inertia]]:
    """Joint that moves the payload, and the inertia moving with it for masses (N,) [kg].

    The inertia is linear in the mass.

    Raises:
        InputError, UnknownName: see `with_payload`.
    """
    for mass in masses:
        with_payload(robot.spec, float(mass))
    payload = robot.spec.payload
    assert payload is not None
    joint = robot.model.frames[robot.model.getFrameId(payload.link, pin.FrameType.BODY)].parentJoint
    empty, full = (
        load_model(with_payload(robot.spec, mass)).model.inertias[joint].toDynamicParameters()
        for mass in (0.0, payload.rating)
    )
    per_kilogram = (full - empty) / max(payload.rating, 1e-9)
    return str(robot.model.names[joint]), [
        pin.Inertia.FromDynamicParameters(empty + float(mass) * per_kilogram) for mass in masses
    ]
