"""Plots over time of a hydraulic machine: pressures, valve commands, piston forces and the energy bill."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float
from skillframe.report.markup import Markup
from skillframe.report.plots import Curve, events_of, time_plot
from skillframe.run.trace import Trace

STROKES = ("c1", "c2", "c3", "s4")
PRESSURE_CAPTION = "Measured behind the filters; full: piston side, dashed: rod side."
VALVE_CAPTION = "Commanded opening of the valves."
FORCE_CAPTION = "From pressures and identified friction; faint: in the simulator."
BILL_CAPTION = (
    "Since the start. Taken from the supply, and passed on by the pistons; what lies between heated the oil, "
    "or is left in oil and moving masses."
)


def machine_plots(trace: Trace) -> list[Markup]:
    """Plots of what a machine's trace holds besides a robot's; none for other robots."""
    data = trace.machine
    if not data:
        return []
    time, events = np.asarray(trace.time, dtype=float), events_of(trace)
    names = [str(name) for name in trace.meta.get("actuators") or []]
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


def _each(names: Sequence[str], values: Float, style: str) -> list[Curve]:
    """A curve for each actuator's column of values (T, k)."""
    return [
        Curve(name=names[i] if i < len(names) else "", values=values[:, i],
              stroke=style.replace("line", f"line {STROKES[i % len(STROKES)]}", 1))
        for i in range(values.shape[1])
    ]  # fmt: skip
