"""Numbers of the command line that are refused where they make no sense, as wrong usage."""

from __future__ import annotations

import math
from typing import Any

import click


class _Finite(click.FloatRange):
    """A range of numbers, without NaN and infinity, which no comparison of click's turns away."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


POSITIVE = _Finite(min=0.0, min_open=True)
NOT_NEGATIVE = _Finite(min=0.0)
SEED = click.IntRange(min=0)
