"""Cylinder figures in `[[actuation]]`: which ones the controller needs, and their valid values.

The controller (`skillframe_hydraulics.law.vdc_actuator`) needs thirteen figures of every cylinder, whatever its FMU;
a motor has a displacement in place of bore, rod and stroke.
Those of `hydraulic_cylinder` follow the FMU's own checks (fmus/hydraulic_cylinder/checks.h). Return pressure is gauge
and not negative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from skillframe.config import read_toml
from skillframe.errors import InputError, UnknownName
from skillframe.files import data_dirs
from skillframe.robot import Actuation, Limits, RobotModel, published_inertia
from skillframe_hydraulics.checks.plausible import CYLINDER_RULES, MACHINE_RULES, Doubt, doubts
from skillframe_hydraulics.counterbalance import DEFAULTS
from skillframe_hydraulics.declared import noise_of
from skillframe_hydraulics.opening import PARAMETERS, WRITE_OPENING, points_of, wrong

CYLINDER = "hydraulic_cylinder"
SHAPE = ("bore", "rod", "stroke")
NEEDED = (
    *SHAPE, "dead_volume_a", "dead_volume_b", "bulk_modulus", "rated_flow", "rated_pressure_drop",
    "leakage", "coulomb_friction", "viscous_friction", "supply_pressure", "return_pressure",
)  # fmt: skip
"""Figures that the controller needs of a cylinder."""
EDGES = ("edge_pa", "edge_pb", "edge_at", "edge_bt")
SWITCHES = ("rated_drop_is_per_edge", "feed_check")
OPTIONAL = ("laminar_pressure", "deadband", "presliding_length", *SWITCHES, *EDGES, *DEFAULTS, *PARAMETERS)
"""Figures that the controller uses, with defaults."""
_OURS = frozenset((*NEEDED, *OPTIONAL, "displacement"))
POSITIVE = frozenset({
    "bore", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus", "rated_flow", "rated_pressure_drop",
    "supply_pressure", "laminar_pressure", *EDGES, "presliding_length", "spool_frequency", "spool_damping",
    "stribeck_velocity", "cushion_flow", "substep", "tolerance",
    "pilot_ratio", "counterbalance_flow", "counterbalance_drop", "counterbalance_range",
})  # fmt: skip
NOT_NEGATIVE = frozenset({
    "displacement", "rod", "leakage", "coulomb_friction", "viscous_friction", "return_pressure", "deadband",
    "bulk_modulus_slope", "air_fraction", "spool_slew", "hysteresis", "static_friction",
    "endstop_stiffness", "endstop_damping", "cushion_length", "relief_conductance", "check_conductance",
    "counterbalance_a", "counterbalance_b",
})  # fmt: skip
BELOW = {"air_fraction": 0.5, "deadband": 1.0}


class Unfit(NamedTuple):
    """Invalid figures: the problem with actuator and key, and the fix."""

    problem: str
    fix: str


@lru_cache(maxsize=1)
def fmu_defaults() -> dict[str, float]:
    """Parameters of `hydraulic_cylinder` with their defaults, empty where its source is not installed."""
    tables = (folder / CYLINDER / "fmu.toml" for folder in data_dirs("fmus"))
    found: dict[str, Any] = next((read_toml(path)["parameter"] for path in tables if path.is_file()), {})
    return {name: float(entry["start"]) for name, entry in found.items()}


def relief(actuation: Actuation) -> float:
    """Pressure at which an actuator's port relief opens [Pa], infinite where it is unknown."""
    default = fmu_defaults().get("relief_pressure", math.inf) if actuation.fmu == CYLINDER else math.inf
    return float(actuation.known.get("relief_pressure", default))


def is_motor(actuation: Actuation) -> bool:
    """Whether an actuator turns a joint."""
    return "displacement" in actuation.known


def called(actuation: Actuation) -> str:
    """What messages call an actuator."""
    return f"the {'motor' if is_motor(actuation) else 'cylinder'} on {actuation.joint}"


def needed(actuation: Actuation, names: Iterable[str] = NEEDED) -> tuple[str, ...]:
    """Figures that the controller needs of an actuator, among `names`."""
    if not is_motor(actuation):
        return tuple(names)
    return ("displacement", *(name for name in names if name not in SHAPE))


def areas(actuation: Actuation) -> tuple[float, float]:
    """Areas of both chambers, force per pressure [m^2], or [m^3] per radian of a motor."""
    p = actuation.known
    if is_motor(actuation):
        return float(p["displacement"]), float(p["displacement"])
    area = math.pi / 4 * p["bore"] ** 2
    return area, area - math.pi / 4 * p["rod"] ** 2


def unfit_figures(actuation: Actuation) -> list[Unfit]:
    """Missing or impossible figures of a cylinder or motor, empty if it can run."""
    p, of, found = actuation.known, called(actuation), []
    if missing := [name for name in needed(actuation) if name not in p]:
        fix = 'add it to parameters or nominal of its [[actuation]], or write [drive] kind = "servo" if it is a servo'
        found.append(Unfit(f"{of} has no {', '.join(missing)}", fix))
    known = fmu_defaults()
    for table in ("parameters", "nominal") if actuation.fmu == CYLINDER else ("nominal",):
        for name in getattr(actuation, table) if known else ():
            if name not in known:
                found.append(Unfit(f"{table} of {of}: {UnknownName('figure', name, [*known])}", "correct the name"))
    found += [*_impossible(actuation, "parameters"), *_impossible(actuation, "nominal")]
    found = found or [Unfit(each.problem, each.fix) for each in doubtful_figures(actuation) if each.refused]
    if not found:
        if p.get("counterbalance_a") and p.get("counterbalance_b"):
            found.append(Unfit(f"{of} has a counterbalance valve at either port", "give that of the loaded port alone"))
        if (points := points_of(p)) and (text := wrong(points, p.get("deadband"))):
            found.append(Unfit(f"opening of {of} {text}", WRITE_OPENING))
        for small, large in (("rod", "bore"), ("return_pressure", "supply_pressure")):
            if large in p and not p.get(small, 0.0) < p[large]:
                text = f"{of} has {small} {p[small]:g}, not below its {large} {p[large]:g}"
                found.append(Unfit(text, "correct them in its [[actuation]]"))
    return found


