"""Quantities with a unit, "8mm", "5deg", "20N", as SI numbers. A bare number is SI already.

A unit is a word of `UNITS`, and each word belongs to one SI unit. A quantity asks for one SI unit; a count or a ratio
has the unit "" and takes no word.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import Any, NamedTuple

from skillframe.errors import InputError

_FACTORS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "m2": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "mrad": 1e-3},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3},
    "N m": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "kg": {"kg": 1.0, "g": 1e-3, "t": 1e3},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
}
UNITS = {word: (unit, factor) for unit, words in _FACTORS.items() for word, factor in words.items()}
"""SI unit and factor of every word."""
TYPED = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z/]+2?)\s*")
SAID = re.compile(r"\[([^\]]+)\]")
"""What stands in brackets in a text about a quantity: its unit, and its range (`skillframe.config.ranges`)."""


class Quantity(NamedTuple):
    """A number in SI with its unit."""

    value: float
    unit: str


def parse(text: str) -> Quantity | None:
    """What a text such as "8mm" means, or None if it is no number with a unit that is known."""
    found = TYPED.fullmatch(text)
    if found is None or found[2] not in UNITS:
        return None
    unit, factor = UNITS[found[2]]
    return Quantity(float(found[1]) * factor, unit)


@lru_cache(maxsize=1024)
def unit_of(text: str) -> str:
    """The SI unit that a text about a quantity states, "of the peg [m]", or "" if it states none that is known."""
    for said in SAID.findall(text):
        word = str(said).partition(",")[0]
        unit = {"Nm": "N m"}.get(word, word)
        if unit in _FACTORS:
            return unit
    return ""


def si(value: Any, unit: str, where: str) -> Any:
    """A value as typed in SI: a text with a unit becomes a number, anything else stays as it is.

    Args:
        value: as typed.
        unit: the SI unit that is asked for; "" for a plain number.
        where: for messages.

    Raises:
        InputError: the unit is one of another dimension, or the quantity has none.
    """
    typed = parse(value) if isinstance(value, str) else None
    if typed is None:
        return value
    if typed.unit != unit:
        asked = f"a quantity in {unit}" if unit else "a number without a unit"
        words = ", ".join(_FACTORS[unit]) if unit else ""
        fix = f"give it with one of the units {words}" if unit else "leave the unit out"
        raise InputError(where, f"expected {asked}, got {value.strip()}", fix)
    return typed.value


def doubt(key: str, value: Any, unit: str, default: Any) -> str:
    """A sentence where a bare number was probably meant in millimetres or degrees, else "".

    Our choice: a length of at least 100 times its default, or of 1 m if that is 0; an angle above 1 rad and above
    twice its default. Millimetres read as metres are 1000 times too large, degrees read as radians 57 times.

    Args:
        key: of the quantity.
        value: as typed, before it is read as SI.
        unit: its SI unit.
        default: what it is otherwise; 0.0 if that is no measure of it.
    """
    if not isinstance(value, int | float):
        return ""
    size = abs(value)
    usual = abs(default) if isinstance(default, int | float) else 0.0
    if unit == "m" and (size >= 100.0 * usual if usual else size >= 1.0):
        return f"{key} is {value:g} m as typed; if millimetres are meant, type {key}={value:g}mm"
    if unit == "rad" and size > max(1.0, 2.0 * usual):
        return f"{key} is {value:g} rad as typed; if degrees are meant, type {key}={value:g}deg"
    return ""
