"""A seating document from demonstrations: the push from their contact, the place from their poses, the search beside.

The push is learned from what each demonstration shows from shortly before its first contact on. From the demonstrations
come the push (at --at), and at the tool's tip the way (from the first contact to the end), the end with its attitude,
and the height of the first contact. The end is as deep as the deepest, since who ends higher stopped short of the
bottom; where all ended without pressing there is none, and it is the mean. Loose parts touch only near the end, and how
they slide there is not the way: where the tip came straight from more than twice as far, and more than 30 degrees
otherwise than it went in contact, the way is that straight and begins with it. So it is where they touch within
`LEAST_M` of the end and rest there, as at the bottom of a shallow hole that is wide; who still begins so near says
nothing of the way, if others do, and where all do it is the way in which they pressed at rest, `LEAST_M` long (our
choices). The part goes straight in: a turn that was shown only aligned it. From the user comes how far off the fixture
may be. The rest is by hand. The search is as wide as the mouth can be off its place, both ways at once (our choice):

    radius = sqrt(2) (shift + tilt * height of the first contact)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import degrees, radians, sqrt
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from skillframe.conditioning.audit import audit
from skillframe.config import build
from skillframe.demonstration.record import Demonstration, resolve_point
from skillframe.demonstration.together import common_frames
from skillframe.document.frame import with_center
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.extend.records import Document, LearnOptions, SkillType, Stalled
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose, cross, norm, rotation_vector, unit
from skillframe_search.learner import plain
from skillframe_search.seat_document import Seat, as_phase

BEFORE_S = 0.3  # of each demonstration before its contact that the push is learned with
LEAST_M = 0.002  # from the first contact to the end
SCREWED = radians(15.0)  # about the way, from the first contact to the end, in the mean; more is taken for a screw
RESTED_S, RESTED_M = 0.1, 0.0005  # where that is shorter: it stood at the end, in contact, for so long within so much
STRAIGHT = 0.15  # of its length that a straight way is off its line, at most
SLID = np.cos(radians(30.0))  # between that way and the one in contact; more is no insertion
_LOOKED_AT = 200  # samples before the contact
FREE_N, STOP_M = 3.6, 0.001
"""Demonstrations that all rest at their ends with less show a part that nothing stops; it is stopped over so much.

