"""Directions across the way in which nothing holds an assembled part.

A part that slides freely both ways farther than *seated* allows shows nobody by touch where it belongs along them: a
skill can only rely on the demonstrated place, and its "seated" says nothing about it.
"""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float
from skillframe_parts.fit import TOUCH, PartsFit, face_normals, thickness

RAISED_M, STEP_M = 3e-4, 5e-4
"""Height over the end in which it slides, off the bottom, and distance between the checked places."""
GRID = np.radians(np.arange(0.0, 180.0, 10.0))


def free_direction(fit: PartsFit, far: float) -> Float | None:
    """Direction (3,) in the fixture frame in which the assembled part slides by `far` [m] both ways, or None.

    Checked are a grid of 10 degrees, and directions along the part's flat sides, as those of a tight slot. Of several,
    their mean, in which opposite directions are the same.
    """
    angles = np.concatenate([GRID, [np.arctan2(x, -y) for x, y, _ in face_normals(fit.plug) if np.hypot(x, y) > 0.5]])
    steps = [*np.arange(STEP_M, far, STEP_M).tolist(), far]
    free = [all(_passes(fit, angle, way * step) for way in (1, -1) for step in steps) for angle in angles]
    if not any(free):
        return None
    angle = 0.5 * np.angle(np.exp(2j * angles[free]).sum())
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _passes(fit: PartsFit, angle: float, by: float) -> bool:
    moved = fit.plug.translate([float(by * np.cos(angle)), float(by * np.sin(angle)), RAISED_M])
    return thickness(moved ^ fit.socket) <= TOUCH
