r"""Faces: where a face that was touched turned the push aside, the tool must give way.

Which way a tool was moved aside can be seen in its motion (`axes`, as the papers have it) or in what moved it. The
motion holds a person's wandering as well, and it does not show a face that held the tool on its way, which was pushed
and did not move. So what moved it is asked first. With the push m and the motion v of an interval in contact (unit
vectors, `sectors`), friction acts along v, and

    n = m - (m . v) v

is what the face bore of the push. A person who wanders along a valley moves the tool along v and leaves n in the
valley's plane; a wall beside a floor leaves it. Over five intervals on end let N be the means of n, less their part
along the desired direction and along the axes found so far; the next axis e is their first principal axis, if

    max |N . e| > 1/4,

that is, if somewhere faces bore a quarter of the push along it. If there is no such axis, the motion decides.

On simulated valleys whose slides meander by 8 degrees the axis is then .9 degrees off in the median and 2.9 at most, in
place of 4.5 and 11.3 by the motion (`test_faces`); on walls in edges of slides and corners it finds the second axis,
which the motion mostly does not. Five intervals and the quarter are our choice.

A tool that turns takes its contacts with it, so that its normals span more than one face does: faces are asked only
where it did not turn.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float
from skillframe_lmc.intervals import Motion
from skillframe_lmc.sectors import sectors

ON_END = 5
TURNED_ASIDE = 0.25  # of the push


def face_axes(motions: Sequence[Motion], direction: Float) -> Float:
    """Axes (d, 3) along which faces turned the push aside, the strongest first, orthonormal, square to the direction.

    Args:
        motions: of the demonstrations.
        direction: (3,) desired direction.
    """
    borne = np.concatenate([_borne(motion) for motion in motions])
    taken = direction[None]
    found = list[Float]()
    while len(taken) < 3 and len(borne):
        borne = borne - borne @ taken.T @ taken
        axis = np.linalg.svd(borne)[2][0]
        if np.abs(borne @ axis).max() <= TURNED_ASIDE:
            break
        found.append(axis)
        taken = np.vstack([taken, axis])
    return np.array(found).reshape(-1, 3)


def _borne(motion: Motion) -> Float:
    """What faces carried of the push (K, 3), means over `ON_END` intervals in contact."""
    given = sectors(motion)
    push, way = given.push[given.contact], given.motion[given.contact]
    normal = push - (push * way).sum(axis=-1, keepdims=True) * way
    count = len(normal) - ON_END + 1
    return np.array([normal[i : i + ON_END].mean(axis=0) for i in range(count)]).reshape(-1, 3)