Of AutoMate's parts those that nothing stops leant on their posts with up to 3.1 N. All others were pressed with 11 N
and more but for one (00700, once with 4.2 N at least). A mistake either way costs nearly all trials (ours).
"""
PRESSING_N = 3.0  # at rest at the end, at least, of demonstrations whose way is that of their press
PRESSED_S, SAME_M, RESTING_M_S = 0.1, 3e-4, 1e-3
"""For how long, how near their ends, and how slowly that is [s, m, m/s] (ours)."""
ABOVE_M, MOST_ABOVE_M = 0.002, 0.005  # over the first contact, and at most where demonstrations began higher
PREFIX = "search_"


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatSettings:
    """What `--set` changes, beside the settings of the push's learner, and those of a learned search as search_NAME.

    Attributes:
        skill: kind of skill that pushes.
        exception: kind of skill that searches where the push stalls.
        blind: files of blind demonstrations, for a search that is learned from them.
        place: "base", where it was demonstrated, or "start": as far from the run's start as it was from theirs.
        shift: how far off the fixture may be across the way [m].
        tilt: how far off it may be turned [rad].
        height: how far off it may be along the way [m].
        friction: between the parts [1].
        approach: whether it goes to where contact began first.
        search: whether it searches on a stall.
        tries: searches and returns before it gives up.
        round: how the part is turned about its way does not matter, as of a round peg.
        settle: how long it is rocked where it rests near the end, so that a loose part stands flush [s].
    """

    skill: str = "lmc"
    exception: str = "search"
    blind: tuple[str, ...] = ()
    place: Literal["base", "start"] = "base"
    shift: float = 0.002
    tilt: float = radians(5.0)
    height: float = 0.0005
    friction: float = 0.5
    approach: bool = True
    search: bool = True
    tries: int = 8
    round: bool = False
    settle: float = 0.0

    def __post_init__(self) -> None:
        limits = {"shift": 0.05, "tilt": 0.6, "height": 0.05, "friction": 2.0, "tries": 100, "settle": 10.0}
        for name, most in limits.items():
            if not 0.0 <= getattr(self, name) <= most:
                raise InputError(f"--set {name}", f"should be 0 to {most:g}, is {getattr(self, name):g}", "fix it")


class _Shown(NamedTuple):
    """What one demonstration shows of the place, in base.

    Attributes:
        start, contact, end: three points (3,) of its way [m].
        attitude: (3, 3) at its end.
        pressing: (3,) mean force over the last `RESTED_S` of its contact; zero if it did not rest there [N].
        time, position, force: (T,), (T, 3), (T, 3) of the point, and of what the tool exerts on the parts [s, m, N].
        part: from shortly before its contact on.
    """

    start: Float
    contact: Float
    end: Float
    attitude: Float
    pressing: Float
    time: Float
    position: Float
    force: Float
    part: Demonstration


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """The body of a seating document.

    Raises:
        InputError: axes other than base, a demonstration without contact or way, or an unknown setting.
        UnknownName: no such kind of skill, or none that is an exception strategy.
    """
    settings, own, searching = _sorted(options)
    if options.axes != "base":
        raise InputError("--axes", "a seating knows its place in base axes", "leave --axes out")
    frames = common_frames(demonstrations)
    point = resolve_point("tip" if "tip" in frames else options.at, frames)
    shown = [_shown(each, point) for each in demonstrations]
    seat = _seat(shown, point, settings)
    push = registry().skill(settings.skill)
    if push.learn is None:
        raise InputError(f"--skill {push.name}", "is not learned from demonstrations", "name one that is, such as lmc")
    body = push.learn(
        [_pushed(each, seat) for each in shown], replace(options, settings=own, toward=seat.way, straight=True)
    )
    at_point = with_center({"frame": {**body["frame"], "learned_at": point.tolist()}}, point.tolist())
    stalled = Stalled(
        way=seat.way, radius=sqrt(2.0) * (seat.shift_m + seat.tilt_rad * seat.contact_m), tilt=seat.tilt_rad,
        near=sqrt(2.0) * seat.shift_m,
        friction=seat.friction, frame=at_point["frame"],
        options=replace(options, at=",".join(map(str, point.tolist())), settings=searching),
        blind=[read_demonstration(Path(file)) for file in settings.blind],
    )  # fmt: skip
    strategy = exception_strategy(settings.exception)
    assert strategy.exception is not None
    found = strategy.exception(stalled)
    return {
        "frame": with_center(body, point.tolist())["frame"],
        "phases": [as_phase(body, push.name), as_phase(found, strategy.name)],
        "seat": plain(asdict(seat)),
        "settings": plain(asdict(settings)),
    }


def exception_strategy(name: str) -> SkillType:
    """The kind of skill of a name, if it can search where another stalls.

    Raises:
        UnknownName: there is none. InputError: it cannot, with those that can.
    """
    kind = registry().skill(name)
    if kind.exception is None:
        able = [each for each in registry().names("skill") if registry().skill(each).exception is not None]
        raise InputError(f"--exception {name}", f"a {name} skill is no exception strategy", f"name {', '.join(able)}")
    return kind


def _sorted(options: LearnOptions) -> tuple[SeatSettings, dict[str, Any], dict[str, Any]]:
    """Settings of the seating, of the push's learner, and of the search's."""
    names, given = SeatSettings.__dataclass_fields__, dict(options.settings)
    mine = {key: given.pop(key) for key in list(given) if key in names}
    searching = {key.removeprefix(PREFIX): given.pop(key) for key in list(given) if key.startswith(PREFIX)}
    return build(SeatSettings, mine, "--set"), given, searching


def _shown(demonstration: Demonstration, point: Float) -> _Shown:
    where = demonstration.source or "demonstration"
    contacts = audit(demonstration).contacts
    if not contacts:
        raise InputError(where, "never touches anything", "record until the part is seated")
    began = float(contacts[0][0])
    pose = demonstration.pose
    position = Pose(pose.position, pose.rotation).at(point).position
    first = int(np.searchsorted(demonstration.time, began))
    last, force = demonstration.time >= max(began, contacts[-1][1] - RESTED_S), -demonstration.wrench[:, :3]
    moved = float(norm(position[last][0] - position[last][-1]))
    rested = contacts[-1][1] - began >= RESTED_S and moved < RESTED_M
    brief = LEAST_M if rested else 0.0
    return _Shown(
        position[0], _way_begins(position, first, brief), position[-1], pose.rotation[-1],
        force[last].mean(axis=0) * rested, demonstration.time, position, force,
        demonstration.between(began - BEFORE_S, None),
    )  # fmt: skip


def _pressed_at_end(shown: _Shown, way: Float) -> float:
    """The largest mean force [N] along the way over `PRESSED_S` in which the tool rested at the end.

    It is infinite where the tool never did. Who lets go at a bottom has pressed on it before.
    """
    window = max(1, round(PRESSED_S / float(np.median(np.diff(shown.time)))))
    if window >= len(shown.time):
        return np.inf
    along, force = shown.position @ way, np.cumsum(np.concatenate([[0.0], shown.force @ way]))
    moved = np.abs(along[window:] - along[:-window])
    there = (along[window:] > along[-1] - SAME_M) & (moved < RESTING_M_S * PRESSED_S)
    mean = (force[window:] - force[:-window])[1:] / window
    return float(mean[there].max()) if there.any() else np.inf


def _way_begins(position: Float, first: int, brief: float = 0.0) -> Float:
    """Where (3,) the way of a tip (T, 3) to its last place begins.

    That is at sample `first`, or before if it slid from there, or came no further than `brief` [m].
    """
    touched = position[-1] - position[first]
    short = float(norm(touched)) < brief
    for i in np.unique(np.linspace(0, first, _LOOKED_AT).astype(int)).tolist():
        left = position[-1] - position[i:]
        length = float(norm(left[0]))
        if length <= 2.0 * float(norm(touched)):
            break
        along = left @ (left[0] / length)
        straight = float(norm(left - along[:, None] * left[0] / length).max()) <= STRAIGHT * length
        if straight and (short or touched @ left[0] < SLID * float(norm(touched)) * length):
            return np.asarray(position[i])
    return np.asarray(position[first])


def _pushed(shown: _Shown, seat: Seat) -> Demonstration:
    """What shows the push: all from the contact on, or where nothing stops the part, until it is at its end."""
    if not seat.stop_m:
        return shown.part
    along = shown.position @ np.array(seat.way)
    return shown.part.between(None, float(shown.time[np.argmax(along > along[-1] - SAME_M)]))


def _seat(shown: Sequence[_Shown], point: Float, settings: SeatSettings) -> Seat:
    start, end = np.mean([s.start for s in shown], axis=0), np.mean([s.end for s in shown], axis=0)
    telling = [s.end - s.contact for s in shown if norm(s.end - s.contact) >= LEAST_M]
    if not telling and (pressed := _pressed_way(shown)) is not None:
        telling = [LEAST_M * pressed]
    contact = end - np.mean(telling or [s.end - s.contact for s in shown], axis=0)
    depth = float(norm(end - contact))
    if not telling or depth < 0.5 * LEAST_M:  # or ways that contradict each other
        raise InputError(
            "learn", f"the demonstrations go {1e3 * depth:.1f} mm from first contact to end, which seats nothing",
            "record until the part is seated, and begin before it touches",
        )  # fmt: skip
    way = unit(end - contact)
    if not settings.round:
        _goes_straight(shown, way)
    free = all(_pressed_at_end(each, way) < FREE_N for each in shown)
    if not free:  # nobody goes deeper than the bottom, and some stop short of it
        moved = settings.place == "start"
        further = max(float((each.end - end - (each.start - start) * moved) @ way) for each in shown)
        end, depth = end + further * way, depth + further
    left, _, right = np.linalg.svd(np.sum([each.attitude for each in shown], axis=0))
    mean = left @ right  # of rotations
    leant = max(float(norm(cross(each.attitude.T @ way, mean.T @ way))) for each in shown)
    above = float(np.clip((end - start) @ way, depth + ABOVE_M, depth + MOST_ABOVE_M))
    return Seat(
        way=_vector(way), point=_vector(point), end=_vector(end), start=_vector(start),
        attitude=_vector(rotation_vector(mean)), leant_rad=float(np.arcsin(min(leant, 1.0))),
        contact_m=depth, above_m=above, place=settings.place, shift_m=settings.shift, tilt_rad=settings.tilt,
        height_m=settings.height, friction=settings.friction, approach=settings.approach, search=settings.search,
        stop_m=STOP_M if free else 0.0, tries=settings.tries, settle_s=settings.settle,
    )  # fmt: skip


def _pressed_way(shown: Sequence[_Shown]) -> Float | None:
    """The way (3,) in which all pressed at rest at their ends, within 30 degrees of it and of how they came, if any."""
    ways = np.array([unit(s.pressing) for s in shown if norm(s.pressing) >= PRESSING_N])
    if len(ways) < len(shown):
        return None
    mean, came = unit(ways.mean(axis=0)), np.array([unit(s.end - s.start) for s in shown])
    return mean if min((ways @ mean).min(), (came @ mean).min()) > SLID else None


def _goes_straight(shown: Sequence[_Shown], way: Float) -> None:
    """Raise `InputError` if the part was turned about its way from the contact on, as a bayonet is."""
    turned = [rotation_vector(s.attitude @ s.part.pose.rotation[0].T) @ way for s in shown]
    if (mean := abs(float(np.mean(turned)))) > SCREWED:
        raise InputError(
            "learn", f"the part was turned by {degrees(mean):.0f} degrees about its way, which a seating does not do",
            "leave --exception out, and the push learns the turn; or --set round=true, if it is a round peg",
        )  # fmt: skip


def _vector(values: Float) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
