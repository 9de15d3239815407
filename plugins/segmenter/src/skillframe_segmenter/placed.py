r"""Phase that is learned in the frame of a place and runs wherever the place is.

    in the place's frame:  x' = R^T (x - p),  R' = R^T R_tool,  wrench and twist rotated by R^T
    back in base:          x = R x' + p,      K = diag(R, R) K' diag(R, R)^T

with p, R the place's pose in base. Two ways in free air, also in the place's frame, surround it: the way in to before
the first touch, and the way out. Between places the tool goes straight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from skillframe.config import coerce
from skillframe.document import PLACES, read_frame, read_places
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import Pose
from skillframe.sequence import END, Composition, Part
from skillframe.skill import Skill, Status
from skillframe_segmenter.free_motion import Travel
from skillframe_segmenter.visits import BASE

OWN_KEYS = ("place", "way_in", "way_out", "speed", "skill", "learned")
IN, WORK, OUT = 0, 1, 2


class Placement(NamedTuple):
    """Place of a phase and the ways to it.

    Attributes:
        name: of the place, or `BASE`.
        pose: of the place in base, (3,), (3, 3), or a row for each trial.
        way_in, way_out: poses of the centre of compliance in the place's frame, in order.
        speed: in free air [m/s].
    """

    name: str
    pose: Pose
    way_in: list[Pose]
    way_out: list[Pose]
    speed: float


def is_placed(phase: Document) -> bool:
    """Whether a phase of a policy belongs to a place."""
    return "place" in phase


def learned_of(document: Document, index: int) -> Document:
    """The work of a placed phase as a skill document of its own.

    Raises:
        InputError: a key is missing or has a wrong value.
    """
    phase, where = document["phases"][index], f"phases[{index}]"
    kind, body = (_get(phase, key, hint, where) for key, hint in (("skill", str), ("learned", dict[str, Any])))
    frame = {**document["frame"], **{k: v for k, v in body.get("frame", {}).items() if k != "center_of_compliance"}}
    return {**body, "frame": frame, "type": kind}


def placement_of(document: Document, index: int) -> Placement:
    """Place of a phase and the ways to it.

    Raises:
        InputError: a key is missing or has a wrong value, or a place without a pose.
    """
    phase, where = document["phases"][index], f"phases[{index}]"
    name = _get(phase, "place", str, where)
    poses = read_places(document.get(PLACES, {}), PLACES)
    if name != BASE and name not in poses:
        raise InputError(
            f"{where}.place", f"is {name!r}, which has no pose in {PLACES}", "segment the demonstrations again"
        )
    center = read_frame(document).center_of_compliance
    ways = [[pose.at(center) for pose in _poses(phase, key, where)] for key in ("way_in", "way_out")]
    speed = float(_get(phase, "speed", float, where))
    if not 0.0 < speed < np.inf:
        raise InputError(f"{where}.speed", f"is {speed:g}, not a positive number", "segment the demonstrations again")
    pose = poses.get(name, Pose(np.zeros(3), np.eye(3)))
    return Placement(name, pose, ways[0], ways[1], speed)


def _poses(phase: Document, key: str, where: str) -> list[Pose]:
    rows = _get(phase, key, list[dict[str, Any]], where)
    return list(read_places({str(i): row for i, row in enumerate(rows)}, f"{where}.{key}").values())


def _get(values: Document, key: str, hint: Any, where: str) -> Any:
    if key not in values:
        raise InputError(f"{where}.{key}", "is missing", "segment the demonstrations again")
    return coerce(values[key], hint, f"{where}.{key}")


class Placed(Composition):
    """Way in, work and way out of N trials, in the frame of a place, which `Moved` brings to where the place is.

    Args:
        placement: place and ways.
        work: makes the learned skill.
    """

    def __init__(self, placement: Placement, work: Callable[[], Skill]) -> None:
        ways = [Part(name, lambda way=way: Travel(way, placement.speed)) for name, way in  # type: ignore[misc]
                (("way in", placement.way_in), ("way out", placement.way_out))]  # fmt: skip
        super().__init__([ways[0], Part("work", work), ways[1]])
        self._leaves = bool(placement.way_out)

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next of the three after a success, or the end after a failure."""
        last = OUT if self._leaves else WORK
        if status != Status.SUCCESS or part == last:
            return END, status, reason
        return part + 1, Status.RUNNING, f"begins, as the {self.parts[part].name} ended: {reason}"
