"""A seating's part of the skill file: `phases`, the push and the search, each with its kind, and the block `seat`."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sqrt
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.document.frame import read_frame, with_center
from skillframe.errors import InputError
from skillframe.extend.records import Document
from skillframe.extend.registry import registry

Vector = tuple[float, float, float]
PUSH, SEARCH = 0, 1
OWN = ("phases", "seat", "type", "type_version")


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """Where the part belongs, how sure that is, and what the seating adds to its push.

    Attributes:
        way: from the first contact to the end, unit vector in base axes.
        point: of the tool frame whose place these are, its tip where it has one [m].
        end: the point when the part was seated, in base [m].
        attitude: rotation vector of the tool then, in base [rad].
        start: the point when the demonstrations began, in base [m].
        contact_m: height of the first contact over the end, along the way.
        leant_rad: how far the part leant at the end of a demonstration from the attitude that is taken, at most.
        above_m: height over the end to which it approaches and lifts.
        place: "base": where it was demonstrated; "start": as far from the run's start as it was from theirs.
        shift_m, tilt_rad, height_m: how far off the fixture may be: across the way, in attitude, along the way.
        friction: stated.
        approach, search: whether it approaches, and searches on a stall.
        approach_speed: [m/s].
        short_m: nearer to the end than this and at rest is seated; lost_m: beyond the end by more is beside the hole.
        tries: searches and returns before it gives up.
        progress_m: less than this is a stall, after stall_s on the rim, after patience_s once a search is over.
        centre_n, aside_m: at rest near the end, but farther than aside_m from the nominal axis, it is drawn back until
            more than centre_n holds it; 0 does not.
        sunk_m: deeper than the stall by this is in the hole, beside what the tilt makes of the way across.
        stop_m: the push fades over so much before the end, where nothing else stops the part; 0: the part is stopped.
        catch_m_s, catch_ns_m: faster along the way than this is braked, with this damping.
        keep_n_m: pulls back what is farther from the nominal axis than the fixture may be off, and `aside_m`.
        upright_nm_rad: pulls upright until the part has been searched for, or rests in the hole short of its end;
            lean_nm_rad: always, beyond sqrt(2) `tilt_rad`.
        follow_s: in the hole the attitude wanted follows the measured one within this; 0 does not.
        rock_nm, rock_hz: torque that turns across the way in a hole, once the tool rests in it for rock_after_s;
            slow_nm, slow_hz: the same once it rests for slow_after_s. Quickly it frees a jam, slowly it moves the tip.
        tip_pitch_m, tip_hz: where that did not help either, the tip goes round on a spiral of this pitch, so often;
            tip_nm_rad, tip_nm: with this stiffness, and this torque at most.
        settle_s, settle_nm, settle_n: at rest near the end it is rocked for so long, by a torque of up to settle_nm at
            rock_hz that fades, and drawn to the nominal axis by up to settle_n, before it is seated, and it is seated
            once it does not turn any more; 0 s leaves all that out.
    """

    way: Vector
    point: Vector
    end: Vector
    attitude: Vector
    start: Vector
    contact_m: float
    above_m: float
    leant_rad: float = 0.0
    place: Literal["base", "start"] = "base"
    shift_m: float = 0.002
    tilt_rad: float = radians(5.0)
    height_m: float = 0.0005
    friction: float = 0.5
    approach: bool = True
    search: bool = True
    approach_speed: float = 0.03
    short_m: float = 0.0005
    lost_m: float = 0.002
    tries: int = 8
    progress_m: float = 0.0003
    stall_s: float = 0.5
    patience_s: float = 2.0
    centre_n: float = 8.0
    aside_m: float = 0.001
    sunk_m: float = 0.0008
    stop_m: float = 0.0
    catch_m_s: float = 0.03
    catch_ns_m: float = 400.0
    keep_n_m: float = 3000.0
    upright_nm_rad: float = 3.0
    lean_nm_rad: float = 20.0
    follow_s: float = 0.3
    rock_nm: float = 0.4
    rock_hz: float = 4.0
    rock_after_s: float = 0.15
    slow_nm: float = 0.6
    slow_hz: float = 1.0
    slow_after_s: float = 0.75
    tip_pitch_m: float = 0.0007
    tip_hz: float = 1.25
    tip_nm_rad: float = 40.0
    tip_nm: float = 0.9
    settle_s: float = 0.0
    settle_nm: float = 0.4
    settle_n: float = 6.0

    @property
    def most_tilt_rad(self) -> float:
        """How far off a fixture may be turned that is off about two axes at once."""
        return sqrt(2.0) * self.tilt_rad

    @property
    def most_aside_m(self) -> float:
        """How far off it may be, turned about a point as far away as the hole is deep, and `aside_m`."""
        return sqrt(2.0) * (self.shift_m + self.tilt_rad * self.contact_m) + self.aside_m


def read_seat(document: Document) -> Seat:
    """The block `seat`.

    Raises:
        InputError: missing, not two phases, or a key that is unknown, missing or holds the wrong thing.
    """
    if "seat" not in document:
        raise InputError("seat", "is missing", "learn the skill again")
    seat = build(Seat, document["seat"], "seat")
    if len(document["phases"]) != 2:
        raise InputError("phases", f"a seating has a push and a search, this has {len(document['phases'])} phases",
                         "learn the skill again")  # fmt: skip
    if abs(float(np.linalg.norm(seat.way)) - 1.0) > 0.01:
        raise InputError("seat.way", "should be a unit vector", "divide it by its length")
    for name in Seat.__dataclass_fields__:
        value = getattr(seat, name)
        if isinstance(value, float | int) and not 0.0 <= value < 1e4:
            raise InputError(f"seat.{name}", f"should not be negative, is {value:g}", "fix it, or learn again")
    if not (seat.approach_speed and seat.stall_s and seat.patience_s and seat.short_m and seat.tip_hz):
        what = "approach_speed, stall_s, patience_s, short_m and tip_hz should be positive"
        raise InputError("seat", what, "fix them")
    return seat


def part_of(document: Document, index: int) -> Document:
    """Phase `index` as a skill document of its own.

    Raises:
        InputError: the phase does not name its kind of skill.
    """
    phase = document["phases"][index]
    if not isinstance(phase.get("skill"), str) or not isinstance(phase.get("beside", {}), dict):
        raise InputError(f"phases[{index}].skill", "should name a kind of skill", "learn the skill again")
    shared = {key: value for key, value in document.items() if key not in OWN}
    own = {key: value for key, value in phase.items() if key not in ("skill", "beside")}
    whole = {**shared, **phase.get("beside", {}), "type": phase["skill"], "phases": [own]}
    return with_center(whole, read_frame(document).center_of_compliance.tolist())


def as_phase(body: Document, kind: str) -> dict[str, Any]:
    """What a learner gave as a phase that names its kind and keeps what stood beside it.

    Raises:
        InputError: the body has not one phase.
    """
    if len(body["phases"]) != 1:
        raise InputError(f"skill type {kind}", f"has {len(body['phases'])} phases here, not one", "name another kind")
    beside = {key: value for key, value in body.items() if key != "phases"}
    return {**body["phases"][0], "skill": kind, **({"beside": beside} if beside else {})}


def check(document: Document) -> None:
    """Raise `InputError` if a seating's document is not as it should be, its phases' skills included."""
    read_seat(document)
    for i in (PUSH, SEARCH):
        sub = part_of(document, i)
        kind = registry().skill(sub["type"])
        if kind.check is not None:
            try:
                kind.check(sub)
            except InputError as error:
                raise InputError(error.where.replace("phases[0]", f"phases[{i}]"), error.problem, error.fix) from None
