"""Learn a seating document: the push from the demonstrated contact, the place from the poses, and a search.

At the tool's tip, the way goes from the first contact to the end. The end is the deepest one, since others stopped
short of the bottom, or the mean where all ended without pressing. Exceptions of the way:

- Loose parts touch near the end only and slide there. A straight line of more than twice that length, at more than 30
  degrees to the way in contact, is the way; likewise for parts that touch within `LEAST_M` of the end and rest there.
- Demonstrations that still begin so near are ignored if others give a way; else the way is the direction of their
  press, `LEAST_M` long.

A removal, which takes the part out, is turned round in time: its end is the place before the hole, and the push is
written by hand.

The search covers the fixture's error on two axes:

    radius = sqrt(2) (shift + tilt * height of the first contact)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import degrees, radians, sqrt
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from skillframe.config import build
from skillframe.demonstration import Demonstration, contact_evidence, resolve_point
from skillframe.document import common_frames, with_center
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions, SkillType, Stalled, read_demonstration, registry
from skillframe.frames import Float, Pose, cross, norm, rotation_vector, unit
from skillframe_search.learner import plain
from skillframe_search.seat_document import Seat, as_phase
from skillframe_search.straight import straight_push

LEAST_M = 0.002  # from the first contact to the end
SCREWED = radians(15.0)  # mean turn about the way from contact to end; more is a screw
STRAIGHT = 0.15  # of its length: deviation of a straight way from its line
RESTED_S = 0.1  # of rest at the end in contact, where the way is shorter
SLID = np.cos(radians(30.0))  # between that way and the one in contact; more is no insertion
FREE_N = 5.0
"""Less than FREE_N [N] at rest at the end, in the mean of demonstrations: nothing stops the part, and the push fades
over the last millimetre.

