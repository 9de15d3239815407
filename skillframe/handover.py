"""The interface between loop and skill: read-only observations, and checked commands.

A skill gets read-only copies, so that it cannot change what limits, controller and recorder read. Its commands are
checked before use:

- a wrong type or shape is a defect of the skill: `SkillframeError` with the field;
- an invalid row ends its trial with a reason: an invalid rotation, a stiffness that is not symmetric and positive
  semi-definite, a damping that adds energy, an unknown status, a reason that is no text. Values that are not finite
  make the controller's output not finite, which the limits end as diverged.

Rotations are checked in every tick unless the same array comes again; an impedance, built once per phase, is checked
when another array comes. Changes in place are found within `SLOW_TICKS`, and a mirroring rotation within 100 ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Impedance, Observation, Skill, Status

SLOW_TICKS = 10
"""Ticks between checks of goals and of slow changes: 10 ms at 1 kHz."""
ROTATION_SLACK = 1e-3
"""Largest entry of R^T R - 1: far above the rounding of an hour's products, or of single precision."""
Answer = TypeVar("Answer")  #: what a method of a skill returns
_EYE = np.eye(3)


class Fault(NamedTuple):
    """A trial with an invalid command, and the reason in words."""

    row: int
    cause: str


def unknown_end(status: int, reason: object) -> str:
    """What is wrong with the end of a trial, or ""."""
    if status not in (Status.SUCCESS, Status.FAILURE):
        return f"the skill's status is {status}, which is none of 0 (running), 1 (success) and 2 (failure)"
    return "" if isinstance(reason, str) else f"the skill's reason is {reason!r:.40}, and no text"


def shown(observation: Observation) -> Observation:
    """Read-only copies of an observation."""
    time, dt, (position, rotation), twist, wrench = observation
    time, position, rotation, twist, wrench = time.copy(), position.copy(), rotation.copy(), twist.copy(), wrench.copy()
    for array in (time, position, rotation, twist, wrench):
        array.setflags(write=False)
    return Observation(time, dt, Pose(position, rotation), twist, wrench)


def asked(skill: Skill, method: Callable[..., Answer], *arguments: Any) -> Answer:
    """The result of a skill's `start` or `step`.

    Raises:
        SkillframeError: the skill writes into its observation.
    """
    try:
        return method(*arguments)
    except ValueError as error:
        if "read-only" not in str(error):
            raise
        raise SkillframeError(
            f"skill {type(skill).__name__} writes into its observation, which is not its own; copy what it changes"
        ) from error


def check_shapes(skill: Skill, command: Command, lead: tuple[int, ...]) -> None:
    """Refuse a command that does not fit the batch.

    Args:
        skill: its source, for messages.
        command: as returned.
        lead: (N,), or (N, arms).

    Raises:
        SkillframeError: a field is missing, is no array of numbers, or is of another batch.
    """
    name = type(skill).__name__
    if not isinstance(command, Command):
        raise SkillframeError(f"skill {name} hands back {_kind(command)}; a step answers with a Command")
    if not isinstance(command.pose, Pose) or not isinstance(command.impedance, Impedance):
        raise SkillframeError(f"skill {name}: the command's pose is a Pose, and its impedance an Impedance")
    for field, value, shape, kinds in _fields(command, lead):
        if not isinstance(value, np.ndarray) or value.dtype.kind not in kinds:
            what = {"OU": "strings", "iu": "integers"}.get(kinds, "numbers")
            raise SkillframeError(f"skill {name}: {field} is {_kind(value)}; give an array of {what}")
        if value.shape != shape:
            raise SkillframeError(f"skill {name}: {field} has the shape {value.shape}, and not {shape}")
    _check_gains(name, command.impedance, lead)


def _fields(command: Command, lead: tuple[int, ...]) -> list[tuple[str, Any, tuple[int, ...], str]]:
    n = lead[:1]
    return [
        ("pose.position", command.pose.position, (*lead, 3), "fiu"),
        ("pose.rotation", command.pose.rotation, (*lead, 3, 3), "fiu"),
        ("twist", command.twist, (*lead, 6), "fiu"),
        ("feedforward", command.feedforward, (*lead, 6), "fiu"),
        ("status", command.status, n, "iu"),
        ("reason", command.reason, n, "OU"),
    ]


def _check_gains(name: str, impedance: Impedance, lead: tuple[int, ...]) -> None:
    known = [(*lead[k:], 6, 6) for k in range(len(lead) + 1)]
    for field, gain in zip(Impedance._fields, impedance, strict=True):
        if gain is None and field == "damping":
            continue
        if not isinstance(gain, np.ndarray) or gain.dtype.kind not in "fiu":
            raise SkillframeError(f"skill {name}: impedance.{field} is {_kind(gain)}; give an array of numbers")
        if gain.shape not in known:
            wanted = " or ".join(map(str, known))
            raise SkillframeError(f"skill {name}: impedance.{field} has the shape {gain.shape}, and not {wanted}")


def _kind(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}"
    return "nothing" if value is None else f"a {type(value).__name__}"


