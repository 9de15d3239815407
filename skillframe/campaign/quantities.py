"""What a campaign can vary, by name, and the refusal of everything else with a suggestion.

`start.*` moves the tool's start, `fixture.*` and `grasp.*` the true pose of fixture and tool against what the
controller believes, `robot.*` the plant against the controller's nominal model, `sensor.*` the wrench sensor; `world.*`
are the fields of the world's parameter dataclass. `fault.time` and `fault.cylinder` say when and where a hydraulic
machine breaks, some of its `sensor.*` and `actuator.*` say what.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from functools import cache
from typing import Any

from skillframe.campaign.axes import Axis, Value
from skillframe.config import coerce
from skillframe.config.fields import texts
from skillframe.config.units import si, unit_of
from skillframe.errors import InputError, UnknownName, suggest
from skillframe.world.quantities import QUANTITIES, UNITS

GROUPS = ("start", "fixture", "grasp", "world", "robot", "actuator", "sensor", "fault")


@cache
def world_hints(params: type) -> Mapping[str, Any]:
    """`world.KEY` to annotation, from a world's parameter dataclass. Found once, as each value of a list asks."""
    hints = typing.get_type_hints(params)
    return {f"world.{f.name}": hints[f.name] for f in dataclasses.fields(params) if f.init}


def check_name(name: str, params: type, where: str) -> None:
    """Refuse a quantity that cannot vary.

    Raises:
        InputError: with the nearest name, and the names of its group if the group is right.
    """
    known = {*(name for name in QUANTITIES if not name.startswith("world.")), *world_hints(params)}
    if name in known:
        return
    group = name.partition(".")[0]
    if group not in GROUPS:
        near = suggest(name, known)
        hint = f"; did you mean {near!r}?" if near else ""
        raise InputError(where, f"unknown quantity {name!r}{hint} (there are: {', '.join(f'{g}.*' for g in GROUPS)})")
    raise InputError(where, str(UnknownName("quantity", name, [k for k in known if k.startswith(f"{group}.")])))


def check_value(name: str, value: Value, params: type, where: str) -> Value:
    """A value of a quantity, of the type that its world parameter has. Every other quantity is a number."""
    hint = world_hints(params).get(name, float)
    checked: Value = coerce(in_si(name, value, params, where), hint, where)
    return checked


def in_si(name: str, content: Any, params: type, where: str) -> Any:
    """What was written for a quantity, texts with a unit in it ("8mm") as SI numbers.

    Raises:
        InputError: a unit of another dimension.
    """
    if isinstance(content, Mapping):
        return {key: in_si(name, value, params, f"{where}.{key}") for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [in_si(name, value, params, f"{where}[{i}]") for i, value in enumerate(content)]
    if not isinstance(content, str) or world_hints(params).get(name, float) is str:
        return content
    about = texts(params).get(name.removeprefix("world."), "") if name.startswith("world.") else ""
    return si(content, unit_of(about) or UNITS.get(name, ""), where)


def check_axis(name: str, axis: Axis, params: type, where: str) -> Axis:
    """The axis with its values in the quantity's own type.

    Raises:
        InputError: an unknown quantity, or values that it cannot take.
    """
    check_name(name, params, where)
    values = tuple(check_value(name, v, params, f"{where}.{axis.kind}[{i}]") for i, v in enumerate(axis.numbers))
    return Axis(kind=axis.kind, numbers=values)
