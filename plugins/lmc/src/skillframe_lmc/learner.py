r"""The flow of learning (Fig. 6 of the overview paper).

First the pitch, then for translation and rotation alike

    moved at all?      no: stiff
    who moved it?      W = F_m . dx, or T_m . dbeta at the grip                     (3)        [work]
                       the environment, if W > 0 prevails: three compliant degrees of freedom
    where to push?     the middle of what the pieces of all demonstrations believe; may not exist [pieces, posterior]
                       with `concatenated`, the intersection of pyramids               [sectors, directions]
                       without one, the given way (`LearnOptions.toward`)
                       no turn, if the part is known to go straight (`LearnOptions.straight`)
    where compliant?   principal axes of the motion that the push does not explain              [axes]
    how stiff?         zero along compliant axes, k elsewhere, soft across a push                 [gains]

If both directions exist, the pitch couples their speeds, lambda = nu / p. The torque's work and sectors are taken at
the grip, where the teacher's torque is free of the lever arm of the force. The push is learned where the tool touches:
at the point named tip, unless another was given. Axes belong to the learning point, which the skill steers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import radians
from typing import NamedTuple

import numpy as np

from skillframe.config import build
from skillframe.demonstration import Demonstration, measures_torque
from skillframe.document import frame_of
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, norm, unit
from skillframe_lmc import evidence, intervals
from skillframe_lmc.axes import TURNED, compliant_axes, straightness
from skillframe_lmc.directions import choose
from skillframe_lmc.evidence import Learned, Name
from skillframe_lmc.gains import ROTATION, TRANSLATION, Nominal, gains
from skillframe_lmc.intervals import Motion, Track
from skillframe_lmc.phase import Stop
from skillframe_lmc.pieces import Pieces, pushed, some, turned, until_left, whole_witness
from skillframe_lmc.posterior import PUSH_EXISTS, TURN_EXISTS, Choice, decide, witnesses
from skillframe_lmc.press import Press, contradiction, presses
from skillframe_lmc.sectors import concatenated, sectors
from skillframe_lmc.settings import LEVER_M, Settings
from skillframe_lmc.work import Work, work

FEWEST_PIECES = 3  # of a demonstration; fewer have no meaningful direction


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a skill document (`frame`, `phases`, `settings`) from demonstrations of one phase.

    Raises:
        InputError: no demonstration, tools that differ, values that are not finite, or an unknown setting.
        UnknownName: a point's name that the demonstrations do not know, or unknown axes.
    """
    settings = build(Settings, options.settings, "--set")
    frame = frame_of(demonstrations, options)
    at, hand = np.array(frame["learned_at"]), np.array(frame["work_at"])
    touch = at if options.at is not None else np.array(frame["frames"].get("tip", at))
    tracks = [intervals.track(d, at, hand, options.axes) for d in demonstrations]
    rotation = _rotation(tracks, settings, options.straight, all(measures_torque(d.meta) for d in demonstrations))
    touching = [intervals.at_point(track, touch - at, hand - touch) for track in tracks]
    toward = None if options.toward is None else unit(np.array(options.toward))
    translation = _translation(tracks, touching, settings, rotation, toward)
    return {
        "frame": frame,
        "phases": [_phase(translation, rotation, settings)],
        "settings": asdict(settings),
    }


def _rotation(tracks: Sequence[Track], settings: Settings, straight: bool, measured: bool) -> Learned:
    motions = _cut([intervals.rotation(track, settings) for track in tracks], settings)
    which = _moving(motions, settings.moving_rad)
    moving = [motions[i] for i in which]
    shown = turned([tracks[i] for i in which], moving, settings) if moving else None
    done, choice, axes = work(moving) if moving else None, None, None
    if done is not None and not done.environment_drove:
        choice = _choice("rotation", moving, shown, settings)
    aligned = straight and choice is not None and choice.direction is not None
    if done is not None and not done.environment_drove:
        direction = None if choice is None or aligned else choice.direction
        axes = compliant_axes(_means(moving), direction, TURNED)
    return Learned(
        name="rotation", motions=motions, moving=moving, pieces=shown, work=done, choice=choice, axes=axes,
        means=_means(moving), speed=_speed(moving), aligned=aligned, measured=measured,
        one_motion=_one_motion("rotation", moving, shown, choice, settings),
    )  # fmt: skip


