"""Plain values as an FMI type takes them, and what no value of that type can be.

The ranges are those of the standard: FMI 2's Integer has 32 bits, FMI 3's integers have the bits in their names.
"""

from __future__ import annotations

import math
import re
from typing import Any

from skillframe.errors import InputError
from skillframe.fmu.inspection import FmuVariable

LARGEST_FLOAT32 = 3.4028234663852886e38
WORDS = {"true": True, "false": False, "1": True, "0": False}


def values_of(variable: FmuVariable, value: Any, where: object) -> list[Any]:
    """A parameter's or an input's value, or list of values, converted to its type.

    Args:
        variable: whose value it is.
        value: a scalar, or a list as long as the variable.
        where: for messages.

    Raises:
        InputError: another length, or a value that the type cannot hold.
    """
    values = list(value) if isinstance(value, list | tuple) else [value]
    place = f"{where}: {variable.name}"
    if len(values) != variable.size:
        raise InputError(place, f"holds {variable.size}, got {len(values)}", "give as many values as it holds")
    try:
        return [converted(variable.type, v) for v in values]
    except (TypeError, ValueError, OverflowError):
        shown = repr(value) if len(repr(value)) < 60 else repr(value)[:60] + " ..."
        raise InputError(place, f"is of type {variable.type}, got {shown}", _advice(variable.type)) from None


def converted(type_: str, value: Any) -> Any:
    """A plain value as an FMI type takes it.

    Raises:
        TypeError, ValueError, OverflowError: the type cannot hold it.
    """
    if type_ in ("Real", "Float64", "Float32"):
        return _number(value, LARGEST_FLOAT32 if type_ == "Float32" else math.inf)
    if type_ == "Boolean":
        return _truth(value)
    if type_ == "String":
        return _text(value)
    if type_ in ("Binary", "Clock"):
        raise TypeError(type_)
    return _whole(type_, value)


def _number(value: Any, largest: float) -> float:
    if isinstance(value, bool):
        raise TypeError(value)
    number = float(value)
    if largest < abs(number) < math.inf:
        raise ValueError(value)
    return number


def _truth(value: Any) -> bool:
    if isinstance(value, str):
        value = WORDS.get(value.lower(), value)
    if value not in (0, 1):
        raise ValueError(value)
    return bool(value)


def _text(value: Any) -> str:
    if not isinstance(value, str | int | float):
        raise TypeError(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def _whole(type_: str, value: Any) -> int:
    if isinstance(value, bool):
        raise TypeError(value)
    number = int(value)
    least, largest = _range(type_)
    if (not isinstance(value, str) and number != value) or not least <= number <= largest:
        raise ValueError(value)
    return number


def _range(type_: str) -> tuple[int, int]:
    bits = int(found[0]) if (found := re.findall(r"\d+$", type_)) else 32
    return (0, 2**bits - 1) if type_.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _advice(type_: str) -> str:
    if type_ == "Boolean":
        return "give true or false"
    if type_ == "String":
        return "give text"
    if type_ in ("Binary", "Clock"):
        return "leave it at its start value"
    if type_ == "Enumeration":
        return "give the number of one of its items"
    least, largest = _range(type_) if "nt" in type_ else (0, 0)
    return f"give a whole number from {least} to {largest}" if largest else "give a number"
