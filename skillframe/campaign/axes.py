"""How one quantity varies over a campaign: a distribution, a list, or an axis of a design.

    "start.tilt_y"   = { uniform = [-0.21, 0.21] }      independent, low <= x < high
    "start.offset_x" = { normal = [0.0, 0.002] }        independent, mean and standard deviation
    "world.friction" = { choice = [0.1, 0.2, 0.3] }     independent, each equally likely
    "start.tilt_x"   = { grid = [-0.1, 0.0, 0.1] }      the product of all grid axes is covered cell by cell
    "start.tilt_x"   = { grid = { from = -0.1, to = 0.1, count = 5 } }
    "start.offset_y" = { sobol = [-0.01, 0.01] }        all sobol axes together fill their box evenly
    "start.offset_z" = { values = [0.01, 0.02] }        one value per trial, in this order

`draw` of the independent axes turns a generator into one value; grid and sobol axes are placed by `sampling`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.config import coerce
from skillframe.errors import InputError, UnknownName

Value = float | int | bool | str
KINDS = ("uniform", "normal", "choice", "grid", "sobol", "values")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One varied quantity.

    Attributes:
        kind: one of `KINDS`.
        numbers: uniform and sobol: low, high; normal: mean, standard deviation; otherwise the values themselves.
    """

    kind: str
    numbers: tuple[Value, ...]

    def draw(self, rng: np.random.Generator) -> Value:
        """One independent value, for "uniform", "normal" and "choice" axes."""
        if self.kind == "choice":
            return self.numbers[int(rng.integers(len(self.numbers)))]
        a, b = float(self.numbers[0]), float(self.numbers[1])
        if self.kind == "uniform":
            return a + (b - a) * float(rng.random())
        return a + b * float(rng.standard_normal())

    def plain(self) -> dict[str, list[Value]]:
        """The axis as it is written in TOML."""
        return {self.kind: list(self.numbers)}


def cells_of(vary: Mapping[str, Axis]) -> int:
    """Number of cells of the product of all grid axes, or 1 without any."""
    return math.prod(len(axis.numbers) for axis in vary.values() if axis.kind == "grid")


def parse_axis(value: Any, where: str) -> Axis:
    """An axis from its TOML value.

    Raises:
        InputError: not `{ kind = ... }` with a known kind and sensible numbers.
    """
    if not isinstance(value, Mapping) or len(value) != 1:
        raise InputError(
            where, f"expected one distribution, got {value!r}", "write for example { uniform = [-0.1, 0.1] }"
        )
    ((kind, content),) = value.items()
    if kind not in KINDS:
        raise InputError(where, str(UnknownName("distribution", str(kind), KINDS)))
    where = f"{where}.{kind}"
    if kind in ("uniform", "sobol", "normal"):
        return Axis(kind=kind, numbers=_pair(kind, content, where))
    if kind == "grid" and isinstance(content, Mapping):
        content = _linspace(content, where)
    return Axis(kind=kind, numbers=_listed(kind, content, where))


def _number(value: Any, where: str) -> float:
    number: float = coerce(value, float, where)
    if not math.isfinite(number):
        raise InputError(where, f"is {number}", "give a finite number")
    return number


def _pair(kind: str, content: Any, where: str) -> tuple[float, float]:
    names = "mean, standard deviation" if kind == "normal" else "low, high"
    if not isinstance(content, list | tuple) or len(content) != 2:
        raise InputError(where, f"expected [{names}], got {content!r}")
    a, b = (_number(v, f"{where}[{i}]") for i, v in enumerate(content))
    if kind == "normal" and b < 0.0:
        raise InputError(where, f"standard deviation {b} is negative", "give zero or more")
    if kind != "normal" and not a < b:
        raise InputError(where, f"low {a} is not below high {b}", "write the smaller number first")
    return a, b


def _linspace(content: Mapping[str, Any], where: str) -> list[float]:
    for key in content:
        if key not in ("from", "to", "count"):
            raise InputError(where, str(UnknownName("key", str(key), ("from", "to", "count"))))
    if len(content) != 3:
        raise InputError(where, f"expected from, to and count, got {dict(content)!r}")
    count: int = coerce(content["count"], int, f"{where}.count")
    if count < 2:
        raise InputError(f"{where}.count", f"is {count}", "give at least 2")
    first, last = (_number(content[key], f"{where}.{key}") for key in ("from", "to"))
    return [float(v) for v in np.linspace(first, last, count)]


def _listed(kind: str, content: Any, where: str) -> tuple[Value, ...]:
    if not isinstance(content, list | tuple):
        raise InputError(where, f"expected a list of values, got {content!r}")
    if not content:
        raise InputError(where, "is empty", "give at least one value")
    values = tuple(_listed_value(v, f"{where}[{i}]") for i, v in enumerate(content))
    if kind == "grid" and len(set(values)) != len(values):
        raise InputError(where, f"holds a value twice: {content!r}", "give every value of a grid once")
    return values


def _listed_value(value: Any, where: str) -> Value:
    if isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        return value
    return _number(value, where)
