"""Description of a seating in words and pictures."""

from __future__ import annotations

from math import degrees, radians

from skillframe.extend import Document, Illustration, registry
from skillframe_search.handling import HANDLING as HOW
from skillframe_search.seat_document import PUSH, SEARCH, Seat, part_of, read_seat

NAMES = ((PUSH, "push"), (SEARCH, "search"))
NOWHERE = (
    "push: has no direction, since the contact showed none (below: why); only what the search lets fall in is seated; "
    "show it again, and push the part in rather than carry it"
)


def describe(document: Document) -> list[str]:
    """The lines for parts, sources of constants, and phases."""
    seat = read_seat(document)
    kinds = [document["phases"][i].get("skill") for i in (PUSH, SEARCH)]
    stall = f", {kinds[1]} where it stalls" if seat.tries else ", and fail where it stalls"
    lines = [f"seat a part {1e3 * seat.contact_m:.1f} mm deep: {'approach, ' * seat.approach}push ({kinds[0]}){stall}"]
    removal = bool(document.get("settings", {}).get("removal"))
    nowhere = goes_nowhere(document["phases"][PUSH])
    lines += [*_parts(seat, nowhere), *_sources(seat, removal)]
    for index, name in NAMES:
        sub = part_of(document, index)
        kind = registry().skill(sub["type"])
        lines += [f"{name}: {line}" for line in (kind.describe(sub) if kind.describe is not None else [kind.summary])]
    return lines


def goes_nowhere(push: Document) -> bool:
    """Whether a push has no direction."""
    parts = [part for part in push.values() if isinstance(part, dict) and "desired_direction" in part]
    return bool(parts) and all(part["desired_direction"] is None for part in parts)


def _parts(seat: Seat, nowhere: bool) -> list[str]:
    above = 1e3 * (seat.above_m - seat.contact_m)
    approach = (
        f"approach: to {above:.1f} mm above the first contact, over the demonstrated end, at "
        f"{1e3 * HOW.approach_speed:.3g} mm/s; adds that a direction some degrees off is not followed through free air"
    )
    search = (
        f"search: where the push makes less than {1e3 * HOW.progress_m:g} mm in {HOW.stall_s:g} s or rests "
        f"short of the end; adds what the fixture is off beyond chamfer and clearance; {seat.tries} times at most"
    )
    stop = (
        f"stop: nothing stops the part at its end, so the push fades over the last {1e3 * seat.stop_m:g} mm; "
        "adds that a part that nothing stops stands where it was shown"
    )
    settle = (
        f"settle: where it rests near the end, {HOW.settle_nm:g} Nm go round for {seat.settle_s:g} s and fade, and up "
        f"to {HOW.settle_n:g} N draw it to the nominal axis; adds that a loose part does not stay wedged aslant"
    )
    return [
        *([approach] if seat.approach else []),
        NOWHERE if nowhere else "push: adds the direction, and is compliant where contact guides the part",
        *([search] if seat.tries else []),
        f"catch: brakes above {1e3 * HOW.catch_m_s:.3g} mm/s along the way with {HOW.catch_ns_m:g} Ns/m; adds that a "
        "part that lets go does not hit the bottom",
        *([stop] if seat.stop_m else []),
        f"upright: pulls upright with {HOW.upright_nm_rad:g} Nm/rad until it searches or rests in the hole; adds that "
        "the part leans less where it goes straight in",
        "free: in the hole nothing of the push goes across the way; adds that a push that slants, or is compliant on "
        "one axis alone, does not jam the part",
        f"swing: at rest short of the end for {HOW.swing_s:g} s, {1e3 * HOW.swing_m:g} mm or more in the hole, it "
        "is swung to its limits; the middle is the axis of the hole, about which it pushes on; adds that it finds a "
        "second hole behind the first",
        f"rock: turns {HOW.rock_nm:g} Nm round at {HOW.rock_hz:g} Hz where the part rests after a search, then "
        f"{HOW.slow_nm:g} Nm at {HOW.slow_hz:g} Hz, then its tip on a spiral of {1e3 * HOW.tip_pitch_m:g} mm pitch; "
        "adds that it does not jam",
        *([settle] if seat.settle_s and not seat.stop_m else []),
        f"centre: at the end, but more than {1e3 * HOW.aside_m:g} mm from the nominal axis, it is drawn back until "
        f"{HOW.centre_n:g} N hold it; adds that a part in a slot that is open at an end is where it was shown",
        f"lost: more than {1e3 * (HOW.lost_m + seat.height_m):.1f} mm past the end it has missed the "
        "hole: it lifts and starts over",
    ]


def _sources(seat: Seat, removal: bool) -> list[str]:
    x, y, z = seat.end
    where = (
        f"at ({x:.4f}, {y:.4f}, {z:.4f}) m in base" if seat.place == "base" else "as far from the run's start as then"
    )
    leant = (
        f"the part leant up to {degrees(seat.leant_rad):.1f} degrees from the mean of its demonstrated ends, which the "
        "skill takes for upright: show it again, and let go once it stands as it should"
    )
    return [
        f"from the demonstrations: {'the push; ' * (not removal)}the way ({', '.join(f'{v:.3f}' for v in seat.way)}); "
        f"the end {where}; the first contact {1e3 * seat.contact_m:.1f} mm above it",
        *([leant] if seat.leant_rad > radians(2.0) else []),  # upright parts tilt less within their play
        f"from the user: the fixture may be off by {1e3 * seat.shift_m:g} mm across, {degrees(seat.tilt_rad):.3g} "
        f"degrees and {1e3 * seat.height_m:g} mm along the way (--set shift, tilt, height)",
        f"by hand (our choice): {'the push; ' * removal}the default search's force, stiffness, speed, pitch, passes "
        "and dither, all figures of catch, upright, rock, swing, settle, stall and lost; chosen by what they were "
        "worth on AutoMate's assemblies, not learned",
    ]


def explain(document: Document) -> list[Illustration]:
    """The pictures of the push, then of the search."""
    pictures = []
    for index, name in NAMES:
        sub = part_of(document, index)
        kind = registry().skill(sub["type"])
        for picture in kind.explain(sub) if kind.explain is not None else []:
            pictures.append(picture._replace(title=f"The {name}: {picture.title}"))
    return pictures
