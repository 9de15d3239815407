"""Plausibility of a machine's figures, against wide catalogue ranges or against other figures.

A wrong unit (l/min, bar, mm) is wrong by a factor of 1000, and a run would not reveal it, because plant and controller
share the figure. A figure that another unit would bring into its range is refused; other unusual ones are doubted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

from skillframe.config.units import UNITS, meant, shown

Figures = dict[str, float]


class Rule(NamedTuple):
    """Usual range of a figure. A figure of 0 means absent.

    Attributes:
        name, unit: of the figure, its SI unit.
        least, most: range of the figure, times `scale` if given.
        scale: computed from the other figures `needs`.
        says: text with {0} for the scaled figure, {1} for the range, and other figures by name; of: its unit.
        refuses: False where an unusual figure may be deliberate; fix: what else than the unit may be wrong.
    """

    name: str
    least: float
    most: float
    unit: str
    scale: Callable[[Figures], float] | None = None
    needs: tuple[str, ...] = ()
    says: str = "where {1} are usual"
    of: str = ""
    refuses: bool = True
    fix: str = ""

    def size(self, value: float, figures: Figures) -> float:
        """The value that the range applies to."""
        return value if self.scale is None else value * self.scale(figures)

    def fits(self, value: float, figures: Figures) -> bool:
        """Whether a value is usual."""
        return self.least <= self.size(value, figures) <= self.most


class Doubt(NamedTuple):
    """An implausible figure: the problem, the probable meaning, and whether it prevents a run."""

    problem: str
    fix: str
    refused: bool


def _area(p: Figures) -> float:
    return math.pi / 4.0 * p["bore"] ** 2


def _push(p: Figures) -> float:
    return _area(p) * p["supply_pressure"]


def _swept(p: Figures) -> float:
    return _area(p) * p["stroke"]


_OF_PUSH = "which is {0} of what the supply can push with, where {1} are usual"
_OF_FLOW = "which is {0} times the rated flow, where {1} are usual"
_OF_SWEPT = "which is {0} times what the piston displaces, where {1} are usual"
_OPENS = "which lets {0} times the rated flow through at a bar, where {1} are usual"
CYLINDER_RULES = (
    Rule("bore", 0.01, 0.5, "m"),
    Rule("rod", 0.002, 0.48, "m"),
    Rule("stroke", 0.01, 20.0, "m"),
    Rule("displacement", 1e-6, 1.0, "m3"),
    Rule("supply_pressure", 5e5, 1e8, "Pa"),
    Rule("return_pressure", 1e4, 5e6, "Pa"),
    Rule("rated_pressure_drop", 1e5, 4e7, "Pa"),
    Rule("bulk_modulus", 1e8, 5e9, "Pa"),
    Rule("rated_flow", 0.02, 3.0, "m3/s", lambda p: 1.0 / _area(p), ("bore",),
         "which moves a piston of {bore:g} m at {0}, where {1} are usual", "m/s"),
    Rule("dead_volume_a", 0.002, 20.0, "m3", lambda p: 1.0 / _swept(p), ("bore", "stroke"), _OF_SWEPT),
    Rule("dead_volume_b", 0.002, 20.0, "m3", lambda p: 1.0 / _swept(p), ("bore", "stroke"), _OF_SWEPT),
    Rule("coulomb_friction", 2e-4, 0.8, "N", lambda p: 1.0 / _push(p), ("bore", "supply_pressure"), _OF_PUSH),
    Rule("static_friction", 2e-4, 0.8, "N", lambda p: 1.0 / _push(p), ("bore", "supply_pressure"), _OF_PUSH),
    Rule("viscous_friction", 1e-4, 1.0, "N s/m", lambda p: p["rated_flow"] / _area(p) / _push(p),
         ("bore", "supply_pressure", "rated_flow"), f"at the speed of its rated flow {_OF_PUSH}"),
    Rule("leakage", 0.0, 0.5, "m3/(s Pa)", lambda p: p["supply_pressure"] / p["rated_flow"],
         ("supply_pressure", "rated_flow"), "which lets {0} times the rated flow past the piston, where {1} are usual"),
    *(Rule(f"edge_{name}", 0.02, 20.0, "", says="where {1} of the rated conductance are usual", refuses=False)
      for name in ("pa", "pb", "at", "bt")),
    Rule("laminar_pressure", 10.0, 2e6, "Pa"),
    Rule("presliding_length", 1e-6, 1e-2, "m"),
    Rule("stribeck_velocity", 1e-5, 1.0, "m/s"),
    Rule("spool_frequency", 0.5, 2000.0, "Hz"),
    Rule("endstop_stiffness", 1e5, 1e10, "N/m"),
    Rule("cushion_length", 1e-3, 0.5, "m", lambda p: 1.0 / p["stroke"], ("stroke",),
         "which is {0} times the stroke, where {1} are usual"),
    Rule("cushion_flow", 1e-4, 10.0, "m3/s", lambda p: 1.0 / p["rated_flow"], ("rated_flow",), _OF_FLOW),
    Rule("relief_pressure", 5e5, 2e8, "Pa"),
    Rule("relief_conductance", 1e-4, 1e4, "m3/(s Pa)", lambda p: 1e5 / p["rated_flow"], ("rated_flow",), _OPENS),
    Rule("check_conductance", 1e-4, 1e4, "m3/(s Pa)", lambda p: 1e5 / p["rated_flow"], ("rated_flow",), _OPENS),
    *(Rule(f"counterbalance_{port}", 2e6, 1e8, "Pa") for port in ("a", "b")),
    Rule("pilot_ratio", 0.5, 20.0, "", says="where {1} are usual", refuses=False),
    Rule("counterbalance_flow", 0.05, 50.0, "m3/s", lambda p: 1.0 / p["rated_flow"], ("rated_flow",), _OF_FLOW),
    Rule("counterbalance_drop", 5e4, 2e7, "Pa"),
    Rule("counterbalance_range", 1e5, 2e7, "Pa"),
    Rule("initial_pressure", 1e3, 1e8, "Pa"),
    Rule("substep", 1e-6, 0.01, "s"),
)  # fmt: skip
"""Rules for a cylinder; each needs only figures checked before it."""
_OF_WEIGHT = "which is {0} times the weight of all that moves, where {1} are usual"
MACHINE_RULES = (
    Rule("sensors.pressure", 100.0, 2e6, "Pa"),
    Rule("sensors.encoder", 1e-8, 0.02, "rad or m"),
    Rule("payload.mass", 0.0, 1.0, "kg", lambda p: 1.0 / p["link"], ("link",),
         "which is {0} times the mass of the link that it is a part of",
         fix="add the load to the mass of that link in the URDF, which is of part and load together"),
    Rule("limits.force_n", 0.05, 1e4, "N", lambda p: 1.0 / p["weight"], ("weight",), _OF_WEIGHT, refuses=False),
    Rule("limits.torque_rate_nm_s", 30.0, 1e9, "N m/s", lambda p: 1.0 / p["weight"], ("weight",),
         "which is {0} times that weight at a metre, a second, where {1} are usual", refuses=False),
)  # fmt: skip
"""Rules for a machine: `link` is the mass of the payload's link [kg], `weight` that of everything movable [N]."""


