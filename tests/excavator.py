"""A 36 t excavator in space: slew, twin boom cylinders, bucket linkage, on a base turned by any angles.

Geometry is ours. Bores, strokes, masses and pressure are of the size of simscape's Excavator-Simscape (MathWorks,
github.com/simscape/Excavator-Simscape). Points are in the plane of the boom (x forward, z up), angles about y, which
turn x down.
"""

from __future__ import annotations

import math
from pathlib import Path

HOME = {"slew": 0.3, "boom": -0.45, "stick": 1.35, "bucket": 0.9}
LINKS = {
    # parent, joint's axis and origin, mass [kg], centre [m], inertia about it [kg m2]
    "house": ("base", "0 0 1", (0.0, 0.0, 0.0), 12000.0, (-1.2, 0.0, 1.6), (9e3, 1.4e4, 1.8e4)),
    "boom": ("house", "0 1 0", (0.2, 0.0, 1.9), 3600.0, (3.0, 0.0, 0.45), (400.0, 1.15e4, 1.15e4)),
    "stick": ("boom", "0 1 0", (6.4, 0.0, 0.0), 1650.0, (1.1, 0.0, 0.15), (90.0, 1.7e3, 1.7e3)),
    "bucket": ("stick", "0 1 0", (3.2, 0.0, 0.0), 2500.0, (0.65, 0.0, 0.25), (350.0, 420.0, 400.0)),
    "rocker": ("stick", "0 1 0", (2.75, 0.0, 0.05), 90.0, (0.3, 0.0, 0.0), (1.0, 5.0, 5.0)),
    "link": ("rocker", "0 1 0", (0.65, 0.0, 0.0), 110.0, (0.3, 0.0, 0.0), (1.0, 5.0, 5.0)),
}
JOINT = {"house": "slew"}
PINS = {
    "ear": ("bucket", (0.12, 0.0, 0.48)), "link_end": ("link", (0.62, 0.0, 0.0)), "teeth": ("bucket", (1.5, 0.0, 0.0)),
}  # fmt: skip
CYLINDERS = {
    # barrel's link and pin, eye's link and pin, closed length, stroke [m], mass [kg], bore, rod [m]
    "boom_left": ("house", (0.75, 0.45, 1.35), "boom", (2.9, 0.45, 0.55), 2.0, 1.6, 260.0, 0.160, 0.110),
    "boom_right": ("house", (0.75, -0.45, 1.35), "boom", (2.9, -0.45, 0.55), 2.0, 1.6, 260.0, 0.160, 0.110),
    "stick_cylinder": ("boom", (2.9, 0.0, 1.25), "stick", (-0.75, 0.0, 0.45), 3.0, 1.6, 300.0, 0.170, 0.120),
    "bucket_cylinder": ("stick", (0.35, 0.0, 0.75), "rocker", (0.65, 0.0, 0.0), 2.05, 1.25, 220.0, 0.150, 0.105),
}  # fmt: skip
NEAR = {"rocker": -0.9, "link": 1.4, "stick_cylinder_barrel": 0.1}
"""Where the linkage's branch begins [rad]."""
FIGURES = (
    "dead_volume_a = 4e-3, dead_volume_b = 4e-3, bulk_modulus = 1.2e9, rated_flow = 2e-3, leakage = 1e-16, "
    "rated_pressure_drop = 20e5, coulomb_friction = 4000.0, static_friction = 4000.0, viscous_friction = 20000.0, "
    "supply_pressure = 350e5, return_pressure = 5e5, relief_pressure = 400e5"
)

DISPLACEMENT = 180e-6 * 270.0 / (2.0 * math.pi)
"""Of the slew motor and its gears [m3/rad]."""
MOTOR = FIGURES.replace("4000.0", "8000.0").replace("rated_flow = 2e-3", "rated_flow = 5e-3")


