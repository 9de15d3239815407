"""Clocks as words and in two columns: dates with a time, times of day, and seconds beside nanoseconds.

A date counts as seconds since 1970 in UTC, or in the zone that it names; a double resolves 0.24 us there. A time of day
counts from midnight, and a day is added where it runs back by more than half of one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from skillframe.frames import Float

DAY = 86400.0
DATE = re.compile(r"(\d{4})[-/.](\d\d)[-/.](\d\d)[T ](\d\d:\d\d:\d\d)([.,]\d+)?(Z|[-+]\d\d:?\d\d)?")
DAY_FIRST = re.compile(r"(\d\d)\.(\d\d)\.(\d{4})[T ](\d\d:\d\d:\d\d)([.,]\d+)?")
TIME = re.compile(r"(\d\d?):(\d\d):(\d\d)([.,]\d+)?")


def seconds(cells: Sequence[str]) -> Float | None:
    """Seconds (T,) of dates or times of day, one a cell. None where one of them is neither, or no day of a calendar."""
    try:
        found = [_second(cell) for cell in cells]
    except ValueError:
        return None
    time = np.array([second for second, _ in found])
    if any(dated for _, dated in found):
        return time if all(dated for _, dated in found) else None
    return time + DAY * np.concatenate([[0.0], np.cumsum(np.diff(time) < -DAY / 2.0)])


def _second(cell: str) -> tuple[float, bool]:
    """Seconds of one cell, and whether it has a date. Raises `ValueError` if it is neither."""
    if match := DATE.fullmatch(cell):
        year, month, day, clock, part, zone = match.groups()
    elif match := DAY_FIRST.fullmatch(cell):
        (day, month, year, clock, part), zone = match.groups(), None
    elif match := TIME.fullmatch(cell):
        hour, minute, second, part = match.groups()
        return 3600.0 * int(hour) + 60.0 * int(minute) + int(second) + _part(part), False
    else:
        raise ValueError(cell)
    moment = datetime.fromisoformat(f"{year}-{month}-{day}T{clock}{zone or ''}")
    return (moment if zone else moment.replace(tzinfo=UTC)).timestamp() + _part(part), True


def _part(text: str | None) -> float:
    """A second's part, ".25" or ",25"."""
    return float(text.replace(",", ".")) if text else 0.0
