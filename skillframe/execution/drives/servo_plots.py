"""Plots over time of electric servos: the torques that they put on the joints, and the speeds of their motors."""

from __future__ import annotations

from skillframe.execution.trace import Trace
from skillframe.extend.outputs import TimePlot, actuator_curves

TORQUE_CAPTION = "What the servos' springs put on the joints, in simulation."
MOTOR_CAPTION = "Speeds of the motors, on the joints' side of their gears."


def servo_plots(trace: Trace) -> list[TimePlot]:
    """Torques of the springs, and the motors' speeds where they are known. Nothing of what another drive recorded."""
    data = trace.machine
    if "servo_force" not in data:
        return []
    names = [str(name) for name in trace.meta.get("actuators") or []]
    plots = [TimePlot("Joint torques", "Nm", actuator_curves(names, data["servo_force"], "line"), TORQUE_CAPTION)]
    if "servo_motor_velocity" in data:
        speeds = actuator_curves(names, data["servo_motor_velocity"], "line")
        plots.append(TimePlot("Motors", "rad/s", speeds, MOTOR_CAPTION))
    return plots