def _translation(
    tracks: Sequence[Track], touching: Sequence[Track], settings: Settings, rotation: Learned, toward: Float | None
) -> Learned:
    motions = _cut([intervals.translation(track, settings) for track in tracks], settings)
    which = _moving(motions, settings.moving_m)
    moving, means = [motions[i] for i in which], _means([motions[i] for i in which])
    shown, done, choice, axes = None, None, None, None
    if moving:
        turned_too = rotation.direction is not None
        shown, done = pushed([touching[i] for i in which], moving, settings, turned_too=turned_too), work(moving)
        choice = None if done.environment_drove else _choice("translation", moving, shown, settings)
    found = presses(tracks, motions) if len(moving) == len(motions) else None
    stood = None if found is None else _standing(found, choice)
    if stood is not None:
        done, choice = stood.work, stood.choice
    direction = None if choice is None else choice.direction
    told = toward if done is not None and direction is None else None
    direction = direction if told is None else told
    if done is not None and (told is not None or not done.environment_drove):
        sigma = straightness(float(np.mean([m.path for m in moving])), means)
        axes = compliant_axes(means if stood is None else stood.means(settings.moving_m), direction, sigma)
        if rotation.axes is not None and direction is not None and len(axes.axes) == len(rotation.axes.axes) == 1:
            axes = axes.square_to(rotation.axes.axes[0], direction)
    return Learned(
        name="translation", motions=motions, moving=moving, pieces=shown, work=done, choice=choice, axes=axes,
        means=means, speed=_speed(moving), pressed=() if stood is None else stood.presses, told=told,
        press_off=0.0 if found is None or stood is not None else contradiction(found, choice),
        one_motion=_one_motion("translation", moving, shown, choice, settings),
    )  # fmt: skip


def _cut(motions: list[Motion], settings: Settings) -> list[Motion]:
    return [intervals.touching(motion) for motion in motions] if settings.contact_only else motions


def _moving(motions: Sequence[Motion], least: float) -> list[int]:
    return [i for i, m in enumerate(motions) if m.excursion >= least and len(m.displacement)]


def _choice(name: Name, moving: Sequence[Motion], shown: Pieces | None, settings: Settings) -> Choice | None:
    """Push of demonstrations that the teacher drove, or None where one has too few pieces.

    How a tool leaves is no part of the task: where no push explains everything, the pieces until the last contact
    decide, then contact alone, as a tool springs back that is let go.
    """
    if settings.concatenated:
        given = [sectors(m, teacher_driven_only=name == "rotation") for m in moving]
        enough = all(len(g.contact) >= min(FEWEST_PIECES, len(m.work)) for g, m in zip(given, moving, strict=True))
        return choose([concatenated(given)]) if enough else None
    if shown is None:
        return None
    if name == "rotation":
        return _decided(name, shown, len(moving), TURN_EXISTS, settings)
    found = _decided(name, shown, len(moving), PUSH_EXISTS, settings)
    for part in (until_left(shown), some(shown, shown.contact)):
        if found is not None and found.direction is None:
            again = _decided(name, part, len(moving), PUSH_EXISTS, settings)
            found = again if again is not None and again.direction is not None else found
    return found


def _decided(name: Name, shown: Pieces, count: int, exists: float, settings: Settings) -> Choice | None:
    if np.bincount(shown.demonstration, minlength=count).min() < FEWEST_PIECES:
        return None
    return decide(witnesses(shown, whole_witness(name, settings)), exists)


def _one_motion(
    name: Name, moving: Sequence[Motion], shown: Pieces | None, choice: Choice | None, settings: Settings
) -> bool:
    """Whether all demonstrations have a push, or else one of them alone has."""
    if choice is None or choice.direction is not None or shown is None:
        return True
    numbered = shown._replace(demonstration=np.zeros_like(shown.demonstration))
    for i, motion in enumerate(moving):
        alone = _choice(name, [motion], some(numbered, shown.demonstration == i), settings)
        if alone is not None and alone.direction is not None:
            return True
    return False


def _means(motions: Sequence[Motion]) -> Float:
    """Mean unit direction of motion (n, 3) of each."""
    return np.array([unit(m.displacement).mean(axis=0) for m in motions]).reshape(-1, 3)


def _speed(motions: Sequence[Motion]) -> float:
    time = sum(m.duration for m in motions)
    return sum(m.path for m in motions) / time if time > 0.0 else 0.0


class _Standing(NamedTuple):
    """Decision by standing force: see `press`."""

    presses: list[Press]
    work: Work
    choice: Choice

    def means(self, least: float) -> Float:
        """Mean directions (n, 3) of motions in contact of at least `least` [m]."""
        touched = [p.motion.displacement for p in self.presses]
        return np.array([unit(d).mean(axis=0) for d in touched if norm(d).sum() >= least]).reshape(-1, 3)


