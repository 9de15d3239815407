"""AutoMate's check of an assembly, as two figures of a trial's end.

`check_plug_inserted_in_socket` (Tang et al., "AutoMate: Specialist and Generalist Assembly Policies over Diverse
Geometries", RSS 2024, and its code): the plug's origin is above the socket's and below a height of each assembly, and
the mean distance of four key points, on the line of 1 m along z through both origins, is below 20 mm. A plug on the rim
of a shallow socket passes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float, matrix_from_quaternion, norm

if TYPE_CHECKING:
    from skillframe.execution import Trace

KEY_POINTS: Float = np.linspace(-0.5, 0.5, 4)
"""Places of the key points on their line, from the origin [m]."""


def height(trace: Trace) -> float:
    """Height of the held part's origin above the assembled one at the end, along the way out [m].

    Without a fixture file it is the tip's height over the fixture's origin.
    """
    turn, shift, origin = _left(trace)
    return float((turn @ origin + shift - origin)[2])


def distance(trace: Trace) -> float:
    """Mean distance of the four key points from their assembled places at the end [m]."""
    turn, shift, origin = _left(trace)
    points = origin + np.outer(KEY_POINTS, (0.0, 0.0, 1.0))
    return float(norm(points @ turn.T + shift - points).mean())


def passes(height_m: float, distance_m: float, way_out_m: float) -> bool:
    """Whether a trial passes the published check, `way_out_m` being the assembly's `disassembly_dist`."""
    # 1 mm below counts as above the socket (published 0, but contact is compliant in both simulators); the key points'
    # mean distance is as published
    return -1e-3 < height_m < way_out_m and distance_m < 0.02


def _left(trace: Trace) -> tuple[Float, Float, Float]:
    """Rotation (3, 3) and shift (3,) from the assembled to the last pose in the fixture frame, and the origin (3,)."""
    meta = trace.meta
    params, bodies = meta.get("params", {}), [each["name"] for each in meta.get("bodies", ())]
    center = np.array(meta.get("center_of_compliance", np.zeros(3)))
    place, turned = trace.position[-1], matrix_from_quaternion(trace.quaternion[-1])
    stand, back = np.zeros(3), np.eye(3)  # the base, where no fixture is drawn
    if "fixture" in bodies:
        fixture = bodies.index("fixture")
        stand, back = trace.body_position[-1, fixture], matrix_from_quaternion(trace.body_quaternion[-1, fixture])
    tip = np.array(meta.get("frames", {}).get("tip", center)) - center
    turn = back.T @ turned @ np.diag([1.0, -1.0, -1.0])  # the tool points down: its z is minus the fixture's
    assembled = np.array([0.0, 0.0, -params.get("depth", 0.0)])
    shift = back.T @ (place + turned @ tip - stand) - turn @ assembled
    return turn, shift, np.array(params.get("origin", (0.0, 0.0, 0.0)))
