"""The range that a quantity has, and the refusal of a number beyond it with the unit that was probably meant.

A range stands once, beside the quantity's declaration: as a `Range`, or behind the unit in the docstring of a dataclass
of settings, "radius: of the peg [m, 0.5mm to 100mm].", "[0 to 3]" for a number without a unit. What is refused is a
typing mistake. Whether a value makes sense on this robot and in this world is asked later, by those who know.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from skillframe.config.units import SAID, TYPED, UNITS, parse
from skillframe.errors import InputError

_ENDS = re.compile(r"(?:[^,\]]+, )?(\S+) to (\S+)")
_MEANT = {
    "m": ("mm", "um"), "rad": ("deg",), "s": ("ms", "us"), "kg": ("g", "t"), "Pa": ("bar", "MPa", "kPa"),
    "N/m": ("N/mm",), "m/s": ("mm/s",), "rad/s": ("deg/s",), "N m": ("Nmm",), "Hz": ("kHz",), "N": ("kN",),
}  # fmt: skip
"""Words that people leave out, the likeliest first."""
_SHOWN = {"rad": "deg", "N m": "Nm", "Pa": "bar", "rad/s": "deg/s"}


class Range(NamedTuple):
    """From `least` to `most`, both allowed, in SI. `why` it ends there, in words that follow a comma."""

    least: float
    most: float
    why: str = ""

    def words(self, unit: str) -> str:
        """As it could be typed: "-90deg to 90deg"."""
        return f"{shown(self.least, unit)} to {shown(self.most, unit)}"


def shown(value: float, unit: str) -> str:
    """A number in SI as it could be typed, in the unit that people use for its size."""
    word = _SHOWN.get(unit, unit)
    if unit in ("m", "s") and 0.0 < abs(value) < 0.1:
        word = f"{'m' if abs(value) >= 1e-4 else 'u'}{unit}"
    return f"{value / UNITS[word][1]:.6g}{word}" if word in UNITS else f"{value:.6g}{f' {unit}' if unit else ''}"


@lru_cache(maxsize=1024)
def range_of(about: str) -> Range | None:
    """The range that a text about a quantity states, in SI, or None if it states none."""
    for said in SAID.findall(about):
        if found := _ENDS.fullmatch(said):
            least, most = (_end(end) for end in found.groups())
            return Range(least, most)
    return None


def _end(text: str) -> float:
    quantity = parse(text)
    return float(text) if quantity is None else quantity.value


def require_within(typed: Any, value: Any, unit: str, limits: Range | None, where: str) -> None:
    """Refuse a number beyond its range. Lists and tables are looked through. What is no number is left to others.

    Args:
        typed: as it was typed: a bare number, or a text with a unit.
        value: the same in SI.
        unit: its SI unit.
        limits: None allows everything.
        where: for the message.

    Raises:
        InputError: says the range, why it ends there, and the unit that was probably meant.
    """
    if limits is None or isinstance(value, bool | str) or value is None:
        return
    if isinstance(value, Mapping):
        for key in value:
            require_within(_part(typed, key), value[key], unit, limits, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for i, each in enumerate(value):
            require_within(_part(typed, i), each, unit, limits, f"{where}[{i}]")
    elif isinstance(value, int | float) and not limits.least <= value <= limits.most:
        reason = f", {limits.why}" if limits.why else ""
        problem = f"{_as_typed(typed, value, unit)} is beyond {limits.words(unit)}{reason}"
        raise InputError(where, problem, _fix(typed, value, unit, limits))


def _part(typed: Any, key: Any) -> Any:
    """An element as it was typed."""
    return typed[key] if isinstance(typed, Mapping | list | tuple) else typed


def _as_typed(typed: Any, value: float, unit: str) -> str:
    return typed.strip() if isinstance(typed, str) else f"{value:.6g}{f' {unit}' if unit else ''}"


def _fix(typed: Any, value: float, unit: str, limits: Range) -> str:
    """The same number with another word behind it, where that lies within the range and SI was typed."""
    found = TYPED.fullmatch(typed) if isinstance(typed, str) else None
    number = found[1] if found else f"{value:.6g}"
    for word in _MEANT.get(unit, ()) if found is None or UNITS[found[2]][1] == 1.0 else ():
        if value and limits.least <= float(number) * UNITS[word][1] <= limits.most:
            return f"did you mean {number}{word}?"
    return f"give {limits.words(unit)}"
