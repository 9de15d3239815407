"""Quantities of a run or campaign as a whole, each with its unit and range. Those of a trial: `world.quantities`."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from skillframe.config.ranges import Range


class OfRuns(NamedTuple):
    """A quantity of a run.

    Attributes:
        name: in campaign.toml and in Python.
        option: of the command line, or "" if there is none.
        unit: SI.
        default: not a number where something else decides.
        about: one line.
        range: beyond it a number is a typing mistake, or one in another unit.
    """

    name: str
    option: str
    unit: str
    default: float
    about: str
    range: Range


DURATION = OfRuns(
    "duration_s", "--duration", "s", 20.0, "longest run in simulated seconds",
    Range(1e-3, 86400.0, "from one tick of a usual controller to a day"),
)  # fmt: skip
TRACE_RATE = OfRuns(
    "rate_hz", "--rate", "Hz", 100.0, "rate of the trace", Range(0.01, 1e5, "as no controller here is faster")
)
CENTER = OfRuns(
    "coc", "--coc", "m", nan, "each coordinate of the centre of compliance in the tool frame; as learned otherwise",
    Range(-3.0, 3.0, "as no tool is longer"),
)  # fmt: skip
OF_RUNS = (DURATION, TRACE_RATE, CENTER)
