"""Numbers of the command line that are refused where they make no sense, as wrong usage.

Every numeric option takes its type from here. click's own take NaN, infinity and whole numbers of any length, and none
of these fits into what they are used for.
"""

from __future__ import annotations

import math
from typing import Any

import click

from skillframe.config import LARGEST
from skillframe.config.ranges import Range, require_within
from skillframe.config.units import UNITS, parse, si
from skillframe.errors import InputError
from skillframe.files.documents import LARGEST_WHOLE


class _Finite(click.FloatRange):
    """A range of numbers, without NaN and infinity, which no comparison of click's turns away."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number) or abs(number) > LARGEST:
            self.fail(f"{str(value)[:40]} is not a finite number of usual size.", param, ctx)
        return number


class WithUnit(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.2 on
    """A number with a range, bare or with a word for its unit: 20, 20ms. What comes out is in `word`.

    Args:
        word: in which a bare number is, such as "s" or "deg"; "" for a plain number.
        limits: in SI.
        above: the lower end itself is refused.
    """

    name = "quantity"

    def __init__(self, word: str, limits: Range, above: bool = False) -> None:
        self.unit, self.factor = UNITS[word] if word else ("", 1.0)
        self.limits, self.above = limits, above

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """As typed, in the option's own unit."""
        try:
            number = self._bare(value)
            typed = value if isinstance(value, str) and parse(value) else number
            require_within(typed, number * self.factor, self.unit, self.limits, "")
        except InputError as error:
            self.fail(f"{error.problem}; {error.fix}.", param, ctx)
        if self.above and number * self.factor <= self.limits.least:
            self.fail(f"{number:g} is not above {self.limits.least:g}.", param, ctx)
        return number

    def _bare(self, value: Any) -> float:
        """In the option's own unit."""
        given = si(value, self.unit, "")
        if given is not value:
            return float(given) / self.factor
        try:
            return float(value)
        except ValueError:
            words = ", ".join(word for word, (unit, _) in UNITS.items() if unit == self.unit)
            also = f", bare or with one of {words}" if words else ""
            raise InputError("", f"{str(value)[:40]!r} is no number", f"give one{also}") from None


class _Whole(click.IntRange):
    """A range of whole numbers within 64 bits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        number: int = super().convert(value, param, ctx)
        if abs(number) > LARGEST_WHOLE:
            self.fail(f"{str(value)[:40]} is too large a whole number (beyond 64 bits).", param, ctx)
        return number


NUMBER = _Finite()
"""Any finite number."""
POSITIVE = _Finite(min=0.0, min_open=True)
"""A finite number above zero."""
NOT_NEGATIVE = _Finite(min=0.0)
"""A finite number of zero or more."""
WHOLE = _Whole()
"""A whole number."""
NATURAL = _Whole(min=0)
"""A whole number of zero or more."""
COUNT = _Whole(min=1, max=1_000_000)
"""How many of something: more than a million of anything here is a typing mistake (our choice)."""
SEED = NATURAL
"""A seed of everything random."""
