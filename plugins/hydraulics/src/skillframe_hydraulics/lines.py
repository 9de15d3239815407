"""Figures of the pumps and lines that robot.toml declares, as arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.robot import RobotSpec
from skillframe_hydraulics.declared import fed, supplies_of


class Lines(NamedTuple):
    """Figures of L supplies.

    Attributes:
        names: of the supplies; feeds: (L, k), 1 where an actuator is fed.
        flow: Q_max (L,) [m3/s]; power: P, infinite if not limited [W]; margin: infinite unless load-sensing [Pa].
        response: tau [s]; softness: V/B [m3/Pa].
        drop: of open centres with all spools in their middle [Pa], 0 of other pumps; shut: x_C of open centres.
        outlet: pressure of the return line, needed of open centres [Pa].
        keeps: drop that pre-compensated valves keep over their edges [Pa], infinite of other valves; shares: 1 of
            post-compensated valves, else 0.
    """

    names: tuple[str, ...]
    feeds: Float
    flow: Float
    power: Float
    margin: Float
    response: Float
    softness: Float
    drop: Float = np.zeros(1)
    shut: Float = np.ones(1)
    outlet: Float = np.zeros(1)
    keeps: Float = np.full(1, np.inf)
    shares: Float = np.zeros(1)

    @property
    def compensates(self) -> NDArray[np.bool_]:
        """Which have compensated valves (L,)."""
        return np.isfinite(self.keeps) | (self.shares > 0.0)

    @property
    def compensated(self) -> bool:
        """Whether any has."""
        return bool(np.any(self.compensates))

    def most(self, pressure: Float) -> Float:
        """Largest flow (N, L) [m3/s] at pressures (N, L)."""
        return np.minimum(self.flow, self.power / np.maximum(pressure, 1e5))


def lines_of(spec: RobotSpec) -> Lines:
    """The supplies that robot.toml declares, checked before by `skillframe_hydraulics.declared`."""
    declared = supplies_of(spec)
    feeds: Float = np.array([[a.joint in fed(spec, one) for a in spec.actuation] for one in declared.values()], float)
    each = list(declared.values())
    bulk, outlet = (
        feeds @ np.array([float(a.known[name]) for a in spec.actuation]) / feeds.sum(axis=1)
        for name in ("bulk_modulus", "return_pressure")
    )
    return Lines(
        tuple(declared), feeds, np.array([one.flow for one in each]),
        np.array([np.inf if one.power is None else one.power for one in each]),
        np.array([one.margin if one.kind == "load_sensing" else np.inf for one in each]),
        np.array([one.response for one in each]), np.array([one.volume for one in each]) / bulk,
        np.array([one.centre_drop if one.kind == "open_centre" else 0.0 for one in each]),
        np.array([one.centre_shut for one in each]), outlet,
        np.array([one.margin if one.compensation == "pre" else np.inf for one in each]),
        np.array([1.0 if one.compensation == "post" else 0.0 for one in each]),
    )  # fmt: skip


def kept_drops(spec: RobotSpec) -> Float:
    """Drops (k,) over compensated valves' edges from a pump that is not full [Pa], infinite of other valves."""
    if not supplies_of(spec):
        return np.full(len(spec.actuation), np.inf)
    lines = lines_of(spec)
    margins = np.where(lines.compensates, lines.margin, np.inf)[:, None]
    kept: Float = np.where(lines.feeds > 0.0, margins, np.inf).min(axis=0)
    return kept
