"""The drive of a robot, what it adds to the robot's data, and the quantities of a trial.

Quantities are those of `skillframe.world.quantities`, of the drives, and the parameters of the world. Each is declared
once, as a `skillframe.config.units.Quantity`; names, checks, listings and messages follow from that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, get_type_hints

import numpy as np

from skillframe.config import coerce, in_si, settings_of
from skillframe.config.units import Quantity, Range, require_within
from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.extend.hardware import DriveType
from skillframe.extend.homes import homes, install_line
from skillframe.extend.registry import Registry, registry
from skillframe.frames import Float
from skillframe.robot.spec import RobotSpec
from skillframe.world.quantities import QUANTITIES

if TYPE_CHECKING:
    from pathlib import Path

    from skillframe.fmu.actuator import ActuatorSpec
    from skillframe.robot.audit import Audit
    from skillframe.robot.link_checks import Problem
    from skillframe.robot.model import RobotModel


def drive_of(spec: RobotSpec) -> DriveType | None:
    """The plug-in's drive of a robot, or None if the core drives it.

    Raises:
        InputError: no installed plug-in has the drive that robot.toml names, or one for its actuators.
    """
    if not spec.own_law:
        return None
    where = f"{spec.folder / 'robot.toml'}: drive.kind"
    if spec.drive is not None:
        try:
            named: DriveType = registry().drive(spec.drive.kind)
            return named
        except UnknownName as error:
            raise InputError(where, str(error)) from None
    found = [record for record in registry().records("drive") if record.actuated]
    if not found:
        lines = [install_line(home) for each, home in homes().items() if each.startswith("drive:")]
        fix = f"name a drive, or type: {' or '.join(lines)}"
        raise InputError(where, "is not given, and no installed drive takes [[actuation]] without it", fix)
    if len(found) > 1:
        names = " and ".join(record.name for record in found)
        raise InputError(where, f"is not given, and {names} take [[actuation]] without it", "name one of them")
    first: DriveType = found[0]
    return first


def written_out(values: dict[str, Any], path: Path) -> dict[str, Any]:
    """Content of the robot.toml at `path` with short tables of drives as those of the core, and its parameter set.

    Raises:
        InputError: a table in the wrong form, or as `skillframe.fmu.ssv.with_parameter_set`.
    """
    for record in registry().records("drive"):
        if record.write_out is not None:
            values = record.write_out(values, path)
    if "parameter_set" not in values:
        return values
    from skillframe.fmu.ssv import with_parameter_set

    return with_parameter_set(values, path)


def require_driven(model: RobotModel) -> None:
    """Refuse a robot that its drive cannot run. Raises `InputError`."""
    own = drive_of(model.spec)
    if own is not None and own.check is not None:
        own.check(model)


def audit(robot: RobotSpec | RobotModel, total_kg: float | None = None) -> Audit:
    """The audit of a robot, with the problems of its drive. A robot that its drive cannot run is not usable.

    Args:
        robot: as declared, or loaded.
        total_kg: mass of the whole robot with its base, to which guessed masses are scaled.

    Raises:
        InputError, UnknownName: it does not load, or its links are heavier than `total_kg`.
    """
    from skillframe.robot.audit import audit as audit_robot
    from skillframe.robot.model import load_model

    model = load_model(robot) if isinstance(robot, RobotSpec) else robot
    found, own = audit_robot(model, total_kg), drive_of(model.spec)
    more = tuple(own_warnings(model.spec) if own is None else own.audit(model) if own.audit else ())
    runs = all(problem.severity != "fatal" for problem in more)
    return replace(found, usable=found.usable and runs, problems=(*found.problems, *more))


def own_warnings(spec: RobotSpec) -> Iterator[Problem]:
    """Warnings about slow interfaces, servos and unmapped variables."""
    from skillframe.cosim.servos import actuator_specs, unfit_servo
    from skillframe.robot.link_checks import cannot_run, warning

    if spec.control.interface != "torque":
        fix = "shorten delay_s, mount the tool softly (a lower contact_stiffness), or give a larger push_n"
        for text in spec.control.admittance.doubts():
            yield warning("slow_interface", text, f"{fix}, under [control]")
    if spec.servo:
        yield from unmapped_warnings(actuator_specs(spec), [a.unused for a in spec.actuation], spec.folder)
        yield from (cannot_run(*slip) for one in spec.actuation for slip in unfit_servo(one))


def unmapped_warnings(
    rows: Sequence[ActuatorSpec], unused: Sequence[Sequence[str]], folder: Path
) -> Iterator[Problem]:  # fmt: skip
    """Warnings about unmapped variables, or an FMU that cannot be read."""
    from skillframe.fmu.opening import unmapped
    from skillframe.robot.link_checks import cannot_run, warning

    try:
        found = unmapped(rows, unused, folder)
    except SkillframeError as error:
        text, fix = (error.problem, error.fix) if isinstance(error, InputError) else (str(error), "correct it")
        yield cannot_run(f"its FMU cannot be read: {text}", fix)
        return
    for row in found:
        for text in row.sentences:
            yield warning("not_mapped", text, "map it in the [[actuation]], or name it in unused")


def with_derived(model: RobotModel) -> tuple[RobotModel, list[str]]:
    """A robot with values that its drive derives where robot.toml gives none, and their names."""
    own = drive_of(model.spec)
    return (model, []) if own is None or own.derived is None else own.derived(model)


def told(spec: RobotSpec) -> tuple[list[str], dict[str, Any]]:
    """The drive's tables of robot.toml, as lines of text and as plain values."""
    own = drive_of(spec)
    return ([], {}) if own is None or own.told is None else own.told(spec)


