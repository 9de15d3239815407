r"""Visits of places in a demonstration: contacts, each in the frame that it belongs to.

A contact belongs to the place relative to which demonstrations agree best on the first touch,

    scatter(place) = sqrt(mean over demonstrations |x_i - mean x|^2),    x_i = touch of demonstration i seen from place

over all common places and `base`. Of places within twice the smallest scatter (or 1 mm), as of one rigid board, the
nearest is taken, `base` last. Scatter over 30 mm is refused. Consecutive contacts at one place are one visit, with

    way in     from the last time that the tool was 40 mm away from its first touch, to 8 mm before it
    work       from there to the way out; the skill is learned from this
    way out    from the last rest to 40 mm from the last touch, if recorded

Contacts of less than a tenth of the usual impulse are knocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, NoReturn

import numpy as np

from skillframe.demonstration import Demonstration, contact_evidence
from skillframe.document import places_of
from skillframe.errors import InputError
from skillframe.frames import Float, Pose, norm, unit

BASE = "base"
FAR_M, NEAR_M = 0.04, 0.008
TIP = "tip"


class Visit(NamedTuple):
    """One visit of one demonstration.

    Attributes:
        place: its name, or `BASE`.
        far, near: times of 40 mm and 8 mm before the first touch [s].
        touch: of the first touch [s].
        leaves: the way out begins [s].
        out: times of 8 mm and 40 mm after the contact's end, if recorded [s].
    """

    place: str
    far: float
    near: float
    touch: float
    leaves: float
    out: tuple[float, ...]


def visits_of(demonstrations: Sequence[Demonstration]) -> tuple[list[list[Visit]], list[dict[str, float]]]:
    """Visits of all demonstrations, the same places in the same order.

    Returns:
        Visits by demonstration, and for each visit the scatter of its touch by frame [m]; empty for one demonstration.

    Raises:
        InputError: a demonstration that names no common place, touches nothing, or visits the places in another order.
    """
    places = [places_of(d) for d in demonstrations]
    common = [name for name in places[0] if all(name in each for each in places)]
    if not common:
        raise InputError(
            demonstrations[0].source or "demonstration 1", "names no place that all demonstrations name",
            "name the same places in the metadata of each, or give --set places=false",
        )  # fmt: skip
    touches = [_contacts(d, known, common) for d, known in zip(demonstrations, places, strict=True)]
    if len({len(each) for each in touches}) > 1:
        _refuse_order(demonstrations, touches)
    rows = []
    scatters = []
    for k in range(len(touches[0])):
        points = np.array(
            [path_of(d)[index_at(d, touch[k][1])] for d, touch in zip(demonstrations, touches, strict=True)]
        )
        scatter = scatter_of(points, places, common)
        if min(scatter.values(), default=0.0) > 0.03:  # larger scatter in every frame is refused
            _refuse_order(demonstrations, touches)
        name = belongs_to(points, places, common, scatter)
        rows.append([(name, start, stop) for _, start, stop in (touch[k] for touch in touches)])
        scatters.append(scatter)
    return [
        [_visit(d, *rows[k][i], _next(rows, k, i, d)) for k in range(len(rows))] for i, d in enumerate(demonstrations)
    ], scatters


def scatter_of(points: Float, places: Sequence[Mapping[str, Pose]], names: Sequence[str]) -> dict[str, float]:
    """Scatter of points (D, 3), one of each demonstration, in each place and in base [m]."""
    if len(points) < 2:
        return {}
    seen = {name: _seen(points, [each[name] for each in places]) for name in names} | {BASE: points}
    return {name: float(np.sqrt(((x - x.mean(axis=0)) ** 2).sum(-1).mean())) for name, x in seen.items()}


def belongs_to(
    points: Float, places: Sequence[Mapping[str, Pose]], names: Sequence[str], scatter: Mapping[str, float]
) -> str:
    """The place that points (D, 3) belong to: of those that explain them best, the nearest."""
    away = {name: float(norm(_seen(points, [each[name] for each in places])).mean()) for name in names}
    least = min(scatter.values(), default=0.0)
    alike = [name for name in names if scatter.get(name, 0.0) <= max(2.0 * least, least + 0.001)]
    return min(alike, key=lambda name: away[name]) if alike else BASE


def _seen(points: Float, poses: Sequence[Pose]) -> Float:
    return np.array([(x - pose.position) @ pose.rotation for x, pose in zip(points, poses, strict=True)])


def _contacts(
    demonstration: Demonstration, places: Mapping[str, Pose], names: Sequence[str]
) -> list[tuple[str, float, float]]:
    """Nearest place, start and stop of contacts [s], joined by place, without knocks."""
    path, found = path_of(demonstration), []
    for start, stop, peak in contact_evidence(demonstration).contacts:
        point = path[index_at(demonstration, start)]
        name = min(names, key=lambda each: float(norm(point - places[each].position)))
        found.append((name, start, stop, peak * (stop - start)))
    strongest = [max(impulse for each, _, _, impulse in found if each == name) for name in {row[0] for row in found}]
    # of the median over places of the strongest contact, as peak force times duration
    least = 0.1 * float(np.median(strongest)) if strongest else 0.0
    rows: list[tuple[str, float, float]] = []
    for name, start, stop, impulse in found:
        if impulse < least:
            continue
        joins = bool(rows) and rows[-1][0] == name
        rows = [*rows[:-1], (name, rows[-1][1], stop)] if joins else [*rows, (name, start, stop)]
    if not rows:
        raise InputError(
            demonstration.source or "demonstration", "touches nothing, so no place is worked at",
            "record the wrench as well, or give --set places=false",
        )  # fmt: skip
    return rows


def _refuse_order(
    demonstrations: Sequence[Demonstration], touches: Sequence[Sequence[tuple[str, float, float]]]
) -> NoReturn:
    orders = [[name for name, _, _ in each] for each in touches]
    odd = next((i for i, order in enumerate(orders) if order != orders[0]), len(orders) - 1)
    raise InputError(
        demonstrations[odd].source or f"demonstration {odd + 1}",
        f"visits {', '.join(orders[odd])}, and the first one {', '.join(orders[0])}, not at the same spots",
        "leave it out, or record it in the same order",
    )


def tip_of(demonstration: Demonstration) -> Float:
    """The touching point of the tool frame (3,): its tip, if named, else the tool point."""
    return demonstration.point(TIP if TIP in demonstration.meta.get("frames", {}) else None)


def path_of(demonstration: Demonstration) -> Float:
    """(T, 3) path of that point in base [m]."""
    return demonstration.pose.at(tip_of(demonstration)).position


def index_at(demonstration: Demonstration, time: float) -> int:
    """Sample at a time [s], or the last one."""
    return min(int(np.searchsorted(demonstration.time, time)), len(demonstration) - 1)


def _next(rows: Sequence[Sequence[tuple[str, float, float]]], k: int, i: int, d: Demonstration) -> tuple[float, float]:
    """End of the contact before, and start of the next one [s]."""
    before = rows[k - 1][i][2] if k else float(d.time[0])
    return before, rows[k + 1][i][1] if k + 1 < len(rows) else float(d.time[-1])


def _visit(
    demonstration: Demonstration, place: str, start: float, stop: float, between: tuple[float, float]
) -> Visit:  # fmt: skip
    time, path = demonstration.time, path_of(demonstration)
    first, last = index_at(demonstration, start), index_at(demonstration, stop)
    before, after = (index_at(demonstration, t) for t in between)
    away, gone = norm(path - path[first])[before : first + 1], norm(path - path[last])[last : after + 1]
    far, near = (before + int(np.flatnonzero(away > limit).max(initial=0)) for limit in (FAR_M, NEAR_M))
    out = [last + int(beyond[0]) for limit in (NEAR_M, FAR_M) if (beyond := np.flatnonzero(gone > limit)).size]
    leave = _turns_back(demonstration, path, first, last, out[0]) if out else after
    return Visit(
        place, float(time[far]), float(time[near]), start, float(time[leave]), tuple(float(time[i]) for i in out)
    )  # fmt: skip


def _turns_back(demonstration: Demonstration, path: Float, first: int, last: int, out: int) -> int:
    """Sample of a visit from which the tool goes, without rest, to `NEAR_M` away."""
    way = unit(path[out] - path[last])
    width = max(1, round(0.1 * demonstration.rate))  # averaging time of a speed
    speed = np.convolve(np.gradient(path @ way, demonstration.time), np.ones(width) / width, "same")
    resting = np.flatnonzero(speed[first:out] < 0.005)  # limit of a rest
    return first + int(resting[-1]) if resting.size else last
