"""Figures of hydraulic cylinders in `[[actuation]]`: which the controller needs, and what each may be.

The controller's law (`skillframe.machine.law.vdc_actuator`) needs thirteen figures of every cylinder, whoever made its
FMU. Those of `hydraulic_cylinder` are judged as that FMU judges them before a run (fmus/hydraulic_cylinder/checks.h),
so that `robots check` says it first. Ours: a return pressure, gauge, is not negative; a suction line is no return line.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from skillframe.config import read_toml
from skillframe.errors import InputError, UnknownName
from skillframe.paths import data_dirs
from skillframe.robot.driven import Actuation
from skillframe.robot.numbers import LARGEST
from skillframe.robot.spec import RobotSpec

CYLINDER = "hydraulic_cylinder"
NEEDED = (
    "bore", "rod", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus", "rated_flow", "rated_pressure_drop",
    "leakage", "coulomb_friction", "viscous_friction", "supply_pressure", "return_pressure",
)  # fmt: skip
"""What the controller takes a cylinder for."""
OPTIONAL = ("laminar_pressure", "deadband", "presliding_length", "rated_drop_is_per_edge")
"""What the controller takes as well, with a default."""
POSITIVE = frozenset({
    "bore", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus", "rated_flow", "rated_pressure_drop",
    "supply_pressure", "laminar_pressure", "presliding_length", "spool_frequency", "spool_damping",
    "stribeck_velocity", "pump_droop", "supply_volume", "cushion_flow", "substep", "tolerance",
})  # fmt: skip
NOT_NEGATIVE = frozenset({
    "rod", "leakage", "coulomb_friction", "viscous_friction", "return_pressure", "deadband", "bulk_modulus_slope",
    "air_fraction", "spool_slew", "hysteresis", "static_friction", "pump_flow", "endstop_stiffness", "endstop_damping",
    "cushion_length", "relief_conductance", "check_conductance",
})  # fmt: skip
BELOW = {"air_fraction": 0.5, "deadband": 1.0}
LEAST_SUBSTEP = 1e-6  # s
BREAKAWAY = 1.0
"""Static over Coulomb friction where `static_friction` is not given: our choice, as of the crane that ships. The FMU's
own default, 4000 N, is that crane's and no other's: a digger of 1.5 kN of Coulomb friction stuck with it."""
FLAG = "rated_drop_is_per_edge"


class Unfit(NamedTuple):
    """A figure, or several, that a cylinder cannot run with: what is wrong, naming actuator and key, and the cure."""

    problem: str
    fix: str


def unfit_figures(actuation: Actuation) -> list[Unfit]:
    """What is missing or impossible among a cylinder's figures, or empty if a run may begin."""
    found = [*_missing(actuation), *_slips(actuation)]
    found += [*_impossible(actuation, "parameters"), *_impossible(actuation, "nominal")]
    return found or list(_contradictions(actuation))


def require_figures(spec: RobotSpec) -> None:
    """Refuse a machine whose cylinders' figures are missing or impossible.

    Raises:
        InputError: names the file, the first such cylinder, and the figure.
    """
    for actuation in spec.actuation:
        for unfit in unfit_figures(actuation):
            raise InputError(spec.folder / "robot.toml", unfit.problem, unfit.fix)


def completed(actuation: Actuation) -> dict[str, Any]:
    """Parameters that an actuator's FMU is given: robot.toml's, and what follows from them where they say nothing."""
    given = actuation.parameters
    if not lacks_static_friction(actuation):
        return dict(given)
    return {**given, "static_friction": BREAKAWAY * float(given["coulomb_friction"])}


def lacks_static_friction(actuation: Actuation) -> bool:
    """Whether the break-away friction of a `hydraulic_cylinder` goes by its Coulomb friction."""
    given = actuation.parameters
    return actuation.fmu == CYLINDER and "static_friction" not in given and "coulomb_friction" in given


def _missing(actuation: Actuation) -> Iterator[Unfit]:
    missing = [name for name in NEEDED if name not in actuation.known]
    if missing:
        text = f"the cylinder on {actuation.joint} has no {', '.join(missing)}"
        fix = 'add it to parameters or nominal of its [[actuation]], or write [drive] kind = "servo" if it is a servo'
        yield Unfit(text, fix)


def _slips(actuation: Actuation) -> Iterator[Unfit]:
    """Names that hydraulic_cylinder does not have. Those of another maker's parameters are its own."""
    known = _of_fmu()
    for table in ("parameters", "nominal") if actuation.fmu == CYLINDER else ("nominal",):
        for name in getattr(actuation, table) if known else ():
            if name not in known:
                text = str(UnknownName("figure", name, known))
                yield Unfit(f"{table} of the cylinder on {actuation.joint}: {text}", "correct the name")


def _of_fmu() -> tuple[str, ...]:
    """Parameters of hydraulic_cylinder, as its table names them, or none where its sources are not at hand."""
    tables = (folder / CYLINDER / "fmu.toml" for folder in data_dirs("fmus"))
    return next((tuple(read_toml(path)["parameter"]) for path in tables if path.is_file()), ())


def _impossible(actuation: Actuation, table: str) -> Iterator[Unfit]:
    """Impossible figures. `parameters` of another maker's FMU are its own wherever `nominal` says ours."""
    values: Mapping[str, Any] = getattr(actuation, table)
    foreign = table == "parameters" and actuation.fmu != CYLINDER
    for name, value in values.items():
        if foreign and (name in actuation.nominal or name not in (*NEEDED, *OPTIONAL)):
            continue
        if rule := _broken(name, value):
            text = f"{table}.{name} of the cylinder on {actuation.joint} is {value!r:.60}; it must be {rule}"
            yield Unfit(text, "correct it in its [[actuation]]")


def _broken(name: str, value: object) -> str:
    """The rule that a value breaks, or ""."""
    if name == FLAG:
        return "" if isinstance(value, int) and value in (0, 1) else "true or false"
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        return "a finite number"
    if name in POSITIVE and not value > 0.0:
        return "greater than zero"
    if name in NOT_NEGATIVE and not value >= 0.0:
        return "zero or more"
    if name in BELOW and not value < BELOW[name]:
        return f"below {BELOW[name]:g}"
    return f"at least {LEAST_SUBSTEP:g} s" if name == "substep" and value < LEAST_SUBSTEP else ""


def _contradictions(actuation: Actuation) -> Iterator[Unfit]:
    """Pairs of figures of which one must be the larger."""
    p = actuation.known
    for small, large in (("rod", "bore"), ("return_pressure", "supply_pressure")):
        if not p[small] < p[large]:
            text = f"the cylinder on {actuation.joint} has {small} {p[small]:g}, not below its {large} {p[large]:g}"
            yield Unfit(text, "correct them in its [[actuation]]")
