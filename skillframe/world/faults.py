"""What faults of a hydraulic machine can be: the values that their quantities take."""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float
from skillframe.robot.model import RobotModel

_SWITCHES = frozenset({"sensor.pressure_frozen", "sensor.pressure_zero", "sensor.encoder_frozen", "actuator.stuck"})


def fault_problem(key: str, values: Float, robot: RobotModel | None) -> tuple[str, str] | None:
    """What is wrong with some value (N,) of a fault's quantity within its range, and the cure. None if nothing is."""
    if key in _SWITCHES:
        odd = values[(values != 0.0) & (values != 1.0)]
        return (f"is {odd.flat[0]:g}, and something is broken or not", "give 1 or 0") if odd.size else None
    if key == "fault.cylinder":
        most = len(robot.spec.actuation) if robot is not None else np.inf
        odd = values[(values != np.round(values)) | (values < 1) | (values > most)]
        there = ", ".join(f"{i} {a.joint}" for i, a in enumerate(robot.spec.actuation, 1)) if robot is not None else ""
        cure = f"give one of {there}" if there else "give 1 for the first"
        return (f"is {odd.flat[0]:g}, which is none of its cylinders", cure) if odd.size else None
    return None
