"""A seating in words and pictures: what each part of it adds, and where every figure comes from."""

from __future__ import annotations

from math import degrees, radians

from skillframe.extend.records import Document, Illustration
from skillframe.extend.registry import registry
from skillframe_search.seat_document import PUSH, SEARCH, Seat, part_of, read_seat

NAMES = ((PUSH, "push"), (SEARCH, "search"))
LEANS_RAD = radians(2.0)
"""Parts that were shown upright lean by less within their play, and those that were left leaning by more (ours)."""
NOWHERE = (
    "push: has no direction, since the contact showed none (below: why); only what the search lets fall in is seated; "
    "show it again, and push the part in rather than carry it"
)


def describe(document: Document) -> list[str]:
    """The seating, a line for each part of it and for each source of its figures, then its phases."""
    seat = read_seat(document)
    kinds = [document["phases"][i].get("skill") for i in (PUSH, SEARCH)]
    stall = f", {kinds[1]} where it stalls" if seat.search else ", and fail where it stalls"
    lines = [f"seat a part {1e3 * seat.contact_m:.1f} mm deep: {'approach, ' * seat.approach}push ({kinds[0]}){stall}"]
    return [*lines, *_parts(seat, goes_nowhere(document["phases"][PUSH])), *_sources(seat), *_phases(document)]


def goes_nowhere(push: Document) -> bool:
    """Whether a push has no direction, which only the phases of some kinds of skill tell."""
    parts = [part for part in push.values() if isinstance(part, dict) and "desired_direction" in part]
    return bool(parts) and all(part["desired_direction"] is None for part in parts)


def _parts(seat: Seat, nowhere: bool) -> list[str]:
    above = 1e3 * (seat.above_m - seat.contact_m)
    approach = (
        f"approach: to {above:.1f} mm above the first contact, over the demonstrated end, at "
        f"{1e3 * seat.approach_speed:.3g} mm/s; adds that a direction some degrees off is not followed through free air"
    )
    search = (
        f"search: where the push makes less than {1e3 * seat.progress_m:g} mm in {seat.stall_s:g} s or rests "
        f"short of the end; adds what the fixture is off beyond chamfer and clearance; {seat.tries} times at most"
    )
    return [
        *([approach] if seat.approach else []),
        NOWHERE if nowhere else "push: adds the direction, and gives way where the contact guides the part",
        *([search] if seat.search else []),
        f"catch: brakes above {1e3 * seat.catch_m_s:.3g} mm/s along the way with {seat.catch_ns_m:g} Ns/m; adds that a "
        "part that lets go does not hit the bottom",
        *([_stop(seat)] if seat.stop_m else []),
        f"keep: pulls back with {seat.keep_n_m:g} N/m what is farther from the nominal axis than the fixture may be "
        "off; adds that a push that slants does not pass the fixture by",
        f"lean: pulls upright with {seat.upright_nm_rad:g} Nm/rad until it searches or rests in the hole, and with "
        f"{seat.lean_nm_rad:g} beyond {degrees(seat.most_tilt_rad):.1f} degrees; adds that the part does not lie down "
        "on the rim, and leans less where it goes straight in",
        "free: in the hole nothing of the push goes across the way; adds that a push that slants, or gives way on one "
        "axis alone, does not jam the part",
        f"follow: in the hole the attitude wanted follows the measured one within {seat.follow_s:g} s, by that tilt at "
        "most; adds that a tilted hole guides the part",
        f"rock: turns {seat.rock_nm:g} Nm round at {seat.rock_hz:g} Hz where the part rests after a search, then "
        f"{seat.slow_nm:g} Nm at {seat.slow_hz:g} Hz, then its tip on a spiral of {1e3 * seat.tip_pitch_m:g} mm pitch; "
        "adds that it does not jam, and finds a second hole below the first",
        *([_settle(seat)] if seat.settle_s and not seat.stop_m else []),
        f"centre: at the end, but more than {1e3 * seat.aside_m:g} mm from the nominal axis, it is drawn back until "
        f"{seat.centre_n:g} N hold it; adds that a part in a slot that is open at an end is where it was shown",
        f"lost: more than {1e3 * (seat.lost_m + seat.height_m):.1f} mm past the end is beside the hole: it returns",
    ]


def _stop(seat: Seat) -> str:
    return (
        f"stop: the demonstrations ended without pressing, so the push fades over the last {1e3 * seat.stop_m:g} mm; "
        "adds that a part that nothing stops stands where it was shown"
    )


def _settle(seat: Seat) -> str:
    return (
        f"settle: where it rests near the end, {seat.settle_nm:g} Nm go round for {seat.settle_s:g} s and fade, and up "
        f"to {seat.settle_n:g} N draw it to the nominal axis; adds that a loose part does not stay wedged aslant"
    )


def _sources(seat: Seat) -> list[str]:
    x, y, z = seat.end
    where = (
        f"at ({x:.4f}, {y:.4f}, {z:.4f}) m in base" if seat.place == "base" else "as far from the run's start as then"
    )
    return [
        f"from the demonstrations: the push; the way ({', '.join(f'{v:.3f}' for v in seat.way)}); the end {where}; the "
        f"first contact {1e3 * seat.contact_m:.1f} mm above it",
        *([_leant(seat)] if seat.leant_rad > LEANS_RAD else []),
        f"from the user: the fixture may be off by {1e3 * seat.shift_m:g} mm across, {degrees(seat.tilt_rad):.3g} "
        f"degrees and {1e3 * seat.height_m:g} mm along the way (--set shift, tilt, height); friction "
        f"{seat.friction:g} (--set friction)",
        "by hand (our choice): the default search's force, stiffness, speed, pitch, passes and dither, all figures of "
        "catch, keep, lean, rock, settle, stall and lost; chosen by what they were worth on AutoMate's assemblies, not "
        "learned",
    ]


def _leant(seat: Seat) -> str:
    return (
        f"the part leant up to {degrees(seat.leant_rad):.1f} degrees from the mean of its demonstrated ends, which the "
        "skill takes for upright: show it again, and let go once it stands as it should"
    )


def _phases(document: Document) -> list[str]:
    lines = []
    for index, name in NAMES:
        sub = part_of(document, index)
        kind = registry().skill(sub["type"])
        lines += [f"{name}: {line}" for line in (kind.describe(sub) if kind.describe is not None else [kind.summary])]
    return lines


def explain(document: Document) -> list[Illustration]:
    """The pictures of the push, then of the search."""
    pictures = []
    for index, name in NAMES:
        sub = part_of(document, index)
        kind = registry().skill(sub["type"])
        for picture in kind.explain(sub) if kind.explain is not None else []:
            pictures.append(picture._replace(title=f"The {name}: {picture.title}"))
    return pictures
