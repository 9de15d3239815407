"""Learn a policy whose phases belong to places, from demonstrations that name places.

Each place is a policy learned from all demonstrations in its frame, so that it may take several motions, places of one
board are never pooled, and a moved board adds no noise. Ways in free air are means in the place's frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.document import PLACES, as_plain, frame_of, places_of, seen_from
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Pose, norm
from skillframe_segmenter.boundaries import OPTION
from skillframe_segmenter.visits import BASE, Visit, index_at, path_of, visits_of

SLOWEST = 0.02  # m/s, in free air
NOWHERE = Pose(np.zeros(3), np.eye(3))
LearnPlace = Callable[[Sequence[Demonstration], LearnOptions], Document]


def names_places(demonstrations: Sequence[Demonstration]) -> bool:
    """Whether all demonstrations name places."""
    return bool(demonstrations) and all(bool(places_of(d)) for d in demonstrations)


def learn_places(
    demonstrations: Sequence[Demonstration], options: LearnOptions, recoveries: int, moved: bool, learn: LearnPlace
) -> Document:  # fmt: skip
    """Body of a policy whose phases belong to places.

    Args:
        demonstrations: all naming places.
        options: handed to the learner of each place.
        recoveries: of the whole.
        moved: boundaries were moved by the user.
        learn: learns one place, from demonstrations in its frame.

    Raises:
        InputError: demonstrations that do not agree on places, or one that cannot be learned from.
    """
    if moved:
        raise InputError(OPTION, "moves boundaries between phases of one frame, and these demonstrations name places",
                         "give --set places=false, or leave it out")  # fmt: skip
    visits, scatters = visits_of(demonstrations)
    frames = [{**places_of(d), BASE: NOWHERE} for d in demonstrations]
    count = len(visits[0])
    phases = []
    for k in range(count):
        here = [each[k] for each in visits]
        seen = [seen_from(d, f[here[0].place]) for d, f in zip(demonstrations, frames, strict=True)]
        phases.append(_phase(seen, here, _speed(demonstrations, visits), options, learn, scatters[k]))
    used = {phase["place"] for phase in phases} - {BASE}
    return {
        "frame": frame_of(demonstrations, options),
        "phases": phases,
        "recoveries": recoveries,
        PLACES: as_plain({name: frames[0][name] for name in sorted(used)}),
        "phase_model": {"type": "places", "successors": np.eye(count, count + 1, 1).tolist()},
        "demonstrations": [
            {
                "file": d.source,
                "start": float(d.time[0]),
                "end": float(d.time[-1]),
                "labels": list(range(count)),
                "boundaries": [(v.out or (v.leaves,))[-1] for v in each[:-1]],
            }  # where the tool leaves a place
            for d, each in zip(demonstrations, visits, strict=True)
        ],
    }


def _phase(
    seen: Sequence[Demonstration], visits: Sequence[Visit], speed: float, options: LearnOptions, learn: LearnPlace,
    scatter: dict[str, float],
) -> Document:  # fmt: skip
    pairs = list(zip(seen, visits, strict=True))
    ways = [[_mean(column) for column in columns] for columns in (
        [[(d, v.far) for d, v in pairs], [(d, v.near) for d, v in pairs]],
        [[(d, v.out[i]) for d, v in pairs if i < len(v.out)] for i in range(min(len(v.out) for v in visits))],
    )]  # fmt: skip
    body = learn([d.between(v.near, v.leaves) for d, v in pairs], options)
    return {
        "place": visits[0].place, "skill": "policy", "speed": speed, "learned": body,
        "way_in": _plain(ways[0]), "way_out": _plain(ways[1]), "touch_scatter_m": scatter,
    }  # fmt: skip


def _mean(moments: Sequence[tuple[Demonstration, float]]) -> Pose:
    """Mean pose of the tool at times [s] of demonstrations."""
    at = [(d, index_at(d, t)) for d, t in moments]
    left, _, right = np.linalg.svd(np.mean([d.pose.rotation[i] for d, i in at], axis=0))
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return Pose(np.mean([d.position[i] for d, i in at], axis=0), rotation)


def _plain(poses: Sequence[Pose]) -> list[dict[str, list[float]]]:
    return list(as_plain({str(i): pose for i, pose in enumerate(poses)}).values())


def _speed(demonstrations: Sequence[Demonstration], visits: Sequence[Sequence[Visit]]) -> float:
    """Median speed between places [m/s], within limits."""
    speeds: list[float] = []
    for d, mine in zip(demonstrations, visits, strict=True):
        path = path_of(d)
        for before, after in pairwise(mine):
            first, last = (index_at(d, t) for t in ((before.out or (before.leaves,))[-1], after.far))
            if last > first:
                length = float(norm(np.diff(path[first : last + 1], axis=0)).sum())
                speeds.append(length / float(d.time[last] - d.time[first]))
    return float(np.clip(np.median(speeds), SLOWEST, 0.25)) if speeds else SLOWEST
