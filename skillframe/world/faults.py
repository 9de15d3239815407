"""What faults of a hydraulic machine can be: the values that their quantities take."""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float
from skillframe.robot.model import RobotModel

LARGEST_HOLE = 1e-2
"""Of a hose [m2]: 11 cm wide, beyond all hoses (our choice)."""
LARGEST_STEP = np.pi
"""Of an encoder [rad, m] (our choice)."""
_SWITCHES = frozenset({"sensor.pressure_frozen", "sensor.pressure_zero", "sensor.encoder_frozen", "actuator.stuck"})
_RANGES = {
    "sensor.encoder_step": (-LARGEST_STEP, LARGEST_STEP, "a jump in rad or m"),
    "actuator.runaway": (-1.0, 1.0, "-1 to 1, of the spool's travel"),
    "actuator.burst_a": (0.0, LARGEST_HOLE, "an area in m2, 1.3e-4 for half an inch"),
    "actuator.burst_b": (0.0, LARGEST_HOLE, "an area in m2, 1.3e-4 for half an inch"),
    "actuator.supply_loss": (0.0, 1.0, "a share, 0 to 1"),
    "fault.time": (-60.0, 1e6, "seconds from the skill's start"),
}


def fault_problem(key: str, values: Float, robot: RobotModel | None) -> tuple[str, str] | None:
    """What is wrong with some value (N,) of a fault's quantity, and the cure; None if nothing is."""
    if key in _SWITCHES:
        odd = values[(values != 0.0) & (values != 1.0)]
        return (f"is {odd.flat[0]:g}, and something is broken or not", "give 1 or 0") if odd.size else None
    if key == "fault.cylinder":
        most = len(robot.spec.actuation) if robot is not None else np.inf
        odd = values[(values != np.round(values)) | (values < 1) | (values > most)]
        there = ", ".join(f"{i} {a.joint}" for i, a in enumerate(robot.spec.actuation, 1)) if robot is not None else ""
        cure = f"give one of {there}" if there else "give 1 for the first"
        return (f"is {odd.flat[0]:g}, which is none of its cylinders", cure) if odd.size else None
    low, high, what = _RANGES[key]
    odd = values[~((low <= values) & (values <= high))]
    return (f"cannot be {odd.flat[0]:g}", f"give {what}") if odd.size else None