class ShapeCheck:
    """Checks the shapes of a skill's commands, and everything of `check_shapes` if one is off.

    Args:
        skill: whose commands.
        lead: (N,), or (N, arms).
    """

    def __init__(self, skill: Skill, lead: tuple[int, ...]) -> None:
        self.skill, self.lead, self._fine = skill, lead, False
        n = lead[:1]
        self._shapes = (*lead, 3), (*lead, 3, 3), (*lead, 6), (*lead, 6), n, n

    def __call__(self, command: Command) -> Command:
        """Check and return a command.

        Raises:
            SkillframeError: as `check_shapes`.
        """
        try:
            (position, rotation), twist, _, feedforward, status, reason = command
            shapes = position.shape, rotation.shape, twist.shape, feedforward.shape, status.shape, reason.shape
        except (AttributeError, TypeError, ValueError):
            shapes = None
        if shapes != self._shapes or not self._fine:
            check_shapes(self.skill, command, self.lead)
            self._fine = True
        return command


class CommandCheck:
    """Checks the commands of one batch.

    Args:
        skill: whose commands.
        lead: (N,), or (N, arms).
    """

    def __init__(self, skill: Skill, lead: tuple[int, ...]) -> None:
        self._skill, self._lead, self._shapes = skill, lead, ShapeCheck(skill, lead)
        self._rotation: Float | None = None
        self._gains: Impedance | None = None
        self._values: list[Float | None] = [None, None]

    def faults(self, command: Command, tick: int) -> list[Fault]:
        """Trials with an invalid command. The loop ignores those that have ended.

        Raises:
            SkillframeError: as `check_shapes`.
        """
        slow, rare, faults = tick % SLOW_TICKS == 0, tick % 100 == 0, []  # rare: dtypes, and mirroring rotations
        if rare:
            check_shapes(self._skill, command, self._lead)
        rotation, (stiffness, damping) = self._shapes(command).pose.rotation, command.impedance
        if slow or rotation is not self._rotation:
            self._rotation = rotation
            near = np.abs(rotation.mT @ rotation - _EYE) <= ROTATION_SLACK
            if np.count_nonzero(near) != near.size or (rare and not (np.linalg.det(rotation) > 0.0).all()):
                rows = rotation.reshape(self._lead[0], -1, 3, 3)
                off: Float = np.abs(rows.mT @ rows - _EYE).max(axis=(-1, -2))
                volume = np.linalg.det(rows)
                bad: NDArray[np.bool_] = np.isfinite(off) & ((off > ROTATION_SLACK) | (volume < 0.0))
                worst = np.argmax(bad, axis=-1)
                text = "the skill's rotation is none: R^T R differs from 1 by {:.2g}, its determinant is {:.2g}"
                faults += [
                    Fault(int(i), text.format(off[i, worst[i]], volume[i, worst[i]]))
                    for i in np.flatnonzero(np.any(bad, axis=-1))
                ]
        if slow or self._gains is None or stiffness is not self._gains[0] or damping is not self._gains[1]:
            faults += self._springs(command.impedance)
        return faults

    def _springs(self, impedance: Impedance) -> list[Fault]:
        """Rows with finite but invalid stiffness or damping."""
        gains, self._gains = self._gains, impedance
        if gains is None or impedance[0] is not gains[0] or impedance[1] is not gains[1]:
            _check_gains(type(self._skill).__name__, impedance, self._lead)
        faults = []
        for k, (field, gain) in enumerate(zip(Impedance._fields, impedance, strict=True)):
            last = self._values[k]
            if gain is None or (last is not None and last.shape == gain.shape and not np.count_nonzero(last != gain)):
                continue
            self._values[k] = gain.copy()
            bad: NDArray[np.bool_] = np.broadcast_to(_impossible(gain, symmetric=field == "stiffness"), self._lead)
            rows = np.any(bad.reshape(self._lead[0], -1), axis=-1)
            faults += [Fault(int(i), f"the skill's {field} {_WRONG[field]}") for i in np.flatnonzero(rows)]
        return faults


_WRONG = {
    "stiffness": "is not symmetric and positive semi-definite: it would push away from where it wants to be",
    "damping": "is not positive semi-definite: it would feed energy in",
}


def _impossible(gain: Float, symmetric: bool) -> Any:
    """Which matrices (..., 6, 6) are finite, and not symmetric or with a negative eigenvalue."""
    finite = np.asarray(np.isfinite(gain).all(axis=(-1, -2)))
    sound = np.where(finite[..., None, None], gain, 0.0)
    slack = 1e-6 * np.abs(sound).max(axis=(-1, -2)) + 1e-12  # relative to the largest entry
    even = 0.5 * (sound + sound.mT)
    odd = (np.abs(sound - even).max(axis=(-1, -2)) > slack) & symmetric
    try:
        np.linalg.cholesky(even + slack[..., None, None] * np.eye(6))
    except np.linalg.LinAlgError:
        return finite & (odd | (np.linalg.eigvalsh(even)[..., 0] < -slack))
    return finite & odd
