"""Plots of a hydraulic machine: pressures, valves, forces and energy."""

from __future__ import annotations

import numpy as np

from skillframe.execution import Trace
from skillframe.extend import Curve, TimePlot, actuator_curves

PRESSURE_CAPTION = "Measured behind the filters; full: piston side, dashed: rod side."
VALVE_CAPTION = "Commanded opening of the valves."
FORCE_CAPTION = "From pressures and identified friction; faint: in simulation."
BILL_CAPTION = (
    "Since the start. Taken from the supply, and passed on by the pistons; what lies between heated the oil, "
    "or is left in oil and moving masses."
)


def machine_plots(trace: Trace) -> list[TimePlot]:
    """Plots of a trace's hydraulic columns, or none for other robots."""
    data = trace.machine
    if "pressure_a" not in data:
        return []
    names = [str(name) for name in trace.meta.get("actuators") or []]
    pressures = [
        *actuator_curves(names, 1e-5 * data["pressure_a"], "line"),
        *actuator_curves([], 1e-5 * data["pressure_b"], "line dashed"),
    ]
    forces = [
        *actuator_curves([], 1e-3 * data["piston_force_true"], "line faint"),
        *actuator_curves(names, 1e-3 * data["piston_force"], "line"),
    ]
    bill = [
        Curve(name="from the supply", values=1e-3 * data["energy_supply"], stroke="line ink"),
        Curve(name="by the pistons", values=1e-3 * data["energy_pistons"], stroke="line c1"),
    ]
    finite = [curve for curve in bill if np.isfinite(curve.values).all()]
    return [
        TimePlot("Pressures", "bar", pressures, PRESSURE_CAPTION),
        TimePlot("Valves", "%", actuator_curves(names, 100.0 * data["valve"], "line"), VALVE_CAPTION, events=False),
        TimePlot("Piston forces", "kN", forces, FORCE_CAPTION),
        TimePlot("Energy", "kJ", finite, BILL_CAPTION),
    ]