def write_excavator(
    folder: Path, mounted: str = "0 0 0", *, slew: str = "continuous", home: dict[str, float] = HOME,
    fixture: tuple[float, float, float] = (8.0, 0.0, 0.0),
) -> Path:  # fmt: skip
    """A robot folder. `mounted` turns base by roll, pitch, yaw [rad]; `slew` is the URDF type of its joint."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "excavator.urdf").write_text(_urdf(mounted, slew), encoding="utf-8")
    home = {**{name: value for name, value in home.items() if name != "slew" or slew != "fixed"}, **NEAR}
    loops = [(f"{name}_eye", f"{name}_rod_eye") for name in CYLINDERS] + [("ear", "link_end")]
    drives = [
        f'[[actuation]]\njoint = "{name}_piston"\nfmu = "hydraulic_cylinder"\n'
        f"parameters = {{ bore = {row[7]}, rod = {row[8]}, stroke = {row[5]}, {FIGURES} }}\n"
        for name, row in CYLINDERS.items()
    ]
    motor = '[[actuation]]\njoint = "slew"\nfmu = "hydraulic_cylinder"\n'
    motor += f"parameters = {{ displacement = {DISPLACEMENT}, {MOTOR} }}\n"
    text = f"""summary = "an excavator of 36 t: slew, twin boom cylinders, bucket linkage"
urdf = "excavator.urdf"
base = "fixed"
[[arm]]
name = "arm"
tool_frame = "teeth"
[home]
{chr(10).join(f"{name} = {value}" for name, value in home.items())}
[control]
rate_hz = 1000
[limits]
force_n = 60000.0
torque_rate_nm_s = 1e7
[workspace]
fixture = {list(fixture)}
[payload]
link = "bucket"
mass = 1500.0
rating = 1500.0
{chr(10).join(f'[[loop]]{chr(10)}frame_a = "{a}"{chr(10)}frame_b = "{b}"' for a, b in loops)}
{motor if slew != "fixed" else ""}{"".join(drives)}"""
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return folder


def _urdf(mounted: str, slew: str) -> str:
    parts = ['<link name="world"/>', _fixed("mount", "world", "base", (0.0, 0.0, 0.0), mounted)]
    for name, (parent, axis, at, mass, centre, inertia) in LINKS.items():
        kind = slew if name == "house" else "revolute"
        parts += [_link(name, mass, centre, inertia), _joint(JOINT.get(name, name), kind, parent, name, at, axis)]
    parts += [_fixed(f"{name}_mount", link, name, at) for name, (link, at) in PINS.items()]
    for name, (barrel, pivot, moved, eye, closed, stroke, mass, *_) in CYLINDERS.items():
        slim = mass * closed**2 / 24.0
        parts += [
            _link(f"{name}_barrel", 0.6 * mass, (0.4 * closed, 0.0, 0.0), (0.01 * slim, slim, slim)),
            _joint(f"{name}_barrel", "revolute", barrel, f"{name}_barrel", pivot, "0 1 0"),
            _link(f"{name}_rod", 0.4 * mass, (-0.4 * closed, 0.0, 0.0), (0.01 * slim, slim, slim)),
            _joint(f"{name}_piston", "prismatic", f"{name}_barrel", f"{name}_rod", (closed, 0.0, 0.0), "1 0 0", stroke),
            _fixed(f"{name}_rod_eye_mount", f"{name}_rod", f"{name}_rod_eye", (0.0, 0.0, 0.0)),
            _fixed(f"{name}_eye_mount", moved, f"{name}_eye", eye),
        ]
    return '<?xml version="1.0"?>\n<robot name="excavator">\n' + "".join(parts) + "</robot>\n"


def _triple(values: tuple[float, float, float]) -> str:
    return " ".join(map(repr, values))


def _joint(
    name: str, kind: str, parent: str, child: str, at: tuple[float, float, float], axis: str, stroke: float = 0.0
) -> str:  # fmt: skip
    low, high = (0.0, stroke) if stroke else (-math.pi, math.pi)
    limit = "" if kind == "continuous" else f'<limit lower="{low}" upper="{high}" effort="0" velocity="3"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_triple(at)}"/><axis xyz="{axis}"/>{limit}</joint>\n'
    )


def _fixed(name: str, parent: str, child: str, at: tuple[float, float, float], turned: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_triple(at)}" rpy="{turned}"/></joint>\n<link name="{child}"/>\n'
    )


def _link(name: str, mass: float, centre: tuple[float, ...], inertia: tuple[float, ...]) -> str:
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{_triple(centre)}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>\n'
    )
