"""Quantities with units, "8mm", "30 l/min", "175 bar", in SI, and their ranges. Bare numbers are SI.

A quantity has one SI unit, one of two ("rad or m"), or "" for counts and ratios. Spellings of products, "N m", "N.m",
"Nm", and powers, "m^2", "m2", are equal.

A value out of its range is refused with the probably intended unit. A range is a `Range`, or follows the unit in the
docstring of a settings class: "radius: of the peg [m, 0.5mm to 100mm].", "[0 to 3]".

`OF_RUNS` are the quantities of a run or campaign. For those of a trial see `extend.drives`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from skillframe.errors import InputError

_FACTORS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "m2": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "m3": {"m3": 1.0, "l": 1e-3, "L": 1e-3, "cm3": 1e-6, "ml": 1e-6, "mm3": 1e-9},
    "m3/s": {"m3/s": 1.0, "l/min": 1e-3 / 60.0, "L/min": 1e-3 / 60.0, "l/s": 1e-3, "cm3/s": 1e-6, "m3/h": 1.0 / 3600.0},
    "m3/(s Pa)": {"m3/(s Pa)": 1.0, "l/min/bar": 1e-8 / 60.0},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "mrad": 1e-3, "\N{DEGREE SIGN}": math.pi / 180.0},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3},
    "N m": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "kg": {"kg": 1.0, "g": 1e-3, "t": 1e3},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3, "kN/mm": 1e6},
    "N m/rad": {"Nm/rad": 1.0, "kNm/rad": 1e3, "Nm/deg": 180.0 / math.pi},
    "N s/m": {"Ns/m": 1.0, "kNs/m": 1e3, "Ns/mm": 1e3},
    "N m s/rad": {"Nms/rad": 1.0, "kNms/rad": 1e3},
    "N m/s": {"Nm/s": 1.0, "kNm/s": 1e3},
    "kg m^2": {"kgm2": 1.0, "gcm2": 1e-7, "kgcm2": 1e-4},
    "kg/m3": {"kg/m3": 1.0, "g/cm3": 1e3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "J": {"J": 1.0, "kJ": 1e3},
    "W": {"W": 1.0, "kW": 1e3},
}
UNITS = {word: (unit, factor) for unit, words in _FACTORS.items() for word, factor in words.items()}
"""SI unit and factor of every word."""
TYPED = re.compile(
    r"\s*([+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d+)?+)\s*([A-Za-z\u00b0\u00b5\u03bc][^\s,;=]*(?: [^\s,;=]+)*)\s*"
)
"""A number followed by a possible unit."""
_SPELLING = str.maketrans({
    "\u00b2": "2", "\u00b3": "3", "^": None, "\u00b5": "u", "\u03bc": "u", ".": " ", "*": " ", "\u00b7": " "
})  # fmt: skip
_PRODUCT = re.compile(r"(k?N|k?g)( mm?| s| [cm]?m2)+(/.*)?")
"""Products that may be written with spaces."""
SAID = re.compile(r"\[([^\]]+)\]")
"""Brackets in a text about a quantity: unit and range (`skillframe.config.units`)."""


class Amount(NamedTuple):
    """A number in SI with its unit."""

    value: float
    unit: str


def parse(text: str) -> Amount | None:
    """Number and unit of a text such as "8mm", or None."""
    found = TYPED.fullmatch(text)
    known = None if found is None else unit_word(found[2])
    if found is None or known is None:
        return None
    unit, factor = known
    return Amount(float(found[1]) * factor, unit)


def unit_word(word: str) -> tuple[str, float] | None:
    """SI unit and factor of a unit in any spelling, or None."""
    word = word.translate(_SPELLING)
    return UNITS.get(word.replace(" ", "") if _PRODUCT.fullmatch(word) else word)


@lru_cache(maxsize=1024)
def unit_of(text: str) -> str:
    """SI unit in a text, such as "of the peg [m]" or "[rad or m]", or ""."""
    for said in SAID.findall(text):
        units = [unit_word(word) for word in str(said).partition(",")[0].split(" or ")]
        if all(unit is not None and unit[1] == 1.0 for unit in units):
            return " or ".join(unit[0] for unit in units if unit is not None)
    return ""


def si(value: Any, unit: str, where: str) -> Any:
    """Typed value in SI: text with a unit becomes a number, anything else stays.

    Raises:
        InputError: another dimension than that of `unit`.
    """
    found = TYPED.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        return value
    typed = parse(value)
    if typed is None or typed.unit not in unit.split(" or "):
        asked = f"a quantity in {unit}" if unit else "a number without a unit"
        unknown = f", and {found[2]!r} is no unit that is known" if typed is None else ""
        words = [word for each in unit.split(" or ") for word in _FACTORS.get(each, ())]
        fix = f"give the number alone, in {unit}" if unit else "leave the unit out"
        fix = f"give it with one of the units {', '.join(words)}" if words else fix
        raise InputError(where, f"expected {asked}, got {value.strip()}{unknown}", fix)
    return typed.value


def one_of(unit: str, slides: bool) -> str:
    """Select from "rad or m" by whether the joint is prismatic."""
    return unit.split(" or ")[-1 if slides else 0]


def doubt(key: str, value: Any, unit: str, default: Any) -> str:
    """Question whether a bare number is in millimetres or degrees, else "".

    Doubted are lengths of 100 times the default (or 1 m if that is 0), and angles above 1 rad and twice the default,
    because the wrong unit gives factors of 1000 and 57.
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


