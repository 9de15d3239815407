"""Tables of robot.toml for hydraulic machines: noise of the sensors, gains of the controller, pumps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Literal

from skillframe.config import build
from skillframe.errors import InputError, UnknownName
from skillframe.robot import Actuation, RobotFile, RobotSpec

LEAST_CORNER, LARGEST_CORNER = 5.0, 0.08
"""Filter corners: least [Hz], which lags by 64 ms; largest share of the control rate (unstable from 0.13)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineNoise:
    """White noise (standard deviations per sample) of a hydraulic machine's sensors, and a filter of two equal poles.

    Defaults are those published with the data set of Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680, per
    sample of a millisecond.

    Attributes:
        encoder: of each minimal coordinate [rad or m]; for quantization, a step over the square root of 12.
        pressure: of each chamber [Pa].
        corner_hz: of the filters [Hz].
        watch: whether inconsistent readings, oil and motion end a trial (`skillframe_hydraulics.watch`).
    """

    encoder: float = 1e-4
    pressure: float = 0.22e5
    corner_hz: float = 24.0
    watch: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Gains of a hydraulic machine's controller that hold for the whole machine.

    Attributes:
        body: K_A of every body [N s/m, N m s/rad]. The published 5 damps so little that a tool bounces on hard contact.
            None derives it from the machine's masses and filters (`skillframe_hydraulics.law.gains`).
        force_corner_hz: of the filter for the rate of the required piston forces [Hz]; published: 8.
    """

    body: float | None = None
    force_corner_hz: float = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredSupply:
    """`[supply.NAME]` of robot.toml: a pump and its line. Their pressures are those of the actuators that they feed.

    Attributes:
        kind: "constant" holds supply_pressure, "load_sensing" the highest load's pressure and a margin; "open_centre"
            gives its flow always, which returns through its valves' centres, and has its relief at supply_pressure.
        flow: largest flow of the pump [m3/s, 1l/min to 6000l/min].
        volume: of the line, with hoses [m3, 0.05l to 500l].
        response: time constant of the pump [s, 1ms to 2s].
        power: largest hydraulic power of the pump [W, 100W to 2000kW]; None: not limited.
        margin: of a load-sensing pump above the highest load [Pa, 1bar to 100bar].
        compensation: of the valves of a load-sensing pump: "pre" keeps the drop over an edge from the line at `margin`,
            "post" holds the highest load's pressure behind all of these edges.
        centre_drop: of open centres, from line to return line at the pump's flow with all spools in their middle
            [Pa, 1bar to 100bar].
        centre_shut: of open centres, share of a spool's travel at which its centre edge is shut [0.2 to 1].
        sharing: "law" slows all motion down together where the pump is too small for it, "none" does not.
        feeds: joints of the actuators that it feeds; empty: all.
    """

    kind: Literal["constant", "load_sensing", "open_centre"] = "constant"
    flow: float
    volume: float
    response: float = 0.06
    power: float | None = None
    margin: float = 20e5
    compensation: Literal["none", "pre", "post"] = "none"
    centre_drop: float = 12e5
    centre_shut: float = 1.0
    sharing: Literal["law", "none"] = "law"
    feeds: tuple[str, ...] = ()


def supplies_of(spec: RobotSpec) -> dict[str, DeclaredSupply]:
    """The `[supply.NAME]` of robot.toml by name. Raises `InputError` for an unknown key, a wrong type or unit."""
    where, given = f"{spec.folder / 'robot.toml'}: supply", spec.tables.get("supply", {})
    if not isinstance(given, Mapping) or not all(isinstance(one, Mapping) for one in given.values()):
        raise InputError(where, "is a table of tables, one for each pump", "write [supply.main] in place of [supply]")
    return {name: build(DeclaredSupply, one, f"{where}.{name}") for name, one in given.items()}


def fed(spec: RobotSpec, supply: DeclaredSupply) -> tuple[str, ...]:
    """Joints of the actuators that a supply feeds."""
    return supply.feeds or tuple(a.joint for a in spec.actuation)


def impossible_supplies(spec: RobotSpec) -> Iterator[tuple[str, str, str]]:
    """Key, problem and fix of each supply that is impossible, and of each that feeds nothing or what it cannot."""
    declared, joints = supplies_of(spec), {a.joint: a for a in spec.actuation}
    owner: dict[str, str] = {}
    for name, one in declared.items():
        key = f"supply.{name}"
        for joint in fed(spec, one):
            if joint not in joints:
                yield f"{key}.feeds", str(UnknownName("joint of an [[actuation]]", joint, joints)), ""
                return
            if (other := owner.setdefault(joint, name)) != name:
                fix = "say under feeds of each which joints it feeds"
                yield f"{key}.feeds", f"both it and supply.{other} feed {joint}", fix
                return
            if lacking := _unmapped(joints[joint], one):
                fix = "map it under inputs or outputs of its [[actuation]], or leave it out of feeds"
                yield f"{key}.feeds", f"the FMU of {joint} has no {', '.join(lacking)}, by which a line feeds it", fix
                return
        if one.sharing == "law" and spec.passive:
            text = "slows a motion down by the flow that it needs, which is not known with a tool on a passive joint"
            yield f"{key}.sharing", text, 'write sharing = "none"'
            return
        own = [joints[joint].known for joint in fed(spec, one)]
        for figure in ("supply_pressure", "return_pressure"):
            values = {row[figure] for row in own if isinstance(row.get(figure), int | float)}
            if len(values) > 1:
                told = " and ".join(f"{value / 1e5:g}" for value in sorted(values))
                fix = "give one, or a supply each"
                yield key, f"feeds actuators whose {figure} is {told} bar, and a pump has one", fix
                return
        pressure = min((float(row["supply_pressure"]) for row in own if "supply_pressure" in row), default=math.inf)
        if one.kind == "load_sensing" and one.margin >= pressure:
            text = f"is {one.margin / 1e5:g} bar, not below the supply_pressure of {pressure / 1e5:g} bar"
            yield f"{key}.margin", text, "give 10 to 30 bar, as usual"
        if one.compensation != "none" and one.kind != "load_sensing":
            text = f"is {one.compensation}, and compensated valves need a load-sensing pump, not {one.kind}"
            yield f"{key}.compensation", text, 'write kind = "load_sensing", or leave compensation out'
        if one.kind == "open_centre":
            yield from _impossible_centre(key, one, [joints[joint] for joint in fed(spec, one)])
        leaked = sum(float(row.get("leakage", 0.0)) for row in own) * pressure
        most = one.flow if one.power is None else min(one.flow, one.power / max(pressure, 1.0))
        if leaked >= most:
            text = f"cannot hold {pressure / 1e5:g} bar: {6e4 * leaked:.3g} l/min leak past the pistons, and the pump"
            yield key, f"{text} gives {6e4 * most:.3g}", "give a larger flow or power, or less leakage"


def _unmapped(actuation: Actuation, supply: DeclaredSupply) -> list[str]:
    """What an actuator of another maker does not map and a line needs."""
    if actuation.fmu == "hydraulic_cylinder":
        return []
    mapped = {*actuation.inputs, *actuation.outputs}
    needed = ["supply_drop", "flow_supply", "supply_slope"]
    needed += ["held_pressure"] if supply.compensation != "none" else []
    needed += ["spool"] if supply.kind == "open_centre" or supply.compensation != "none" else []
    return [name for name in needed if name not in mapped]


def _impossible_centre(key: str, supply: DeclaredSupply, fed: Iterable[Actuation]) -> Iterator[tuple[str, str, str]]:
    """What a pump of open centres cannot work with."""
    own = list(fed)
    loose = [a.joint for a in own if a.fmu == "hydraulic_cylinder" and not a.known.get("feed_check", False)]
    if loose:
        text = f"has open centres, and without a load check valve a load sinks into its line: {', '.join(loose)}"
        yield key, text, "write feed_check = true in its parameters, or in [defaults.cylinder]"
    least = max((float(a.known.get("return_pressure", 0.0)) for a in own), default=0.0) + supply.centre_drop
    relief = min((float(a.known["supply_pressure"]) for a in own if "supply_pressure" in a.known), default=math.inf)
    if least >= relief:
        text = f"and the return_pressure are {least / 1e5:g} bar, and its relief opens at {relief / 1e5:g} bar"
        yield f"{key}.centre_drop", text, "give the drop with all spools in their middle, 5 to 20 bar as usual"


def impossible(actuation: tuple[Actuation, ...], sensors: MachineNoise, gains: Gains) -> Iterator[tuple[str, str, str]]:
    """Impossible values: key, problem, and fix."""
    for drive in actuation:
        for key in ("velocity_gain", "force_gain"):
            value = getattr(drive, key)
            if value is not None and not 0.0 < value < math.inf:
                yield f"actuation of {drive.joint}: {key}", f"is {value:g}", "give a positive, finite number"
    figures = (
        ("sensors.encoder", sensors.encoder, 0.0, 0.1, "rad (m), a standard deviation"),
        ("sensors.pressure", sensors.pressure, 0.0, 1e7, "Pa, a standard deviation"),
        ("sensors.corner_hz", sensors.corner_hz, LEAST_CORNER, math.inf, "Hz"),
        ("gains.body", 0.0 if gains.body is None else gains.body, 0.0, math.inf, "N s/m"),
        ("gains.force_corner_hz", gains.force_corner_hz, LEAST_CORNER, math.inf, "Hz"),
    )
    for key, value, low, high, unit in figures:
        if not low <= value <= high or not math.isfinite(value):
            allowed = f"{low:g} to {high:g} {unit}" if math.isfinite(high) else f"{low:g} {unit} or more"
            yield key, f"is {value:g}", f"give {allowed}"


def fast_filters(sensors: MachineNoise, gains: Gains, rate_hz: float) -> Iterator[tuple[str, str]]:
    """Filters too fast for a control rate [Hz]: problem and fix."""
    corners = {"sensors.corner_hz": sensors.corner_hz, "gains.force_corner_hz": gains.force_corner_hz}
    for key, corner in corners.items():
        if corner > LARGEST_CORNER * rate_hz:
            problem = f"{key} is {corner:g}, too fast a filter for control.rate_hz of {rate_hz:g}"
            yield problem, f"give {LARGEST_CORNER * rate_hz:g} Hz at most, or raise control.rate_hz"


def tables() -> dict[str, type]:
    """The dataclass of each table of robot.toml for hydraulic machines."""
    return {"sensors": MachineNoise, "gains": Gains, "supply.NAME": DeclaredSupply}


def noise_of(spec: RobotSpec) -> MachineNoise:
    """The `[sensors]` of robot.toml. Raises `InputError` for an unknown key or a wrong type."""
    return build(MachineNoise, spec.tables.get("sensors", {}), f"{spec.folder / 'robot.toml'}: sensors")


def gains_of(spec: RobotSpec) -> Gains:
    """The `[gains]` of robot.toml. Raises `InputError` as `noise_of`."""
    return build(Gains, spec.tables.get("gains", {}), f"{spec.folder / 'robot.toml'}: gains")


def with_noise(spec: RobotSpec, noise: MachineNoise) -> RobotSpec:
    """The robot with other sensors."""
    return replace(spec, tables={**spec.tables, "sensors": asdict(noise)})


def with_gains(spec: RobotSpec, gains: Gains) -> RobotSpec:
    """The robot with other gains."""
    return replace(spec, tables={**spec.tables, "gains": {k: v for k, v in asdict(gains).items() if v is not None}})


def require_declared(spec: RobotSpec) -> None:
    """Refuse invalid keys and values in `[sensors]`, `[gains]`, `[supply.NAME]` and `[[actuation]]`.

    Raises:
        InputError: names the first of them.
    """
    where = spec.folder / "robot.toml"
    known = [name.partition(".")[0] for name in tables()]
    for key in spec.tables:
        if key not in known:
            raise InputError(where, str(UnknownName("key", key, [*known, *(f.name for f in fields(RobotFile))])))
    if not spec.actuation:
        raise InputError(f"{where}: drive", "there is no [[actuation]] that it could be the kind of", "leave it out")
    slips = (*impossible(spec.actuation, noise_of(spec), gains_of(spec)), *impossible_supplies(spec))
    for key, problem, fix in slips:
        raise InputError(f"{where}: {key}", problem, fix)