def _standing(found: list[Press], moved: Choice | None) -> _Standing | None:
    """Result of the standing force of all demonstrations, or None where the motion (`moved`) decides.

    It is used where the motion gives no direction, or met nothing on the way.

    Raises:
        InputError: no push explains demonstrations that were pressed along their way; the skill would be compliant
            along its only motion.
    """
    in_air = all(p.in_air for p in found)
    done = work([p.motion for p in found])
    if done.environment_drove or not (in_air or moved is None or moved.direction is None):
        return None
    choice = choose([p.sectors for p in found])
    if choice.direction is None:
        force, off = np.median([p.force for p in found]), np.degrees(choice.pyramid_angle or 0.0)
        raise InputError(
            "learn", f"the tool was pressed with {force:.0f} N where it stood, along the way it had come, and no one "
            f"push explains it (the hand would have been off by {off:.0f} degrees)",
            "cut the recordings into phases (skillframe segment), or demonstrate the press the same way each time",
        )  # fmt: skip
    if in_air:
        choice = choice._replace(direction=unit(np.mean([p.push for p in found], axis=0)))
    return _Standing(found, done, choice)


def _phase(translation: Learned, rotation: Learned, settings: Settings) -> Document:
    pitch = translation.speed / rotation.speed if translation.speed > 0.0 and rotation.speed > 0.0 else None
    speeds = _speeds(translation, rotation, pitch, settings)
    leads = [
        min(_lead(translation, settings.lead_force_n), settings.lead_force_max_n),
        _lead(rotation, settings.lead_torque_nm),
    ]
    stiffness = [
        settings.stiffness_n_m * leads[0] / settings.lead_force_n,
        settings.stiffness_nm_rad * leads[1] / settings.lead_torque_nm,
    ]
    soft = translation.direction if rotation.held and not translation.pressed else None
    parts: Document = {
        "translation": _part(translation, speeds[0], stiffness[0], TRANSLATION, settings, soft),
        "rotation": _part(rotation, speeds[1], stiffness[1], ROTATION, settings),
    }
    return {**parts, "pitch": pitch, "stop": asdict(_stop(translation, rotation, speeds, leads, settings))}


def _speeds(translation: Learned, rotation: Learned, pitch: float | None, settings: Settings) -> tuple[float, float]:
    """Speeds nu and lambda: demonstrated, capped, and coupled by the pitch."""
    nu = 0.0 if translation.direction is None else min(translation.speed, settings.speed_max_m_s)
    turn = 0.0 if rotation.direction is None else min(rotation.speed, settings.speed_max_rad_s)
    if nu > 0.0 and turn > 0.0 and pitch is not None:
        turn = min(nu / pitch, settings.speed_max_rad_s)
        nu = turn * pitch
    return nu, turn


def _lead(part: Learned, least: float) -> float:
    """Largest push: the teacher's 90th percentile in contact, at least the default."""
    if part.pressed:
        least = max(least, float(np.median([p.force for p in part.pressed])))
    loads = np.concatenate([norm(m.load)[norm(m.load) >= m.load_min] for m in part.motions])
    return max(least, float(np.percentile(loads, 90))) if part.direction is not None and len(loads) else least


def _stop(
    translation: Learned, rotation: Learned, speeds: tuple[float, float], leads: Sequence[float], settings: Settings
) -> Stop:
    """Limits: three times the demonstrated travel, five times the time."""
    travel = max(m.excursion for m in translation.motions)
    turn = max(m.excursion for m in rotation.motions)
    takes = [
        max(m.path for m in part.motions) / speed
        for part, speed in zip((translation, rotation), speeds, strict=True)
        if speed > 0.0
    ]
    shown = max((m.duration for part in (translation, rotation) for m in part.motions), default=0.0)
    return Stop(
        stall_m=settings.stall_m,
        stall_rad=settings.stall_m / LEVER_M,
        lead_force_n=leads[0],
        lead_torque_nm=leads[1],
        force_limit_n=max(60.0, 4.0 * leads[0]),
        time_limit_s=max(20.0, 5.0 * max(takes)) if takes else max(1.0, shown),
        travel_limit_m=max(0.1, 3.0 * travel),
        turn_limit_rad=max(radians(45.0), 2.0 * turn),
    )


def _part(
    part: Learned, speed: float, k: float, tool: Nominal, settings: Settings, soft: Float | None = None
) -> Document:
    free = np.eye(3) if part.fully_compliant else np.zeros((0, 3)) if part.axes is None else part.axes.axes
    stiffness, damping = gains(free, k, tool, None if part.fully_compliant else soft, settings.side_stiffness)
    return {
        "desired_direction": None if part.direction is None else part.direction.tolist(),
        "speed": speed,
        "compliant_axes": [] if part.fully_compliant else free.tolist(),
        "fully_compliant": part.fully_compliant,
        "stiffness": stiffness.tolist(),
        "damping": damping.tolist(),
        "evidence": evidence.as_document(part, settings),
    }
