"""What robot.toml says of a machine beyond an arm: loops, actuators, payload, sensors, and the gains of its law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

LEAST_CORNER, LARGEST_CORNER = 5.0, 0.08
"""Of filters: [Hz]; share of the control rate (from 0.13 on a `RateFilter` is unstable). Ours: 5 Hz lag by 64 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopClosure:
    """A closed chain: the origins of two frames of the tree coincide.

    Attributes:
        frame_a, frame_b: names of two links, whose frames coincide.
    """

    frame_a: str
    frame_b: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredDrive:
    """What stands between the control law and the joints.

    Attributes:
        kind: "hydraulic" cylinders or electric "servo"s, which `[[actuation]]` names, or the name of a plug-in's drive.
    """

    kind: str = "hydraulic"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredPayload:
    """What a machine carries.

    Attributes:
        link: whose inertia has the load in it.
        mass: of the load [kg, 0 to 1000t].
        rating: the most that it may be [kg, 0 to 1000t]; the largest cranes lift that much.
    """

    link: str
    mass: float
    rating: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """An actuator (an FMU) on a joint.

    Attributes:
        joint: that it drives.
        fmu: its name, or its file beside robot.toml.
        parameters: of the FMU, by its names.
        inputs, outputs: our names to the FMU's.
        nominal: what the controller takes the actuator for, by our names, where the FMU is not told so in `parameters`.
        initial_force: the FMU's parameter for the force [N] that it holds at the start; "" if it has none.
        unused: inputs and outputs of the FMU that are left alone on purpose, so that nothing is said of them.
        velocity_gain: k_x of its piston [m] (`skillframe.machine.law.vdc_actuator`); None: it follows from its
            figures (`skillframe.machine.law.gains`).
        force_gain: k_f of its piston [m^2/(N s)]; likewise.
    """

    joint: str
    fmu: str
    parameters: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    nominal: dict[str, Any] = field(default_factory=dict)
    initial_force: str = ""
    unused: tuple[str, ...] = ()
    velocity_gain: float | None = None
    force_gain: float | None = None

    @property
    def known(self) -> dict[str, Any]:
        """Parameters of the cylinder or servo as the controller knows them, by our names."""
        return {**self.parameters, **self.nominal}


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineNoise:
    """Of a hydraulic machine: white noise at every sample, standard deviations, then a filter of two equal poles.

    The defaults are those published with the data set of Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680,
    whose noise powers are per sample of a millisecond.

    Attributes:
        encoder: of each minimal coordinate [rad or m], a step over the square root of 12 if steps are all its noise.
        pressure: of each chamber [Pa].
        corner_hz: of the filters [Hz].
        watch: whether readings, oil and motion that do not fit each other end a trial (`skillframe.machine.watch`).
    """

    encoder: float = 1e-4
    pressure: float = 0.22e5
    corner_hz: float = 24.0
    watch: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Gains of the law of a hydraulic machine that are the same for all of it (ours).

    Attributes:
        body: K_A of every body [N s/m, N m s/rad]; the published 5 damps nothing, and a tool that lands on something
            hard hops. None: it follows from the machine's masses and filters (`skillframe.machine.law.gains`).
        force_corner_hz: of the filter that gives the required piston forces' rate [Hz]; published: 8.
    """

    body: float | None = None
    force_corner_hz: float = 16.0


def impossible(actuation: tuple[Actuation, ...], sensors: MachineNoise, gains: Gains) -> Iterator[tuple[str, str, str]]:
    """What the types allow and no machine has: key, what is wrong with it, and the cure."""
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
    """Filters that a control rate [Hz] is too low for: what is wrong, and the cure."""
    corners = {"sensors.corner_hz": sensors.corner_hz, "gains.force_corner_hz": gains.force_corner_hz}
    for key, corner in corners.items():
        if corner > LARGEST_CORNER * rate_hz:
            problem = f"{key} is {corner:g}, too fast a filter for control.rate_hz of {rate_hz:g}"
            yield problem, f"give {LARGEST_CORNER * rate_hz:g} Hz at most, or raise control.rate_hz"
