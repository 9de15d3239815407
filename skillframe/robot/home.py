"""Joint positions of `[home]` typed with a unit: "90deg" for a joint that turns, "0.3m" for one that slides."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skillframe.config.units import parse, si
from skillframe.robot.urdf import read_urdf


def home_in_si(values: Mapping[str, Any], path: Path) -> Mapping[str, Any]:
    """The keys of robot.toml, with texts of `[home]` as SI numbers. The URDF is read where there is one.

    Args:
        values: as read.
        path: of robot.toml.

    Raises:
        InputError: a unit that is not the joint's, or the URDF cannot be read.
    """
    home = values.get("home")
    typed = [k for k, v in home.items() if isinstance(v, str) and parse(v)] if isinstance(home, Mapping) else []
    urdf = path.resolve().parent / str(values.get("urdf"))
    if not isinstance(home, Mapping) or not typed or not urdf.is_file():
        return values
    joints = read_urdf(urdf).joints
    units = {name: "m" if name in joints and joints[name].type == "prismatic" else "rad" for name in typed}
    given = {name: si(home[name], unit, f"{path}: home.{name}") for name, unit in units.items()}
    return {**values, "home": {**home, **given}}
