"""What robot.toml says of a machine beyond an arm: loops, actuators, payload, sensors, and the gains of its law."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A closed chain: the origins of two frames of the tree coincide."""

    frame_a: str
    frame_b: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What a machine carries: `mass` [kg] of load in the inertia of a link, and `rating`, the most it may be [kg]."""

    link: str
    mass: float
    rating: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """An actuator (an FMU) on a joint.

    Attributes:
        parameters: of the FMU, by its names; inputs, outputs: our names to the FMU's.
        nominal: what the controller takes the cylinder for, by our names, where the FMU is not told so in `parameters`.
        initial_force: the FMU's parameter for the force [N] that it holds at the start; "" if it has none.
        velocity_gain, force_gain: k_x and k_f of its piston (`skillframe.control.vdc_actuator`).
    """

    joint: str
    fmu: str
    parameters: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    nominal: dict[str, Any] = field(default_factory=dict)
    initial_force: str = ""
    velocity_gain: float = 5e-3
    force_gain: float = 4e-9

    @property
    def known(self) -> dict[str, Any]:
        """Parameters of the cylinder as the controller knows them, by our names."""
        return {**self.parameters, **self.nominal}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Of a hydraulic machine: white noise at every sample, standard deviations, then a filter of two equal poles.

    The defaults are those published with the data set of Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680,
    whose noise powers are per sample of a millisecond.

    Attributes:
        encoder: of each minimal coordinate [rad or m]; pressure: of each chamber [Pa]; corner_hz: of the filters [Hz].
    """

    encoder: float = 1e-4
    pressure: float = 0.22e5
    corner_hz: float = 24.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Gains of the law of a hydraulic machine that are the same for all of it; ours.

    Attributes:
        body: K_A of every body [N s/m, N m s/rad]; the published 5 damps nothing, and a tool that lands on something
            hard hops.
        force_corner_hz: of the filter that gives the required piston forces' rate [Hz]; published: 8.
    """

    body: float = 1000.0
    force_corner_hz: float = 16.0


def positive_figures(actuation: tuple[Actuation, ...], sensors: Sensors, gains: Gains) -> Iterator[tuple[str, float]]:
    """Names and values of what must be a positive number."""
    for drive in actuation:
        yield f"actuation of {drive.joint}: velocity_gain", drive.velocity_gain
        yield f"actuation of {drive.joint}: force_gain", drive.force_gain
    yield "sensors.corner_hz", sensors.corner_hz
    yield "gains.force_corner_hz", gains.force_corner_hz
