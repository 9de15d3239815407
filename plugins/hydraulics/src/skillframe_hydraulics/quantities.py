"""Quantities of a trial specific to hydraulic machines, and those of the core that do not apply."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

import numpy as np

from skillframe.config.units import Quantity, Range
from skillframe.frames import Float
from skillframe.robot import RobotSpec
from skillframe.world import OF_ACTUATORS, unfit_payload

if TYPE_CHECKING:
    from skillframe.robot import RobotModel


def _unfit_switch(values: Float, robot: RobotModel | None) -> tuple[str, str] | None:
    odd = values[(values != 0.0) & (values != 1.0)]
    return (f"is {odd.flat[0]:g}, and something is broken or not", "give 1 or 0") if odd.size else None


def _switch(name: str, about: str) -> Quantity:
    return Quantity(
        name, "", 0.0, f"1: {about}", Range(0.0, 1.0, "1 where it is broken, else 0"), unfit=_unfit_switch
    )  # fmt: skip


def _unfit_cylinder(values: Float, robot: RobotModel | None) -> tuple[str, str] | None:
    joints = None if robot is None else [a.joint for a in robot.spec.actuation]
    odd = values[(values != np.round(values)) | (values < 1) | (values > (np.inf if joints is None else len(joints)))]
    there = ", ".join(f"{i} {joint}" for i, joint in enumerate(joints or (), 1))
    cure = f"give one of {there}" if there else "give 1 for the first"
    return (f"is {odd.flat[0]:g}, which is none of its cylinders", cure) if odd.size else None


_HOLE = Range(0.0, 1e-2, "a hole of 11 cm, beyond all hoses")
FAULTS = (
    _switch("sensor.pressure_frozen", "both pressures of the cylinder repeat their last reading"),
    _switch("sensor.pressure_zero", "both pressures of the cylinder read zero"),
    Quantity("sensor.encoder_step", "rad", 0.0,
           "jump of the encoder of the joint that the cylinder moves; m if it slides",
           Range(-pi, pi, "half a turn to either side")),
    _switch("sensor.encoder_frozen", "that encoder repeats its last reading"),
    _switch("actuator.stuck", "the valve's spool stays where it then is, whatever is commanded"),
    Quantity("actuator.runaway", "", 0.0,
           "where the valve's spool goes whatever is commanded, -1 to 1 (extends); 0: nowhere",
           Range(-1.0, 1.0, "the spool's travel")),
    Quantity("actuator.burst_a", "m2", 0.0, "hole in the hose of the piston side; 1.3e-4 is half an inch wide", _HOLE),
    Quantity("actuator.burst_b", "m2", 0.0, "hole in the hose of the rod side", _HOLE),
    Quantity("actuator.supply_loss", "", 0.0,
           "share of the supply pressure above the return line's that fails, for all cylinders",
           Range(0.0, 1.0, "a share")),
)  # fmt: skip
"""Faults that occur at `fault.time` in the cylinder `fault.cylinder`."""
_FAULTS = frozenset({"fault.time", "fault.cylinder", *(each.name for each in FAULTS)})


def quantities() -> tuple[Quantity, ...]:
    """The quantities of a hydraulic machine besides those of every world and robot."""
    scaled = {
        "friction_scale": (
            "true friction of a machine's cylinders over what its controller knows",
            Range(0.0, 100.0, "as no guess of it is a hundredfold off"),
        ),
        "valve_scale": (
            "true rated flow of a hydraulic machine's valves over what its controller knows",
            Range(0.01, 100.0, "as no data sheet is a hundredfold off"),
        ),
        "bulk_scale": (
            "true bulk modulus of a hydraulic machine's oil over what its controller knows",
            Range(0.01, 100.0, "as no oil is a hundredfold off"),
        ),
    }
    each = [
        Quantity(f"actuator.{name}_{i}", "", 1.0,
               f"{about}: of cylinder {i} in robot.toml alone, besides actuator.{name}", limits)
        for name, (about, limits) in scaled.items()
        for i in range(1, 7)  # a slew, twin cylinders and three others
    ]  # fmt: skip
    return (
        *OF_ACTUATORS,
        Quantity("robot.nominal_payload", "kg", None, "mass that is declared to a machine's controller",
               Range(0.0, 20_000.0, "what the largest machines lift"), unfit=unfit_payload),
        Quantity("actuator.supply_pressure", "Pa", None, "supply pressure of a hydraulic machine",
               Range(1e5, 1e8, "from the air's own pressure to twice what pumps of cranes give")),
        Quantity("actuator.deadband", "", None, "dead band of a hydraulic machine's valves, of their full stroke",
               Range(0.0, 0.99, "as a valve without a stroke left moves nothing")),
        *(Quantity(f"actuator.{name}", "", 1.0, about, limits) for name, (about, limits) in scaled.items()
          if name != "friction_scale"),  # the whole machine's is as that of servos
        *each,
        *FAULTS,
        Quantity("fault.time", "s", 0.0,
               "when a machine's fault occurs, from the skill's start; negative in the swing before it",
               Range(-60.0, 3600.0, "from the swing on, and within an hour")),
        Quantity("fault.cylinder", "", 1.0, "which cylinder it strikes, counted from 1 in robot.toml's order",
               Range(1.0, 100.0, "one of the machine's cylinders"), unfit=_unfit_cylinder),
    )  # fmt: skip


def lacks(key: str, spec: RobotSpec) -> str:
    """Why a quantity has no effect on this machine, or ""."""
    number = key.rpartition("_")[2]
    if key.startswith("actuator.") and number.isdigit() and int(number) > len(spec.actuation):
        return f"has {len(spec.actuation)} cylinders"
    if key.startswith("sensor.") and key not in _FAULTS:
        return "has no wrench sensor: its contact force is estimated from pressures"
    return "does not turn its tool to a start" if key.startswith("start.tilt_") else ""
