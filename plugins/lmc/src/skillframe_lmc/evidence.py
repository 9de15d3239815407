"""What was decided about a part, and its evidence in the skill file: numbers, sentences, and sectors to draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians
from typing import Any, Literal

import numpy as np

from skillframe.frames import Float, norm, unit
from skillframe_lmc.axes import CompliantAxes
from skillframe_lmc.directions import MOST_PYRAMID
from skillframe_lmc.intervals import Motion
from skillframe_lmc.pieces import Pieces, some, whole_witness
from skillframe_lmc.posterior import PUSH_EXISTS, TURN_EXISTS, Choice, witnesses
from skillframe_lmc.press import LEANING, Press
from skillframe_lmc.settings import Settings
from skillframe_lmc.work import Work

Name = Literal["translation", "rotation"]
OPEN_HALF_WIDTH = radians(20.0)
ONE_WAY = radians(20.0)  # rms angle of sliding to its mean; a floor and a ramp have 25
SIDEWAYS = 0.15  # a smaller sideways mean is wandering
MOST_DRAWN = 30
NO_TORQUE = "no torque was measured, so the turn is that of the motion, whoever turned the tool"
NOT_ONE_MOTION = "not even one demonstration alone is a single linear motion"


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """Decisions about one part, and their data.

    Attributes:
        name: "translation" or "rotation".
        motions: all demonstrations.
        moving: those that moved this part.
        pieces: of those; None if held.
        work: who moved it; None if held.
        choice: the push, if the teacher drove it.
        axes: compliant axes; None if held or fully compliant.
        means: (n, 3) mean directions of those that moved.
        speed: mean demonstrated speed, without pauses [m/s or rad/s].
        pressed: standing force of each demonstration, where it decided.
        press_off: angle of the standing force to the push, where it contradicts the push [rad]; 0 otherwise.
        told: (3,) given direction, where the demonstrations show none.
        aligned: a demonstrated push only aligned a part that is known to go straight.
        measured: whether the turning load was measured.
        one_motion: false if not even one demonstration alone has a push.
    """

    name: Name
    motions: Sequence[Motion]
    moving: Sequence[Motion]
    pieces: Pieces | None
    work: Work | None
    choice: Choice | None
    axes: CompliantAxes | None
    means: Float
    speed: float
    pressed: Sequence[Press] = ()
    press_off: float = 0.0
    told: Float | None = None
    aligned: bool = False
    measured: bool = True
    one_motion: bool = True

    @property
    def held(self) -> bool:
        """Whether the part did not move."""
        return not self.moving

    @property
    def fully_compliant(self) -> bool:
        """Whether the environment moved it and no direction was given."""
        return self.told is None and self.work is not None and self.work.environment_drove

    @property
    def direction(self) -> Float | None:
        """Desired direction, if it exists."""
        shown = None if self.choice is None or self.aligned else self.choice.direction
        return self.told if shown is None else shown


def as_document(part: Learned, settings: Settings) -> dict[str, Any]:
    """Evidence of one part as JSON values."""
    choice, done = None if part.aligned or part.told is not None else part.choice, part.work
    whole = whole_witness(part.name, settings)
    open_direction = is_ambiguous(part, whole)
    return {
        "held": part.held,
        "ambiguous": open_direction,
        "message": _message(part, settings, open_direction),
        "explained": None if choice is None else choice.explained,
        "pyramid_angle_rad": None if choice is None else choice.pyramid_angle,
        "feasible_solid_angle_sr": None if choice is None else choice.solid_angle,
        "feasible_half_width_rad": None if choice is None else choice.half_width,
        "work_teacher_j": 0.0 if done is None else done.teacher,
        "work_environment_j": 0.0 if done is None else done.environment,
        "work_fraction": 0.0 if done is None else done.fraction,
        "criterion": [] if part.axes is None else part.axes.criterion,
        "other_side": _rounded(_other_side(part)) if open_direction else None,
        "mean_speed": part.speed,
        "whole": whole,
        "demonstrations": [_drawable(part, m) for m in part.motions],
    }


def is_ambiguous(part: Learned, whole: float) -> bool:
    """Whether a demonstration from the other side would narrow the direction down: all slid one way, to one side.

    On a hump all lean one way too, but slide several: a demonstration from another side would add nothing.
    """
    choice = part.choice
    if choice is None or choice.direction is None or part.aligned or choice.half_width < OPEN_HALF_WIDTH:
        return False
    if part.pieces is None or not part.pieces.contact.any():
        return False
    seen = witnesses(some(part.pieces, part.pieces.contact), whole)
    apart = np.arccos(np.clip(seen.pieces.motion @ unit(seen.weight @ seen.pieces.motion), -1.0, 1.0))
    spread = float(np.sqrt(seen.weight @ apart**2 / seen.weight.sum()))
    return spread <= ONE_WAY and float(norm(_sideways(part, choice.direction))) >= SIDEWAYS


def _sideways(part: Learned, direction: Float) -> Float:
    """Mean motion (3,) in contact across a push."""
    assert part.pieces is not None
    touched = some(part.pieces, part.pieces.contact)
    mean: Float = touched.length @ touched.motion / touched.length.sum()
    return mean - (mean @ direction) * direction


def _other_side(part: Learned) -> Float:
    """Unit vector (3,) across the push, along which a demonstration from the other side would move."""
    assert part.direction is not None
    return -unit(_sideways(part, part.direction))


def _message(part: Learned, settings: Settings, open_direction: bool) -> str:
    if part.held:
        return _held_message(part, settings)
    if part.aligned:
        return (
            "the part goes straight, so the turn that was shown only aligned it; the skill is compliant to such turns"
        )
    if not part.measured and part.direction is not None:
        return NO_TORQUE
    if part.told is not None:
        why = _untold(part, settings)
        return f"doubtful: the push is that along the way that was given, and not learned, because {why}"
    share = f"the environment did {100.0 * _fraction(part):.0f} % of the work"
    if part.fully_compliant:
        return f"{share}, so it is left free in all directions"
    if _fraction(part) > 0.5:
        share += ", no more than chance makes of even shares, so it is not left free in all directions"
        return "; ".join(filter(None, [share, _direction_message(part, settings, open_direction)]))
    return _direction_message(part, settings, open_direction)


def _untold(part: Learned, settings: Settings) -> str:
    if part.work is not None and part.work.environment_drove:
        return f"the environment did {100.0 * _fraction(part):.0f} % of the work"
    return _direction_message(part, settings, open_direction=False)


def _press_message(part: Learned) -> str:
    force, seconds = np.median([p.force for p in part.pressed]), np.median([p.seconds for p in part.pressed])
    if all(p.in_air for p in part.pressed):
        share = np.mean([LEANING**2 / (LEANING**2 + p.error**2) for p in part.pressed])
        return (
            f"nothing was met on the way, so the push is that of the way ({100.0 * share:.0f} % of the weight) and of "
            f"the {force:.0f} N under which the tool stood for {seconds:.1f} s"
        )
    return (
        f"the way there gives no direction: the push is that of the {force:.0f} N under which the tool stood for "
        f"{seconds:.1f} s"
    )


def _direction_message(part: Learned, settings: Settings, open_direction: bool) -> str:
    choice = part.choice
    if part.pressed:
        return _press_message(part)
    if choice is None:
        return "too few intervals in which the teacher did the work to find a direction"
    if choice.direction is None:
        return _no_direction_message(part, choice)
    if part.press_off:
        return (
            f"doubtful: at the end the tool was pressed {degrees(part.press_off):.0f} degrees off this push; on the "
            "way the hand may have pushed aside"
        )
    if open_direction:
        who = "one demonstration leaves" if len(part.moving) == 1 else "demonstrations from one side leave"
        return (
            f"{who} the direction open: any {_push(part)} within {choice.solid_angle:.2f} sr, up to "
            f"{degrees(choice.half_width):.0f} degrees to either side, explains what was seen; record another "
            "demonstration from the other side"
        )
    return ""


def _no_direction_message(part: Learned, choice: Choice) -> str:
    """Reason: the demonstrations disagree, or each bends too much."""
    text = f"no one {_push(part)} explains what was seen: "
    if choice.pyramid_angle is None:
        least = PUSH_EXISTS if part.name == "translation" else TURN_EXISTS
        text += f"the best explains {100.0 * choice.explained:.0f} % of it, and {100.0 * least:.0f} % are needed"
    else:
        text += (
            f"the hand would have been off by {degrees(choice.pyramid_angle):.1f} degrees, and "
            f"{degrees(MOST_PYRAMID):.0f} are allowed"
        )
    if part.pieces is not None and not part.pieces.contact.any():
        text += "; nothing was touched, so it is an assumption that the axes left free are the environment's doing"
    return text if part.one_motion else f"{text}; {NOT_ONE_MOTION}"


def _fraction(part: Learned) -> float:
    return 0.0 if part.work is None else part.work.fraction


def _push(part: Learned) -> str:
    return "push" if part.name == "translation" else "turning push"


def _held_message(part: Learned, settings: Settings) -> str:
    most = max(m.excursion for m in part.motions)
    if most >= (settings.moving_m if part.name == "translation" else settings.moving_rad):
        return "touched nothing while it moved, and only contact counts (--set contact_only=...), so it is held"
    if part.name == "translation":
        moved, least, key = f"{1e3 * most:.1f} mm", f"{1e3 * settings.moving_m:.3g} mm", "moving_m"
    else:
        moved, least, key = f"{degrees(most):.1f} degrees", f"{degrees(settings.moving_rad):.3g} degrees", "moving_rad"
    return f"moved {moved} at most, less than the {least} that count as a motion (--set {key}=...), so it is held"


def _drawable(part: Learned, motion: Motion) -> dict[str, Any]:
    """At most 30 pieces, evenly spread, each as long as those that it stands for, and the demonstration's numbers."""
    number = next((i for i, each in enumerate(part.moving) if each is motion), None)
    mean = unit(motion.displacement).mean(axis=0) if len(motion.displacement) else np.zeros(3)
    told = {
        "excursion": motion.excursion,
        "path": motion.path,
        "intervals": len(motion.work),
        "work_teacher_j": float(np.abs(motion.work[motion.work < 0.0]).sum()),
        "work_environment_j": float(motion.work[motion.work > 0.0].sum()),
        "mean_direction": _rounded(mean),
    }
    if number is None or part.pieces is None:
        return {**told, "motion": [], "push": [], "edge": [], "contact": [], "length": [], "turning": []}
    every = some(part.pieces, part.pieces.demonstration == number)
    chosen = np.unique(np.linspace(0, max(len(every.contact) - 1, 0), MOST_DRAWN).round().astype(int))
    chosen = chosen[: len(every.contact)]
    stands_for = every.length.sum() / max(every.length[chosen].sum(), 1e-12)
    return {
        **told,
        "motion": _rounded(every.motion[chosen]),
        "push": _rounded(every.push[chosen]),
        "edge": _rounded(every.edge[chosen]),
        "contact": every.contact[chosen].tolist(),
        "length": np.round(every.length[chosen] * stands_for, 5).tolist(),
        "turning": np.round(every.turning[chosen], 3).tolist(),
    }


def _rounded(values: Float) -> list[Any]:
    result: list[Any] = (np.round(values, 4) + 0.0).tolist()
    return result
