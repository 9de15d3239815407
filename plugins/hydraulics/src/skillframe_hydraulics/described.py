"""`[[cylinder]]`, `[[motor]]` and `[defaults]` of robot.toml, as data sheets say them, in terms of the core's tables.

A cylinder from pin to pin is a `[[strut]]` and an `[[actuation]]` of its rod, one on a joint an `[[actuation]]`. Keys
that are neither geometry nor of `Actuation` are figures, in `parameters` of the cylinder that ships, or in `nominal` of
another FMU. A motor's displacement D [m3] is that of a revolution: at its joint D gear / 2 pi [m3/rad]. A
counterbalance valve is a table of its own, `counterbalance`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from skillframe.config.units import si
from skillframe.errors import InputError, UnknownName
from skillframe.robot import Actuation
from skillframe_hydraulics.opening import parameters_of

SHORT = ("cylinder", "motor", "defaults")
DRAWN = ("closed", "stroke", "mass")
OF_ACTUATION = frozenset(each.name for each in fields(Actuation)) - {"joint"}
TURNING = {"coulomb_friction": "N m", "static_friction": "N m", "viscous_friction": "N m s/rad"}
"""Units of a motor's figures where a cylinder's are of forces. Defaults for cylinders leave them out for motors."""
HOLDING = {"setting": "Pa", "pilot_ratio": "", "flow": "m3/s", "drop": "Pa", "range": "Pa"}
"""Figures of a counterbalance valve with their units."""
PORTS = {"bottom": "a", "rod": "b", "a": "a", "b": "b"}
_WRITE = 'write counterbalance = { port = "bottom", setting = "210 bar", pilot_ratio = 4, flow = "40 l/min at 10 bar" }'


def write_out(values: dict[str, Any], path: Path) -> dict[str, Any]:
    """Content of robot.toml with these tables written out.

    Raises:
        InputError: a table in the wrong form, or one that lacks what nothing can replace.
    """
    if not any(key in values for key in SHORT):
        return values
    from skillframe_hydraulics.checks.figures import SHAPE  # loads Pinocchio, which a list of robots need not

    defaults = values.get("defaults", {})
    if not isinstance(defaults, Mapping) or not all(isinstance(table, Mapping) for table in defaults.values()):
        raise InputError(f"{path}: defaults", "is no table of tables", "write [defaults.cylinder]")
    for kind in defaults:
        if kind not in SHORT[:2]:
            raise InputError(f"{path}: defaults", str(UnknownName("key", kind, SHORT[:2])))
    common = defaults.get("cylinder", {})
    apart = {**TURNING, **dict.fromkeys((*SHAPE, *DRAWN, "counterbalance"))}
    of_motors = {**{k: v for k, v in common.items() if k not in apart}, **defaults.get("motor", {})}
    struts, drives = _listed(values, "strut", path), _listed(values, "actuation", path)
    for own in _listed(values, "cylinder", path):
        for name, strut, drive in _cylinder({**common, **own}, path):
            struts += [{"name": name, **strut}] if strut else []
            drives.append(drive)
    drives += [_motor({**of_motors, **own}, path) for own in _listed(values, "motor", path)]
    rest = {key: value for key, value in values.items() if key not in SHORT}
    return {**rest, "strut": struts, "actuation": drives}


def _listed(values: Mapping[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    """The tables under a key."""
    found = values.get(key, [])
    if not isinstance(found, list) or not all(isinstance(table, Mapping) for table in found):
        raise InputError(f"{path}: {key}", "is no list of tables", f"write [[{key}]]")
    return [dict(table) for table in found]


def _cylinder(table: dict[str, Any], path: Path) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Name, strut and actuation of each of a table's cylinders. One on a joint has no strut."""
    joint, name = table.pop("joint", None), table.pop("name", None)
    where = f"{path}: cylinder {name or joint or ''}".rstrip()
    pinned = [key for key in ("from", "to") if key in table]
    if joint is not None:
        if pinned:
            raise InputError(where, f"is on the joint {joint} and between pins", "give joint, or from and to")
        yield str(joint), {}, _actuation(table, str(joint), where)
        return
    if not isinstance(name, str) or not name:
        raise InputError(where, "has no name", 'write for example name = "boom"')
    if missing := [key for key in ("from", "to", *DRAWN) if key not in table]:
        fix = 'write from = ["link", [x, y, z]] and to, pins in metres, closed, stroke, and mass in kg'
        raise InputError(where, f"has no {', '.join(missing)}", fix)
    for key in ("from", "to"):
        end = table[key]
        if not isinstance(end, list) or len(end) != 2 or not isinstance(end[1], list) or len(end[1]) != 3:
            raise InputError(f"{where}.{key}", f"is {end!r:.60}", f'write {key} = ["link", [x, y, z]]')
    count, beside = table.pop("count", 1), si(table.pop("offset", 0.0), "m", f"{where}.offset")
    if count not in (1, 2) or not isinstance(beside, int | float):
        raise InputError(f"{where}.count", f"is {count!r}", "give 1, or 2 with offset, half the distance between them")
    if (count == 2) != (beside != 0.0):
        raise InputError(f"{where}.offset", "belongs to count = 2, half the distance between both", "give both")
    strut = {"base": table.pop("from"), "eye": table.pop("to"), **{key: table[key] for key in DRAWN}}
    del table["closed"], table["mass"]
    for side, way in (("", 0.0),) if count == 1 else (("_left", beside), ("_right", -beside)):
        yield f"{name}{side}", {**strut, "beside": way}, _actuation(dict(table), f"{name}{side}_rod", where)


