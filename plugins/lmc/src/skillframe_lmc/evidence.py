"""What a part was decided from, as it is kept in the skill file: numbers, sentences, and enough sectors to draw.

If the demonstrations leave the direction open - all of them slid the same way and the accepted set is wide - the
evidence says so, with the set's solid angle, and asks for a demonstration from the other side.
"""

from __future__ import annotations

from math import degrees, radians
from typing import TYPE_CHECKING, Any

import numpy as np

from skillframe.frames import Float, norm, unit
from skillframe_lmc.directions import Choice, choose
from skillframe_lmc.intervals import Motion
from skillframe_lmc.press import LEANING
from skillframe_lmc.sectors import sectors
from skillframe_lmc.settings import Settings

if TYPE_CHECKING:
    from skillframe_lmc.learner import Learned

OPEN_HALF_WIDTH = radians(20.0)
ONE_SIDED = 0.8  # |sum| / sum of |.| of the sideways means: 1 if all lean the same way, 0 if they balance
SIDEWAYS = 0.15  # a sideways mean below this is wandering
MOST_DRAWN = 30
ONE_WAY, CONTRADICTS = radians(10.0), radians(20.0)  # mean ways this near each other; a push this far from them all


def as_document(part: Learned, settings: Settings) -> dict[str, Any]:
    """The evidence of one part as plain JSON values."""
    choice, done = None if part.aligned or part.told is not None else part.choice, part.work
    open_direction = is_ambiguous(part)
    return {
        "held": part.held,
        "ambiguous": open_direction,
        "message": _message(part, settings, open_direction),
        "votes": None if choice is None else choice.votes,
        "pyramid_angle_rad": None if choice is None else choice.pyramid_angle,
        "feasible_solid_angle_sr": None if choice is None else choice.solid_angle,
        "feasible_half_width_rad": None if choice is None else choice.half_width,
        "work_teacher_j": 0.0 if done is None else done.teacher,
        "work_environment_j": 0.0 if done is None else done.environment,
        "work_fraction": 0.0 if done is None else done.fraction,
        "criterion": [] if part.axes is None else part.axes.criterion,
        "axes_by_faces": part.axes is not None and part.axes.by_faces,
        "mean_speed": part.speed,
        "demonstrations": [_drawable(m) for m in part.motions],
    }


def is_ambiguous(part: Learned) -> bool:
    """Whether a demonstration from the other side would narrow the direction down."""
    choice = part.choice
    if choice is None or choice.direction is None or part.aligned or choice.half_width < OPEN_HALF_WIDTH:
        return False
    sideways = part.means - (part.means @ choice.direction)[:, None] * choice.direction
    lean = norm(sideways)
    return bool(lean.max() >= SIDEWAYS and norm(sideways.sum(axis=0)) > ONE_SIDED * lean.sum())


def _message(part: Learned, settings: Settings, open_direction: bool) -> str:
    if part.held:
        return _held_message(part, settings)
    if part.aligned:
        return "the part goes straight, so the turn that was shown only aligned it; the skill gives way to such turns"
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
    """Why what was shown gives no push."""
    if part.work is not None and part.work.environment_drove:
        return f"the environment did {100.0 * _fraction(part):.0f} % of the work"
    return _direction_message(part, settings, open_direction=False)


def _press_message(part: Learned) -> str:
    """That the standing force decided, alone or together with the way to it."""
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
        return _no_direction_message(part, choice, settings)
    if open_direction:
        who = "one demonstration leaves" if len(part.moving) == 1 else "demonstrations from one side leave"
        return (
            f"{who} the direction open: any {_push(part)} within {choice.solid_angle:.2f} sr, up to "
            f"{degrees(choice.half_width):.0f} degrees to either side, explains what was seen; record another "
            "demonstration from the other side"
        )
    return _contradiction(part, choice.direction)


def _contradiction(part: Learned, direction: Float) -> str:
    """A doubt where two or more demonstrations all went one way and the push is another."""
    ways = unit(part.means)
    mean = unit(ways.mean(axis=0))
    apart, off = (np.arccos(np.clip(x, -1.0, 1.0)) for x in ((ways @ mean).min(), float(direction @ mean)))
    if len(ways) < 2 or apart > ONE_WAY or off < CONTRADICTS:
        return ""
    return (
        f"doubtful: all demonstrations went one way, within {degrees(apart):.0f} degrees, and the {_push(part)} is "
        f"{degrees(off):.0f} degrees off it; look whether the wrench holds a force in the air (skillframe "
        "demonstration check), or record a demonstration from the other side"
    )


def _no_direction_message(part: Learned, choice: Choice, settings: Settings) -> str:
    """Why there is no direction: the demonstrations disagree, or each by itself bends too much."""
    angle, allowed = degrees(choice.pyramid_angle), degrees(settings.pyramid_max_rad)
    digits = 1 if round(angle) == round(allowed) else 0  # 25.3 and not 25 degrees, where 25 are allowed
    taken = f"{angle:.{digits}f} degrees" if angle < 90.0 else "more than 90 degrees"
    text = (
        f"no one {_push(part)} explains what was seen: the hand would have been off by {taken}, and {allowed:.0f} "
        "are allowed"
    )
    if not any(given.contact.any() for given in part.given):
        text += "; nothing was touched, so it is an assumption that the axes left free are the environment's doing"
    if all(choose([given], settings).direction is None for given in part.given):
        return f"{text}; not even one demonstration alone is a single linear motion, so cut it into phases"
    return text


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


def _drawable(motion: Motion) -> dict[str, Any]:
    """At most 30 of the sectors, evenly spread, and the demonstration's numbers."""
    every = sectors(motion)
    chosen = np.unique(np.linspace(0, max(len(every.contact) - 1, 0), MOST_DRAWN).round().astype(int))
    chosen = chosen[: len(every.contact)]
    mean = unit(motion.displacement).mean(axis=0) if len(motion.displacement) else np.zeros(3)
    return {
        "excursion": motion.excursion,
        "path": motion.path,
        "intervals": len(every.contact),
        "work_teacher_j": float(np.abs(motion.work[motion.work < 0.0]).sum()),
        "work_environment_j": float(motion.work[motion.work > 0.0].sum()),
        "mean_direction": _rounded(mean),
        "motion": _rounded(every.motion[chosen]),
        "push": _rounded(every.push[chosen]),
        "contact": every.contact[chosen].tolist(),
    }


def _rounded(values: Float) -> list[Any]:
    result: list[Any] = (np.round(values, 4) + 0.0).tolist()
    return result