Of AutoMate's parts, unstopped ones showed at most 2.7 N in the mean and 5.1 N in one demonstration, stopped ones at
least 12 N and 9.7 N; a wrong decision fails nearly all trials."""
PRESSED_S, SAME_M = 0.1, 3e-4
"""Duration of a press, and its distance from the end [s, m]."""
PREFIX = "search_"


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatSettings:
    """Settings of `--set`, beside those of the push's learner and search_NAME of a learned search.

    Attributes:
        skill: kind of skill that pushes.
        exception: kind of skill that searches where the push stalls.
        blind: files of blind demonstrations for a learned search.
        removal: the demonstrations take the part out, and end as soon as it is. Turned round in time they give place,
            way and orientation, and no push: that is a straight one.
        stopped: whether something stops the part at its end, which a removal does not show.
        place: "base": as demonstrated; "start": relative to the start of the run.
        shift: largest error of the fixture across the way [m].
        tilt: largest error of its orientation [rad].
        height: largest error along the way [m].
        friction: between the parts [1].
        approach: whether it first goes to where contact began.
        tries: searches, swings and returns before it gives up; 0: it fails where the push stalls.
        round: the turn about the way does not matter, as of a round peg.
        settle: duration of rocking near the end, so that a loose part stands flush [s].
    """

    skill: str = "lmc"
    exception: str = "search"
    blind: tuple[str, ...] = ()
    removal: bool = False
    stopped: bool = True
    place: Literal["base", "start"] = "base"
    shift: float = 0.002
    tilt: float = radians(5.0)
    height: float = 0.0005
    friction: float = 0.5
    approach: bool = True
    tries: int = 8
    round: bool = False
    settle: float = 0.5

    def __post_init__(self) -> None:
        limits = {"shift": 0.05, "tilt": 0.6, "height": 0.05, "friction": 2.0, "tries": 100, "settle": 10.0}
        for name, most in limits.items():
            if not 0.0 <= getattr(self, name) <= most:
                raise InputError(f"--set {name}", f"should be 0 to {most:g}, is {getattr(self, name):g}", "fix it")


class Shown(NamedTuple):
    """Place of one demonstration, in base.

    Attributes:
        start, contact, end: (3,) points of its way [m].
        orientation: (3, 3) at its end.
        pressing: (3,) mean force over its last `RESTED_S`; zero without a rest [N].
        time, position, force: (T,), (T, 3), (T, 3) of the point, and of the tool on the parts [s, m, N].
        part: from shortly before its contact on.
    """

    start: Float
    contact: Float
    end: Float
    orientation: Float
    pressing: Float
    time: Float
    position: Float
    force: Float
    part: Demonstration


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a seating document.

    Raises:
        InputError: axes other than base, a demonstration without contact or way, or an unknown setting.
        UnknownName: no such kind of skill, or none that is an exception strategy.
    """
    names, given = SeatSettings.__dataclass_fields__, dict(options.settings)
    mine = {key: given.pop(key) for key in list(given) if key in names}
    searching = {key.removeprefix(PREFIX): given.pop(key) for key in list(given) if key.startswith(PREFIX)}
    settings = build(SeatSettings, mine, "--set")  # those left over are of the push's learner
    if options.axes != "base":
        raise InputError("--axes", "a seating knows its place in base axes", "leave --axes out")
    frames = common_frames(demonstrations)
    point = resolve_point("tip" if "tip" in frames else options.at, frames)
    shown = [(_taken_out if settings.removal else _shown)(each, point) for each in demonstrations]
    seat = seat_of(shown, point, settings)
    push = registry().skill("lmc" if settings.removal else settings.skill)
    if settings.removal:
        given |= {"skill": settings.skill} if settings.skill != push.name else {}
        if given:
            raise InputError(
                f"--set {next(iter(given))}", "is of a learned push, and a removal shows none", "leave it out"
            )
        body = straight_push({**frames, "tip": point.tolist()}, np.array(seat.way))
    elif push.learn is None:
        raise InputError(
            f"--set skill={push.name}", "is not learned from demonstrations", "name one that is, such as lmc"
        )
    else:
        body = push.learn(
            [_pushed(each, seat) for each in shown], replace(options, settings=given, toward=seat.way, straight=True)
        )
    at_point = with_center({"frame": {**body["frame"], "learned_at": point.tolist()}}, point.tolist())
    stalled = Stalled(
        way=seat.way, radius=sqrt(2.0) * (seat.shift_m + seat.tilt_rad * seat.contact_m), tilt=seat.tilt_rad,
        near=sqrt(2.0) * seat.shift_m,
        friction=settings.friction, frame=at_point["frame"],
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
        UnknownName: there is none.
        InputError: it cannot.
    """
    kind = registry().skill(name)
    if kind.exception is None:
        able = [each for each in registry().names("skill") if registry().skill(each).exception is not None]
        raise InputError(
            f"--set exception={name}", f"a {name} skill is no exception strategy", f"name {', '.join(able)}"
        )
    return kind


def _shown(demonstration: Demonstration, point: Float) -> Shown:
    where = demonstration.source or "demonstration"
    contacts = contact_evidence(demonstration).contacts
    if not contacts:
        raise InputError(where, "never touches anything", "record until the part is seated")
    began = float(contacts[0][0])
    pose = demonstration.pose
    position = Pose(pose.position, pose.rotation).at(point).position
    first = int(np.searchsorted(demonstration.time, began))
    last, force = demonstration.time >= max(began, contacts[-1][1] - RESTED_S), -demonstration.wrench[:, :3]
    moved = float(norm(position[last][0] - position[last][-1]))
    rested = contacts[-1][1] - began >= RESTED_S and moved < 0.0005
    brief = LEAST_M if rested else 0.0
    return Shown(
        position[0], way_begins(position, first, brief), position[-1], pose.rotation[-1],
        force[last].mean(axis=0) * rested, demonstration.time, position, force,
        demonstration.between(began - 0.3, None),  # the push is learned with 0.3 s before contact
    )  # fmt: skip


def _taken_out(removal: Demonstration, point: Float) -> Shown:
    """The place that a removal shows, turned round in time. It ends as soon as the part is out, at the entrance.

    Raises:
        InputError: it does not go straight.
    """
    pose = removal.pose
    position = Pose(pose.position, pose.rotation).at(point).position[::-1]
    away = position - position.mean(axis=0)
    way: Float = np.linalg.svd(away, full_matrices=False)[2][0]  # principal direction, against noise of single samples
    way = way * np.sign(way @ (position[-1] - position[0]))
    length = float(way @ (position[-1] - position[0]))
    aside = float(norm(away - (away @ way)[:, None] * way).max())
    if length < LEAST_M or aside > STRAIGHT * length:
        what = f"goes {1e3 * length:.1f} mm from first to last sample, and up to {1e3 * aside:.1f} mm aside"
        raise InputError(
            removal.source or "removal", what, "record from the assembled pose until the part is out, and no longer"
        )
    begins = position[-1] - length * way
    # Forces are left out: friction points the other way in an insertion
    return Shown(
        begins, begins, position[-1], pose.rotation[0], np.zeros(3), removal.time, position,
        np.zeros_like(position), removal,
    )  # fmt: skip


def _pressed_at_end(shown: Shown, way: Float) -> float:
    """Largest mean force [N] along the way over `PRESSED_S` at rest at the end, infinite without a rest."""
    window = max(1, round(PRESSED_S / float(np.median(np.diff(shown.time)))))
    if window >= len(shown.time):
        return np.inf
    along, force = shown.position @ way, np.cumsum(np.concatenate([[0.0], shown.force @ way]))
    moved = np.abs(along[window:] - along[:-window])
    there = (along[window:] > along[-1] - SAME_M) & (moved < 1e-3 * PRESSED_S)  # m/s
    mean = (force[window:] - force[:-window])[1:] / window
    return float(mean[there].max()) if there.any() else np.inf


def way_begins(position: Float, first: int, brief: float = 0.0) -> Float:
    """Where (3,) the way of a tip (T, 3) begins.

    At sample `first`, or earlier if the tip slid or came within `brief` [m].
    """
    touched = position[-1] - position[first]
    short = float(norm(touched)) < brief
    for i in np.unique(np.linspace(0, first, 200).astype(int)).tolist():  # samples before the contact
        left = position[-1] - position[i:]
        length = float(norm(left[0]))
        if length <= 2.0 * float(norm(touched)):
            break
        along = left @ (left[0] / length)
        straight = float(norm(left - along[:, None] * left[0] / length).max()) <= STRAIGHT * length
        if straight and (short or touched @ left[0] < SLID * float(norm(touched)) * length):
            return np.asarray(position[i])
    return np.asarray(position[first])


def _pushed(shown: Shown, seat: Seat) -> Demonstration:
    """The part that shows the push, up to the end where nothing stops the part."""
    if not seat.stop_m:
        return shown.part
    along = shown.position @ np.array(seat.way)
    return shown.part.between(None, float(shown.time[np.argmax(along > along[-1] - SAME_M)]))


def seat_of(shown: Sequence[Shown], point: Float, settings: SeatSettings) -> Seat:
    """Place of the part, its uncertainty and the settings, from demonstrations of a point (3,) of the tool [m].

    Raises:
        InputError: no way from first contact to end, or a turn about it.
    """
    start, end = np.mean([s.start for s in shown], axis=0), np.mean([s.end for s in shown], axis=0)
    telling = [s.end - s.contact for s in shown if norm(s.end - s.contact) >= LEAST_M]
    if not telling and (pressed := _pressed_way(shown)) is not None:
        telling = [LEAST_M * pressed]
    contact = end - np.mean(telling or [s.end - s.contact for s in shown], axis=0)
    depth = float(norm(end - contact))
    if not telling or depth < 0.5 * LEAST_M:  # or contradictory ways
        raise InputError(
            "learn", f"the demonstrations go {1e3 * depth:.1f} mm from first contact to end, which seats nothing",
            "record until the part is seated, and begin before it touches",
        )  # fmt: skip
    way = unit(end - contact)
    if not settings.round:
        turned = [rotation_vector(s.orientation @ s.part.pose.rotation[0].T) @ way for s in shown]
        if (mean := abs(float(np.mean(turned)))) > SCREWED:
            raise InputError(
                "learn", f"the part was turned by {degrees(mean):.0f} degrees about its way, which a seating does not "
                "do", "leave --skill seat out, and the push learns the turn; or --set round=true, if it is a round peg",
            )  # fmt: skip
    free = float(np.mean([_pressed_at_end(each, way) for each in shown])) < FREE_N
    if settings.removal:
        free = not settings.stopped
    if not free:  # some stop short of the bottom
        moved = settings.place == "start"
        further = max(float((each.end - end - (each.start - start) * moved) @ way) for each in shown)
        end, depth = end + further * way, depth + further
    left, _, right = np.linalg.svd(np.sum([each.orientation for each in shown], axis=0))
    upright = left @ right  # mean of rotations
    leant = max(float(norm(cross(each.orientation.T @ way, upright.T @ way))) for each in shown)
    return Seat(
        way=_vector(way), point=_vector(point), end=_vector(end), start=_vector(start),
        orientation=_vector(rotation_vector(upright)), leant_rad=float(np.arcsin(min(leant, 1.0))),
        contact_m=depth, place=settings.place, shift_m=settings.shift, tilt_rad=settings.tilt,
        height_m=settings.height, approach=settings.approach, stop_m=0.001 if free else 0.0, tries=settings.tries,
        settle_s=settings.settle,
    )  # fmt: skip


def _pressed_way(shown: Sequence[Shown]) -> Float | None:
    """Common (3,) direction of the press at the ends, within 30 degrees of each and of the way they came, or None."""
    # least force at rest of a way taken from the press
    ways = np.array([unit(s.pressing) for s in shown if norm(s.pressing) >= 3.0])
    if len(ways) < len(shown):
        return None
    mean, came = unit(ways.mean(axis=0)), np.array([unit(s.end - s.start) for s in shown])
    return mean if min((ways @ mean).min(), (came @ mean).min()) > SLID else None


def _vector(values: Float) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
