r"""A phase that belongs to a place: it is learned in the place's frame, and runs wherever the place is now.

    in the place's frame:  x' = R^T (x - p),  R' = R^T R_tool,  wrench and twist rotated by R^T
    back in base:          x = R x' + p,      K = diag(R, R) K' diag(R, R)^T

with p, R the place's pose in base. Around what was learned there are two ways in free air, both poses of the place's
frame: the way in to before the first touch, and the way out. Between two places the tool goes straight from the one's
way out to the other's way in, so that nothing of a phase is tied to base. Ours; the papers have one object.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.config import coerce
from skillframe.demonstration.places import KEY, read_places
from skillframe.document.frame import read_frame
from skillframe.errors import InputError
from skillframe.extend.records import Document
from skillframe.frames import Float, Pose, rotate, rotate_spatial
from skillframe.sequence import END, Composition, Part
from skillframe.skill import Command, Impedance, Observation, Skill, Status
from skillframe_segmenter.travel import Travel
from skillframe_segmenter.visits import BASE

OWN_KEYS = ("place", "way_in", "way_out", "speed", "skill", "learned")
IN, WORK, OUT = 0, 1, 2


class Placement(NamedTuple):
    """Where a phase runs and how it gets there.

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
    """What a placed phase does at its place, as a skill document of its own.

    Raises:
        InputError: a key is missing or holds the wrong thing.
    """
    phase, where = document["phases"][index], f"phases[{index}]"
    kind, body = (_get(phase, key, hint, where) for key, hint in (("skill", str), ("learned", dict[str, Any])))
    frame = {**document["frame"], **{k: v for k, v in body.get("frame", {}).items() if k != "center_of_compliance"}}
    return {**body, "frame": frame, "type": kind}


def placement_of(document: Document, index: int) -> Placement:
    """Where a placed phase runs.

    Raises:
        InputError: a key is missing or holds the wrong thing, or a place without a pose.
    """
    phase, where = document["phases"][index], f"phases[{index}]"
    name = _get(phase, "place", str, where)
    poses = read_places(document.get(KEY, {}), KEY)
    if name != BASE and name not in poses:
        raise InputError(
            f"{where}.place", f"is {name!r}, which has no pose in {KEY}", "segment the demonstrations again"
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
    """The way in, the work and the way out of N trials, all in the frame of a place.

    Args:
        placement: where, and by which ways.
        work: makes the skill that was learned there.
    """

    def __init__(self, placement: Placement, work: Callable[[], Skill]) -> None:
        ways = [Part(name, lambda way=way: Travel(way, placement.speed)) for name, way in  # type: ignore[misc]
                (("way in", placement.way_in), ("way out", placement.way_out))]  # fmt: skip
        super().__init__([ways[0], Part("work", work), ways[1]])
        self._pose, self._leaves = placement.pose, bool(placement.way_out)

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next of the three after a success. The first failure is the whole's."""
        last = OUT if self._leaves else WORK
        if status != Status.SUCCESS or part == last:
            return END, status, reason
        return part + 1, Status.RUNNING, f"begins, as the {self.parts[part].name} ended: {reason}"

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin with the way in."""
        super().start(self._seen(observation), rngs)

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Begin again with the way in, in some trials."""
        for row, rng in zip(rows.tolist(), rngs, strict=True):
            self._rngs[row] = rng.spawn(len(self.parts))
            self._status[row], self._reason[row] = Status.RUNNING, ""
            self.switch(row, IN, float(observation.time[row]), "begins")

    def step(self, observation: Observation) -> Command:
        """Let the part answer in the place's frame, and turn its answer back into base."""
        command = super().step(self._seen(observation))
        turn = self._pose.rotation
        pose = self._pose.compose(command.pose)
        impedance = Impedance(*(None if m is None else _turned(m, turn) for m in command.impedance))  # type: ignore[arg-type]
        return command._replace(
            pose=pose, twist=rotate_spatial(turn, command.twist), impedance=impedance,
            feedforward=rotate_spatial(turn, command.feedforward),
        )  # fmt: skip

    def _seen(self, observation: Observation) -> Observation:
        back = np.swapaxes(self._pose.rotation, -1, -2)
        pose = Pose(rotate(back, observation.pose.position - self._pose.position), back @ observation.pose.rotation)
        return observation._replace(
            pose=pose, twist=rotate_spatial(back, observation.twist), wrench=rotate_spatial(back, observation.wrench)
        )


def _turned(matrix: Float, turn: Float) -> Float:
    """Matrices (..., 6, 6) of the place's axes in base axes."""
    both = np.zeros((*turn.shape[:-2], 6, 6))
    both[..., :3, :3] = both[..., 3:, 3:] = turn
    result: Float = both @ matrix @ np.swapaxes(both, -1, -2)
    return 0.5 * (result + np.swapaxes(result, -1, -2))