def doubtful_figures(actuation: Actuation) -> list[Doubt]:
    """Unusual figures of a cylinder, refused or only doubted."""
    own = actuation.known if actuation.fmu == CYLINDER else {k: v for k, v in actuation.known.items() if k in _OURS}
    return list(doubts(CYLINDER_RULES, own, f" of {called(actuation)}"))


def doubtful_machine(robot: RobotModel) -> list[Doubt]:
    """Unusual sensors, payload and limits of a hydraulic machine."""
    spec, weights = robot.spec, [float(inertia.mass) * 9.81 for inertia in list(robot.model.inertias)[1:]]
    noise = noise_of(spec)
    given: dict[str, float] = {"sensors.pressure": noise.pressure, "sensors.encoder": noise.encoder}
    given["weight"] = sum(weights)
    if spec.payload is not None:
        given |= {"payload.mass": spec.payload.mass, "link": published_inertia(spec).mass}
    limits = {name: getattr(spec.limits, name) for name in ("force_n", "torque_rate_nm_s")}
    given |= {f"limits.{k}": v for k, v in limits.items() if v is not None and v != getattr(Limits(), k)}
    return list(doubts(MACHINE_RULES, given))


def unfit_machine(robot: RobotModel) -> Iterator[Unfit]:
    """Why a hydraulic machine cannot run, cylinder figures aside."""
    if robot.spec.payload is None:
        fix = 'write [payload] with the link that holds the load, its mass ("0 kg" if there is none), and the rating'
        yield Unfit("the machine declares no payload, which the force estimate identifies before a run", fix)
    for actuation in robot.spec.actuation:
        kind, motor = robot.urdf.joints[actuation.joint].type, is_motor(actuation)
        if (kind == "prismatic") == motor:
            moves = "motor turns" if motor else "cylinder slides"
            fix = "draw its barrel and rod as a [[loop]] and name the rod's joint"
            fix = "give bore, rod and stroke in place of displacement" if motor else f"{fix}, or give a displacement"
            yield Unfit(f"{called(actuation)} drives a joint that is {kind}, and a {moves}", fix)
    yield from (Unfit(each.problem, each.fix) for each in doubtful_machine(robot) if each.refused)


def require_figures(robot: RobotModel) -> None:
    """Refuse a machine with missing or impossible figures, or wrong units.

    Raises:
        InputError: names the file, the first such cylinder, and the figure.
    """
    where = robot.spec.folder / "robot.toml"
    for actuation in robot.spec.actuation:
        for unfit in unfit_figures(actuation):
            raise InputError(where, unfit.problem, unfit.fix)
    for unfit in unfit_machine(robot):
        raise InputError(where, unfit.problem, unfit.fix)


def require_known(actuation: Actuation, names: Iterable[str], where: object) -> None:
    """Refuse a cylinder without these figures.

    Raises:
        InputError: names the cylinder and what is missing.
    """
    missing = [name for name in needed(actuation, names) if name not in actuation.known]
    if missing:
        text = f"{called(actuation)} has no {', '.join(missing)}"
        raise InputError(where, text, "add it to parameters or nominal of its [[actuation]]")


def completed(actuation: Actuation) -> dict[str, Any]:
    """Parameters for an actuator's FMU, with static friction as large as Coulomb friction where it is not given.

    The FMU's default of 4000 N fits only the shipped crane; a machine with 1.5 kN of Coulomb friction sticks with it.
    """
    given = actuation.parameters
    if not lacks_static_friction(actuation):
        return dict(given)
    return {**given, "static_friction": float(given["coulomb_friction"])}


def lacks_static_friction(actuation: Actuation) -> bool:
    """Whether static friction of a `hydraulic_cylinder` is derived from Coulomb friction."""
    given = actuation.parameters
    return actuation.fmu == CYLINDER and "static_friction" not in given and "coulomb_friction" in given


def _impossible(actuation: Actuation, table: str) -> Iterator[Unfit]:
    """Impossible figures. `nominal` takes precedence over a foreign FMU's `parameters`."""
    values: Mapping[str, Any] = getattr(actuation, table)
    foreign = table == "parameters" and actuation.fmu != CYLINDER
    for name, value in values.items():
        if foreign and (name in actuation.nominal or name not in (*NEEDED, *OPTIONAL)):
            continue
        if rule := _broken(name, value):
            text = f"{table}.{name} of {called(actuation)} is {value!r:.60}; it must be {rule}"
            yield Unfit(text, "correct it in its [[actuation]]")


def _broken(name: str, value: object) -> str:
    if name in SWITCHES:
        return "" if isinstance(value, int) and value in (0, 1) else "true or false"
    # squares and products of figures up to 1e15 still fit a double
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1e15:
        return "a finite number"
    if name in POSITIVE and not value > 0.0:
        return "greater than zero"
    if name in NOT_NEGATIVE and not value >= 0.0:
        return "zero or more"
    if name in BELOW and not value < BELOW[name]:
        return f"below {BELOW[name]:g}"
    return "at least 1e-06 s" if name == "substep" and value < 1e-6 else ""
