r"""The flow of learning (Fig. 6 of the overview paper).

First the pitch, then for translation and rotation alike

    moved at all?      no: held stiff
    who moved it?      W = F_m . dx, or T_m . dbeta at the hand                     (3)        [work]
                       the environment, if W > 0 prevails: three compliant degrees of freedom
    where to push?     intersection of the pyramids; may not exist      [sectors, directions, heading, modes, votes]
                       its middle, where faces of one side were passed  [expected]
                       where none exists, the way that was told (`LearnOptions.toward`)
                       no turn is pushed, where it is known that the part goes straight (`LearnOptions.straight`)
    where to give?     where faces turned the push aside; where none did, or the tool turned,
                       principal axes of the motion that the push does not explain              [faces, axes]
    how stiff?         zero along compliant axes, k elsewhere                                   [gains]

and if both directions exist, their speeds are coupled by the pitch, lambda = nu / p. The wrench and the position are
those of the learning point; the torque's work and sectors are taken at the hand, because only there is the teacher's
torque apart from the lever arm of his force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import radians
from typing import Literal, NamedTuple

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import frame_of
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float, norm, unit
from skillframe_lmc import evidence, intervals
from skillframe_lmc.axes import CompliantAxes, compliant_axes, straightness
from skillframe_lmc.directions import Choice, choose
from skillframe_lmc.faces import face_axes
from skillframe_lmc.gains import gains
from skillframe_lmc.heading import heading
from skillframe_lmc.intervals import Motion, Track
from skillframe_lmc.modes import mean_pushes
from skillframe_lmc.phase import Stop
from skillframe_lmc.press import Press, presses
from skillframe_lmc.sectors import Sectors, sectors
from skillframe_lmc.settings import Settings
from skillframe_lmc.votes import Votes, touched, voted
from skillframe_lmc.work import Work, work

Name = Literal["translation", "rotation"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """What was decided about one part, and from what.

    Attributes:
        name: "translation" or "rotation".
        motions: all demonstrations.
        moving: those that moved this part.
        given: sectors of those that voted.
        work: who moved it; None if held.
        choice: the votes; None if none were cast.
        axes: compliant axes; None if held or fully compliant.
        means: (n, 3) mean directions, a row for each that moved.
        speed: mean demonstrated speed, without the pauses [m/s or rad/s].
        pressed: the standing force of each demonstration, where it decided; empty where the motion did.
        told: (3,) direction that was given from outside and taken, because the demonstrations show none.
        aligned: the demonstrations show a push, which was only to align the part, because it is known to go straight.
    """

    name: Name
    motions: Sequence[Motion]
    moving: Sequence[Motion]
    given: Sequence[Sectors]
    work: Work | None
    choice: Choice | None
    axes: CompliantAxes | None
    means: Float
    speed: float
    pressed: Sequence[Press] = ()
    told: Float | None = None
    aligned: bool = False

    @property
    def held(self) -> bool:
        """The part did not move."""
        return not self.moving

    @property
    def fully_compliant(self) -> bool:
        """The environment moved it, and nobody told where to push."""
        return self.told is None and self.work is not None and self.work.environment_drove

    @property
    def direction(self) -> Float | None:
        """The desired direction, if it exists."""
        shown = None if self.choice is None or self.aligned else self.choice.direction
        return self.told if shown is None else shown


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The body of a skill document (`frame`, `phases`, `settings`) from demonstrations of one phase.

    Raises:
        InputError: no demonstration, tools that differ, values that are not finite, or an unknown setting.
        UnknownName: a point's name that the demonstrations do not know, or unknown axes.
    """
    settings = build(Settings, options.settings, "--set")
    frame = frame_of(demonstrations, options)
    at, hand = np.array(frame["learned_at"]), np.array(frame["work_at"])
    tracks = [intervals.track(d, at, hand, options.axes) for d in demonstrations]
    rotation = _learn_part("rotation", tracks, intervals.rotation, settings, straight=options.straight)
    toward = None if options.toward is None else unit(np.array(options.toward))
    translation = _learn_part("translation", tracks, intervals.translation, settings, not rotation.held, toward)
    return {
        "frame": frame,
        "phases": [_phase(translation, rotation, settings)],
        "settings": asdict(settings),
    }


def _learn_part(
    name: Name, tracks: Sequence[Track], cut: Callable[[Track, Settings], Motion], settings: Settings,
    turned: bool = True, toward: Float | None = None, straight: bool = False,
) -> Learned:  # fmt: skip
    motions = [cut(blocks, settings) for blocks in tracks]
    if settings.contact_only:
        motions = [intervals.touching(motion) for motion in motions]
    least = settings.moving_m if name == "translation" else settings.moving_rad
    moving = [m for m in motions if m.excursion >= least and len(m.displacement)]
    done = work(moving) if moving else None
    votes = Votes(None, [sectors(m) for m in moving])
    if done is not None and not done.environment_drove:
        votes = voted(name, moving, settings, turned)
    stood = _standing(name, tracks, motions, moving, votes.choice, settings)
    if stood is not None:
        done, votes = stood.work, Votes(stood.choice, [p.sectors for p in stood.presses])
    elif votes.choice is not None and votes.choice.direction is None and not turned:
        moving, votes = touched(name, moving, votes, settings)
    choice, means, axes = votes.choice, _means(moving), None
    aligned = straight and choice is not None and choice.direction is not None
    direction = None if choice is None or aligned else choice.direction
    told = toward if done is not None and direction is None else None
    if done is not None and (told is not None or not done.environment_drove):
        direction = direction if told is None else told
        rows = np.concatenate([means, mean_pushes(votes.modes)]) if stood is None else stood.means(least)
        axes = compliant_axes(rows, direction, _straightness(name, moving, means, choice, settings))
        if settings.faces and direction is not None and stood is None and not turned:
            axes = axes.unless(face_axes(moving, direction))
    path, time = sum(m.path for m in moving), sum(m.duration for m in moving)
    return Learned(
        name=name, motions=motions, moving=moving, given=votes.given, work=done, choice=choice, axes=axes, means=means,
        speed=path / time if time > 0.0 else 0.0, pressed=() if stood is None else stood.presses, told=told,
        aligned=aligned,
    )  # fmt: skip


