"""Numbers of the command line that are refused where they make no sense, as wrong usage.

Every numeric option takes its type from here. click's own take NaN, infinity and whole numbers of any length, and none
of these fits into what they are used for.
"""

from __future__ import annotations

import math
from typing import Any

import click

from skillframe.config import LARGEST
from skillframe.files.documents import LARGEST_WHOLE


class _Finite(click.FloatRange):
    """A range of numbers, without NaN and infinity, which no comparison of click's turns away."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number) or abs(number) > LARGEST:
            self.fail(f"{str(value)[:40]} is not a finite number of usual size.", param, ctx)
        return number


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