def _motor(table: dict[str, Any], path: Path) -> dict[str, Any]:
    joint = table.pop("joint", None)
    where = f"{path}: motor on {joint}"
    if not isinstance(joint, str):
        raise InputError(f"{path}: motor", "has no joint", 'write for example joint = "slew"')
    if "displacement" not in table:
        raise InputError(where, "has no displacement", 'give that of a revolution, such as "180 cm3", and gear')
    of = {key: si(table.pop(key, 1.0), unit, f"{where}.{key}") for key, unit in (("displacement", "m3"), ("gear", ""))}
    for key, value in of.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
            raise InputError(f"{where}.{key}", f"is {value!r:.60}", "give a positive number")
    table["displacement"] = of["displacement"] * of["gear"] / (2.0 * math.pi)
    table |= {key: si(table[key], unit, f"{where}.{key}") for key, unit in TURNING.items() if key in table}
    return _actuation(table, joint, where)


def _actuation(table: dict[str, Any], joint: str, where: str) -> dict[str, Any]:
    """The table of an `[[actuation]]`, from its own keys and figures."""
    from skillframe_hydraulics.checks.figures import CYLINDER

    own = {key: value for key, value in table.items() if key in OF_ACTUATION}
    figures = {key: value for key, value in table.items() if key not in OF_ACTUATION}
    if "dead_volume" in figures:  # of either chamber
        both = figures.pop("dead_volume")
        figures = {"dead_volume_a": both, "dead_volume_b": both, **figures}
    if "opening" in figures:
        figures = {**parameters_of(figures.pop("opening"), figures.get("deadband"), f"{where}.opening"), **figures}
    if "counterbalance" in figures:
        figures = {**_counterbalance(figures.pop("counterbalance"), f"{where}.counterbalance"), **figures}
    fmu = own.setdefault("fmu", CYLINDER)
    kept = "parameters" if fmu == CYLINDER else "nominal"
    return {**own, "joint": joint, kept: {**figures, **own.get(kept, {})}}


def _counterbalance(table: object, where: str) -> dict[str, float]:
    """Figures of a counterbalance valve, from those of its data sheet."""
    if not isinstance(table, Mapping):
        raise InputError(where, f"is {table!r:.60}", _WRITE)
    for key in table:
        if key == "drop" or key not in (*HOLDING, "port"):
            raise InputError(where, str(UnknownName("key", key, ("port", *(k for k in HOLDING if k != "drop")))))
    if missing := [key for key in ("port", "setting", "pilot_ratio", "flow") if key not in table]:
        raise InputError(where, f"has no {', '.join(missing)}", _WRITE)
    if table["port"] not in PORTS:
        raise InputError(f"{where}.port", str(UnknownName("port", str(table["port"]), PORTS)))
    flow, _, drop = str(table["flow"]).partition(" at ")
    if not drop:
        text = f"is {table['flow']!r:.60}, without the pressure drop at which the open valve passes it"
        raise InputError(f"{where}.flow", text, 'write for example "40 l/min at 10 bar"')
    given = {**table, "flow": flow, "drop": drop}
    found = {key: si(given[key], unit, f"{where}.{key}") for key, unit in HOLDING.items() if key in given}
    for key, value in found.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
            raise InputError(f"{where}.{key}", f"is {value!r:.60}", "give a positive number, with its unit as text")
    names = {"setting": f"counterbalance_{PORTS[table['port']]}", "pilot_ratio": "pilot_ratio"}
    return {names.get(key, f"counterbalance_{key}"): value for key, value in found.items()}