def _means(motions: Sequence[Motion]) -> Float:
    """Mean unit direction of motion (n, 3) of each."""
    return np.array([unit(m.displacement).mean(axis=0) for m in motions]).reshape(-1, 3)


class _Standing(NamedTuple):
    """What was decided by standing force: see `press`."""

    presses: list[Press]
    work: Work
    choice: Choice

    def means(self, least: float) -> Float:
        """Mean directions (n, 3) of the motions in contact that are long enough to be motions [m]."""
        touched = [p.motion.displacement for p in self.presses]
        return np.array([unit(d).mean(axis=0) for d in touched if norm(d).sum() >= least]).reshape(-1, 3)


def _standing(
    name: Name, tracks: Sequence[Track], motions: Sequence[Motion], moving: Sequence[Motion], moved: Choice | None,
    settings: Settings,
) -> _Standing | None:  # fmt: skip
    """What the standing force says, or None unless all were pressed.

    It is asked where the motion alone gives no direction (`moved`), or where nothing was met on the way.

    Raises:
        InputError: they were pressed along their way, and no push explains it: what is left is a skill that gives way
            along the one motion there was.
    """
    if name == "rotation" or len(moving) != len(motions) or (found := presses(tracks, motions)) is None:
        return None
    in_air = all(p.in_air for p in found)
    done = work([p.motion for p in found])
    if done.environment_drove or not (in_air or moved is None or moved.direction is None):
        return None
    choice = choose([p.sectors for p in found], settings, heading(moving))
    if choice.direction is None:
        force = np.median([p.force for p in found])
        raise InputError(
            "learn", f"the tool was pressed with {force:.0f} N where it stood, along the way it had come, and no one "
            f"push explains it (the hand would have been off by {np.degrees(choice.pyramid_angle):.0f} degrees)",
            "cut the recordings into phases (skillframe segment), or demonstrate the press the same way each time",
        )  # fmt: skip
    if in_air:
        choice = choice._replace(direction=unit(np.mean([p.push for p in found], axis=0)))
    return _Standing(found, done, choice)


def _straightness(
    name: Name, moving: Sequence[Motion], means: Float, choice: Choice | None, settings: Settings
) -> float:
    if name == "rotation":
        return settings.straightness_rad
    agreed = None if choice is None or choice.direction is None else choice.pyramid_angle
    return straightness(float(np.mean([m.path for m in moving])), settings.straightness_m, agreed, means)


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
    floors = [
        (settings.mass_kg, settings.damping_min_ns_m),
        (settings.inertia_kg_m2, settings.damping_min_nms_rad),
    ]
    parts: Document = {
        part.name: _part(part, speed, k, *floor, settings)
        for part, speed, k, floor in zip((translation, rotation), speeds, stiffness, floors, strict=True)
    }
    return {**parts, "pitch": pitch, "stop": asdict(_stop(translation, rotation, speeds, leads, settings))}


def _speeds(translation: Learned, rotation: Learned, pitch: float | None, settings: Settings) -> tuple[float, float]:
    """Both speeds, nu and lambda: demonstrated, capped, and coupled by the pitch if both directions exist."""
    nu = 0.0 if translation.direction is None else min(translation.speed, settings.speed_max_m_s)
    turn = 0.0 if rotation.direction is None else min(rotation.speed, settings.speed_max_rad_s)
    if nu > 0.0 and turn > 0.0 and pitch is not None:
        turn = min(nu / pitch, settings.speed_max_rad_s)
        nu = turn * pitch
    return nu, turn


def _lead(part: Learned, least: float) -> float:
    """Largest push: what the teacher needed (90th percentile in contact), if that is more than the default."""
    if part.pressed:
        least = max(least, float(np.median([p.force for p in part.pressed])))
    loads = np.concatenate([norm(m.load)[norm(m.load) >= m.load_min] for m in part.motions])
    return max(least, float(np.percentile(loads, 90))) if part.direction is not None and len(loads) else least


def _stop(
    translation: Learned, rotation: Learned, speeds: tuple[float, float], leads: Sequence[float], settings: Settings
) -> Stop:
    """Limits from the demonstrations' size: three times the travel, five times the time."""
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
        stall_rad=settings.stall_rad,
        lead_force_n=leads[0],
        lead_torque_nm=leads[1],
        force_limit_n=max(60.0, 4.0 * leads[0]),
        time_limit_s=max(20.0, 5.0 * max(takes)) if takes else max(1.0, shown),
        travel_limit_m=max(0.1, 3.0 * travel),
        turn_limit_rad=max(radians(45.0), 2.0 * turn),
    )


def _part(part: Learned, speed: float, k: float, inertia: float, floor: float, settings: Settings) -> Document:
    axes = np.zeros((0, 3)) if part.axes is None else part.axes.axes
    stiffness, damping = gains(axes, part.fully_compliant, k, inertia, floor)
    return {
        "desired_direction": None if part.direction is None else part.direction.tolist(),
        "speed": speed,
        "compliant_axes": axes.tolist(),
        "fully_compliant": part.fully_compliant,
        "stiffness": stiffness.tolist(),
        "damping": damping.tolist(),
        "evidence": evidence.as_document(part, settings),
    }