_ENDS = re.compile(r"(?:[^,\]]+, )?(\S+) to (\S+)")
_MEANT = {
    "m": ("mm", "cm", "um"), "m2": ("cm2", "mm2"), "m3": ("l", "cm3"), "m3/s": ("l/min",), "m3/(s Pa)": ("l/min/bar",),
    "rad": ("deg",), "s": ("ms", "us"), "kg": ("g", "t"), "Pa": ("bar", "MPa", "kPa", "GPa"),
    "N/m": ("N/mm", "kN/mm"), "N s/m": ("kNs/m",), "m/s": ("mm/s",), "rad/s": ("deg/s", "rpm"), "N m": ("Nmm",),
    "N m/s": ("kNm/s",), "Hz": ("kHz",), "N": ("kN",), "W": ("kW",),
}  # fmt: skip
"""Commonly omitted units, the likeliest first."""
_SHOWN = {"rad": "deg", "N m": "Nm", "Pa": "bar", "rad/s": "deg/s"}


class Range(NamedTuple):
    """Inclusive range in SI, and the reason `why` for messages."""

    least: float
    most: float
    why: str = ""

    def words(self, unit: str) -> str:
        """Text such as "-90deg to 90deg"."""
        return f"{shown(self.least, unit)} to {shown(self.most, unit)}"


def shown(value: float, unit: str) -> str:
    """Text of an SI number in a common unit."""
    word = _SHOWN.get(unit, unit)
    if unit in ("m", "s") and 0.0 < abs(value) < 0.1:
        word = f"{'m' if abs(value) >= 1e-4 else 'u'}{unit}"
    return f"{value / UNITS[word][1]:.6g}{word}" if word in UNITS else f"{value:.6g}{f' {unit}' if unit else ''}"


@lru_cache(maxsize=1024)
def range_of(about: str) -> Range | None:
    """Range in a text about a quantity, in SI, or None."""
    for said in SAID.findall(about):
        if found := _ENDS.fullmatch(said):
            least, most = (float(e) if (q := parse(e)) is None else q.value for e in found.groups())
            return Range(least, most)
    return None


def require_within(typed: Any, value: Any, unit: str, limits: Range | None, where: str) -> None:
    """Refuse numbers out of range, also in lists and tables. `typed` is the value before conversion to SI.

    Raises:
        InputError: with range, reason and probable unit.
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
    return typed[key] if isinstance(typed, Mapping | list | tuple) else typed


def _as_typed(typed: Any, value: float, unit: str) -> str:
    return typed.strip() if isinstance(typed, str) else f"{value:.6g}{f' {unit}' if unit else ''}"


def _fix(typed: Any, value: float, unit: str, limits: Range) -> str:
    found = TYPED.fullmatch(typed) if isinstance(typed, str) else None
    number = found[1] if found else f"{value:.6g}"
    known = None if found is None else unit_word(found[2])
    if known is None or known[1] == 1.0:
        for word in meant(float(number), unit, lambda there: limits.least <= there <= limits.most):
            return f"did you mean {number}{word}?"
    return f"give {limits.words(unit)}"


def meant(number: float, unit: str, fits: Callable[[float], bool]) -> list[str]:
    """Units that fit a number which was typed without one, the likeliest first.

    `fits` returns whether an SI value is plausible.
    """
    words = [word for each in unit.split(" or ") for word in _MEANT.get(each, ())]
    return [word for word in words if number and fits(number * UNITS[word][1])]


class Quantity(NamedTuple):
    """What a run, a trial or a world can vary, as declared beside the code that reads it.

    Attributes:
        name: as typed after --set, in `[vary]` and in Python.
        unit: SI unit, "" for a plain number.
        nominal: default; None where robot, world or skill decide.
        about: one sentence for listings.
        range: of its numbers, in SI.
        kind: type of its values.
        option: of the command line, or "".
        unfit: `unfit(values, model)`: what is wrong with values (N,) in the range, and the fix, or None. `model` is
            the robot, or None.
    """

    name: str
    unit: str
    nominal: Any
    about: str
    range: Range | None = None
    kind: Any = float
    option: str = ""
    unfit: Callable[[Any, Any], tuple[str, str] | None] | None = None


#: longest run
DURATION = Quantity(
    "duration_s", "s", 20.0, "longest run in simulated seconds",
    Range(1e-3, 86400.0, "from one tick of a usual controller to a day"), option="--duration",
)  # fmt: skip
#: samples of a trace
TRACE_RATE = Quantity(
    "rate_hz", "Hz", 100.0, "rate of the trace", Range(0.01, 1e5, "as no controller here is faster"), option="--rate"
)
#: centre of compliance
CENTER = Quantity(
    "coc", "m", None, "each coordinate of the centre of compliance in the tool frame; as learned otherwise",
    Range(-3.0, 3.0, "as no tool is longer"), option="--coc",
)  # fmt: skip
OF_RUNS = (DURATION, TRACE_RATE, CENTER)
