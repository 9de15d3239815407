"""Plots over time of what drives a robot: pressures, valves, forces and energy of a hydraulic machine. Servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from skillframe.execution.trace import Trace
from skillframe.frames import Float
from skillframe.reports.markup import Markup
from skillframe.reports.plots import Curve, events_of, time_plot

STROKES = ("c1", "c2", "c3", "s4")
PRESSURE_CAPTION = "Measured behind the filters; full: piston side, dashed: rod side."
VALVE_CAPTION = "Commanded opening of the valves."
FORCE_CAPTION = "From pressures and identified friction; faint: in the simulator."
SERVO_CAPTION = "What the servos' springs put on the joints, in the simulator."
MOTOR_CAPTION = "Speeds of the motors, on the joints' side of their gears."
BILL_CAPTION = (
    "Since the start. Taken from the supply, and passed on by the pistons; what lies between heated the oil, "
    "or is left in oil and moving masses."
)


def machine_plots(trace: Trace) -> list[Markup]:
    """Plots of what a machine's trace holds besides a robot's, or none for other robots."""
    data = trace.machine
    if not data:
        return []
    time, events = np.asarray(trace.time, dtype=float), events_of(trace)
    names = [str(name) for name in trace.meta.get("actuators") or []]
    if not trace.estimated:
        return _servo_plots(data, names, time, events)
    pressures = [
        *_each(names, 1e-5 * data["pressure_a"], "line"), *_each([], 1e-5 * data["pressure_b"], "line dashed")
    ]  # fmt: skip
    forces = [
        *_each([], 1e-3 * data["piston_force_true"], "line faint"), *_each(names, 1e-3 * data["piston_force"], "line")
    ]  # fmt: skip
    bill = [
        Curve(name="from the supply", values=1e-3 * data["energy_supply"], stroke="line ink"),
        Curve(name="by the pistons", values=1e-3 * data["energy_pistons"], stroke="line c1"),
    ]
    return [
        time_plot("Pressures", "bar", time, pressures, events=events, caption=PRESSURE_CAPTION),
        time_plot("Valves", "%", time, _each(names, 100.0 * data["valve"], "line"), caption=VALVE_CAPTION),
        time_plot("Piston forces", "kN", time, forces, events=events, caption=FORCE_CAPTION),
        time_plot("Energy", "kJ", time, [curve for curve in bill if np.isfinite(curve.values).all()],
                  events=events, caption=BILL_CAPTION),
    ]  # fmt: skip


def _servo_plots(
    data: Mapping[str, Float], names: Sequence[str], time: Float, events: Sequence[tuple[float, str]]
) -> list[Markup]:
    """Torques of the springs, and the motors' speeds where they are known. Nothing of what another drive recorded."""
    if "servo_force" not in data:
        return []
    plots = [time_plot("Joint torques", "Nm", time, _each(names, data["servo_force"], "line"), events=events,
                       caption=SERVO_CAPTION)]  # fmt: skip
    if "servo_motor_velocity" in data:
        speeds = _each(names, data["servo_motor_velocity"], "line")
        plots.append(time_plot("Motors", "rad/s", time, speeds, events=events, caption=MOTOR_CAPTION))
    return plots


def _each(names: Sequence[str], values: Float, style: str) -> list[Curve]:
    """A curve for each actuator's column of values (T, k)."""
    return [
        Curve(name=names[i] if i < len(names) else "", values=values[:, i],
              stroke=style.replace("line", f"line {STROKES[i % len(STROKES)]}", 1))
        for i in range(values.shape[1])
    ]  # fmt: skip