def doubts(rules: tuple[Rule, ...], given: Mapping[str, object], where: str = "") -> Iterator[Doubt]:
    """Implausible figures. Later rules use the probable meaning of earlier ones.

    `where` follows a figure's name: " of the cylinder on boom_piston".
    """
    numbers = {k: v for k, v in given.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    known = {k: float(v) for k, v in numbers.items() if math.isfinite(v)}
    for rule in rules:
        if not all(known.get(name) for name in (rule.name, *rule.needs)) or rule.fits(known[rule.name], known):
            continue
        value = known[rule.name]
        words = meant(value, rule.unit, partial(rule.fits, figures=known))
        own = rule.unit if rule.scale is None else rule.of
        usual = f"{shown(rule.least, own)} to {shown(rule.most, own)}"
        size = f"{rule.size(value, known):.3g}{f' {own}' if own else ''}"
        problem = f"{rule.name}{where} is {value:g} {rule.unit}, {rule.says.format(size, usual, **known)}"
        likely = " or ".join(f'"{value:g} {word}"' for word in words)
        unit = f"did you mean {likely}?" if words else "correct it if it is not meant"
        fix = f"{rule.fix}; or {unit}" if rule.fix else unit
        yield Doubt(problem, fix, bool(words) and rule.refuses)
        known[rule.name] = value * UNITS[words[0]][1] if words else value
