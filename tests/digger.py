"""A small digger written as docs/how-to/own-crane.md says: boom, stick and bucket, each with its own cylinder.

Another machine than the crane that ships in everything its gains depend on: an eighth of the load, pistons of 50 to
63 mm, tenths of a litre of dead volume where the crane has litres, valves of a quarter of the flow. All figures are
ours, of the size of a digger of 1.5 t. Points are in the plane (x forward, z up), angles up from the parent link's x.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

HOME = {"boom": math.radians(55.0), "stick": math.radians(-100.0), "bucket": math.radians(-30.0)}
PIVOT = (0.2, 0.5)


class Part(NamedTuple):
    """A link: what it hangs on and where, mass [kg], centre, inertia about it [kg m2], range [rad]."""

    parent: str
    at: tuple[float, float]
    mass: float
    centre: tuple[float, float]
    inertia: float
    low: float
    high: float


class Jack(NamedTuple):
    """A cylinder: barrel's pivot on the parent, rod's eye on the link, closed length, stroke [m]; masses [kg]."""

    pivot: tuple[float, float]
    eye: tuple[float, float]
    closed: float
    stroke: float
    barrel: float
    rod: float


PARTS = {
    "boom": Part("base_link", PIVOT, 110.0, (0.8, 0.05), 32.0, 0.1, 1.5),
    "stick": Part("boom", (1.7, 0.0), 60.0, (0.4, 0.05), 7.0, -2.6, -0.6),
    "bucket": Part("stick", (1.0, 0.0), 105.0, (0.22, 0.0), 4.0, -1.6, 0.6),
}
JACKS = {
    "boom": Jack((PIVOT[0] + 0.25, PIVOT[1] - 0.25), (0.75, 0.10), 0.60, 0.50, 9.0, 6.0),
    "stick": Jack((0.7, 0.2), (-0.22, 0.08), 0.80, 0.50, 8.0, 5.0),
    "bucket": Jack((0.25, 0.18), (0.05, 0.2), 0.62, 0.45, 6.0, 4.0),
}
FIGURES = {
    "boom": "bore = 0.063, rod = 0.035, dead_volume_a = 3e-4, dead_volume_b = 3e-4, rated_flow = 5.0e-4",
    "stick": "bore = 0.055, rod = 0.030, dead_volume_a = 3e-4, dead_volume_b = 3e-4, rated_flow = 5.0e-4",
    "bucket": "bore = 0.050, rod = 0.030, dead_volume_a = 2e-4, dead_volume_b = 2e-4, rated_flow = 4.0e-4",
}
COMMON = (
    "rated_pressure_drop = 70e5, bulk_modulus = 8e8, leakage = 1e-16, coulomb_friction = 1500.0, "
    "viscous_friction = 5000.0, supply_pressure = 175e5, return_pressure = 5e5"
)
FORCE_LIMIT = 12e3
"""N."""


def write_digger(folder: Path, gains: str = "", *, extra: dict[str, str] | None = None, common: str = COMMON) -> Path:
    """A robot folder; `gains` is text for the end of robot.toml, `extra` lines for the `[[actuation]]` of a link."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "digger.urdf").write_text(_urdf(), encoding="utf-8")
    drives = "\n".join(
        f'[[actuation]]\njoint = "{name}_piston"\nfmu = "hydraulic_cylinder"\n{(extra or {}).get(name, "")}\n'
        f"parameters = {{ {FIGURES[name]}, stroke = {JACKS[name].stroke}, {common} }}\n"
        for name in PARTS
    )
    loops = "\n".join(f'[[loop]]\nframe_a = "{name}_eye"\nframe_b = "{name}_rod_eye"\n' for name in PARTS)
    home = "\n".join(f"{name} = {angle}" for name, angle in {**HOME, **_closed()}.items())
    text = f"""summary = "a digger of 1.5 t: boom, stick, bucket"
urdf = "digger.urdf"
base = "fixed"

[[arm]]
name = "arm"
tool_frame = "tool"

[home]
{home}

[control]
rate_hz = 1000

[limits]
force_n = {FORCE_LIMIT}
torque_rate_nm_s = 1e7

[workspace]
fixture = [1.95, 0.0, 0.0]

[payload]
link = "bucket"
mass = 60.0
rating = 60.0

{loops}
{drives}
{gains}
"""
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return folder


def _turned(angle: float, point: tuple[float, float]) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return point[0] * c - point[1] * s, point[0] * s + point[1] * c


def _closed() -> dict[str, float]:
    """Barrels' angles and rods' positions at home, from the triangle."""
    found = {}
    for name, jack in JACKS.items():
        eye = _turned(HOME[name], jack.eye)
        way = [PARTS[name].at[i] + eye[i] - jack.pivot[i] for i in (0, 1)]
        found[f"{name}_barrel_pivot"] = math.atan2(way[1], way[0])
        found[f"{name}_piston"] = math.hypot(*way) - jack.closed
    return found


def _urdf() -> str:
    parts = "".join(_part(name, part) + _jack(name, JACKS[name]) for name, part in PARTS.items())
    tool = _fixed("tool_mount", "bucket", "tool", (0.4, 0.0), rpy=f"0 {math.pi / 2} 0")
    return f'<?xml version="1.0"?>\n<robot name="digger">\n<link name="base_link"/>\n{parts}{tool}</robot>\n'


def _part(name: str, part: Part) -> str:
    limit = f'<limit lower="{part.low}" upper="{part.high}" effort="0" velocity="3"/>'
    return _joint(name, "revolute", part.parent, part.at, limit) + _link(name, part.mass, part.centre, part.inertia)


def _jack(name: str, jack: Jack) -> str:
    parent, length = PARTS[name].parent, jack.closed
    turning = '<limit lower="-3.2" upper="3.2" effort="0" velocity="0"/>'
    sliding = f'<limit lower="0.0" upper="{jack.stroke}" effort="0" velocity="1"/>'
    return "".join([
        _fixed(f"{name}_eye_mount", name, f"{name}_eye", jack.eye),
        _joint(f"{name}_barrel_pivot", "revolute", parent, jack.pivot, turning, child=f"{name}_barrel"),
        _link(f"{name}_barrel", jack.barrel, (0.5 * length, 0.0), jack.barrel * length**2 / 12.0),
        _joint(f"{name}_piston", "prismatic", f"{name}_barrel", (0.0, 0.0), sliding, child=f"{name}_rod", axis="1 0 0"),
        _link(f"{name}_rod", jack.rod, (0.6 * length, 0.0), jack.rod * length**2 / 12.0),
        _fixed(f"{name}_rod_eye_mount", f"{name}_rod", f"{name}_rod_eye", (length, 0.0)),
    ])  # fmt: skip


def _joint(
    name: str, kind: str, parent: str, at: tuple[float, float], limit: str, child: str = "", axis: str = "0 -1 0"
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child or name}"/>'
        f'<origin xyz="{at[0]} 0 {at[1]}"/><axis xyz="{axis}"/>{limit}</joint>\n'
    )


def _fixed(name: str, parent: str, child: str, at: tuple[float, float], rpy: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at[0]} 0 {at[1]}" rpy="{rpy}"/></joint>\n<link name="{child}"/>\n'
    )


def _link(name: str, mass: float, centre: tuple[float, float], inertia: float) -> str:
    slim = 0.05 * inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre[0]} 0 {centre[1]}"/><mass value="{mass}"/>'
        f'<inertia ixx="{slim}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>\n'
    )
