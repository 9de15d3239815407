r"""How an insertion with two arms ended: the classes of the two-arm paper, told from how far each tool turned.

With tool turns theta_1, theta_2 about the tilt axis, the pair turned as a whole by (theta_1 + theta_2) / 2 and one arm
relative to the other by theta_1 - theta_2. The paper names (a) jamming, (b) success and (c) both arms rotating the
wrong way; (c) is split here into turning together and turning away from each other. The thresholds are ours.
"""

from __future__ import annotations

import numpy as np

from skillframe.execution.arms import ArmsResult
from skillframe.frames import Float

COMMON_RAD = np.radians(5.0)
AWAY_RAD = np.radians(3.0)
CLASSES = ("success", "jam", "common rotation", "turned away")


def classify(result: ArmsResult, tilt_rad: Float, axis: Float) -> list[str]:
    """One of `CLASSES` per trial.

    Args:
        result: of a two-arm run.
        tilt_rad: (N,) tilt of the tool at the start.
        axis: (3,) unit vector of the tilt in base.
    """
    turned = result.turned_rad @ axis  # (N, 2)
    common, relative = turned.mean(-1), turned[:, 0] - turned[:, 1]
    away = result.final_error_rad - np.abs(tilt_rad) > AWAY_RAD
    together = (np.abs(common) > COMMON_RAD) & (np.abs(common) > np.abs(relative))
    names = np.where(together, "common rotation", np.where(away, "turned away", "jam"))
    return [str(name) for name in np.where(result.success, "success", names)]