_COMMON = frozenset(each.name for each in QUANTITIES)


def quantities(params: type | None = None) -> Mapping[str, Quantity]:
    """All quantities of a trial by name, in the order of listings.

    Args:
        params: parameter dataclass of a world, whose parameters `world.*` are added.
    """
    return _found(registry()) if params is None else {**_found(registry()), **of_world(params)}


@lru_cache(maxsize=1)
def _found(known: Registry) -> Mapping[str, Quantity]:
    return {each.name: each for each in (*QUANTITIES, *(one for own in _declared(known).values() for one in own))}


@lru_cache(maxsize=1)
def _declared(known: Registry) -> Mapping[str, Sequence[Quantity]]:
    """Quantities by drive. One that fails has none, and the error is its plug-in's."""
    found = {}
    for record in known.records("drive"):
        try:
            found[record.name] = () if record.quantities is None else tuple(record.quantities())
        except Exception as error:
            found[record.name] = ()
            known.provider("drive", record.name).fail(error)
    return found


@lru_cache(maxsize=256)
def of_world(params: type) -> Mapping[str, Quantity]:
    """The parameters of a world by name, from the fields and the docstring of its dataclass."""
    hints = get_type_hints(params)
    return {
        (name := f"world.{row['name']}"): Quantity(
            name, row["unit"], row["default"], row["about"], row["range"] and Range(*row["range"]), hints[row["name"]]
        )
        for row in settings_of(params)
    }


def unknown(name: str, known: Iterable[str], where: str = "") -> UnknownName:
    """The error for an unknown quantity, with the names of its group."""
    names = list(known)
    group = [each for each in names if each.startswith(f"{name.partition('.')[0]}.")]
    return UnknownName("quantity", name, group or names, registry().failures(), where=where)


def typed_value(quantity: Quantity, value: Any, where: str) -> Any:
    """A typed value in SI, in the type of its quantity.

    Raises:
        InputError: a wrong type, or a unit of another dimension.
    """
    return coerce(in_si(value, quantity.kind, quantity.unit, where), quantity.kind, where)


def check_quantities(draws: Mapping[str, Float], robot: RobotModel | None = None) -> None:
    """Refuse unknown quantities, those that have no effect, and values that are not allowed.

    Args:
        draws: values (N,) by quantity.
        robot: of the run; its missing actuators and sensors exclude quantities.

    Raises:
        UnknownName: with the nearest name.
        InputError: a value out of range, or a quantity that the robot lacks.
    """
    known = quantities()
    for key, values in draws.items():
        if key not in known:
            raise unknown(key, known)
        if robot is not None and (lacking := lacks(key, robot.spec)):
            raise InputError(key, f"{robot.spec.name} {lacking}", "leave it out")
        found = known[key]
        for value in (float(np.min(values)), float(np.max(values))):
            require_within(value, value, found.unit, found.range, key)
        if found.unfit is not None and (problem := found.unfit(np.asarray(values, dtype=float), robot)):
            raise InputError(key, *problem)


def lacks(key: str, spec: RobotSpec) -> str:
    """Why a quantity has no effect on this robot, or ""."""
    own = drive_of(spec) or (registry().drive("servo") if spec.servo else None)
    if own is not None and own.lacks is not None and (why := str(own.lacks(key, spec))):
        return why
    if key == "robot.payload" and spec.payload is None:
        return "declares no payload"
    declared = () if own is None else _declared(registry())[own.name]
    return "" if key in _COMMON or key in (each.name for each in declared) else "has no drive with such a quantity"
