"""Skill file of a seating: `phases` (push and search) and the block `seat`."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.document import read_frame, with_center
from skillframe.errors import InputError
from skillframe.extend import Document, registry

Vector = tuple[float, float, float]
PUSH, SEARCH = 0, 1
OWN = ("phases", "seat", "type", "type_version")


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """Place of the part, its uncertainty, and what the user chose.

    Attributes:
        way: from the first contact to the end, unit vector in base axes.
        point: of the tool frame that these places refer to [m].
        end: the point when the part was seated, in base [m].
        orientation: rotation vector of the tool then, in base [rad].
        start: the point when the demonstrations began, in base [m].
        contact_m: height of the first contact over the end, along the way [m].
        leant_rad: largest demonstrated tilt at the end against `orientation` [rad]; `learn` warns of it.
        place: "base": as demonstrated; "start": relative to the start of the run.
        shift_m, tilt_rad, height_m: error of the fixture across the way, in orientation, along the way [m, rad, m].
        approach: whether it approaches first.
        tries: searches, swings and returns before it gives up; 0: it fails where the push stalls.
        stop_m: distance over which the push fades before an end that nothing stops [m]; 0: stopped.
        settle_s: near the end it is rocked for so long and until it stops turning, so that a loose part stands
            flush [s]; 0: not.
    """

    way: Vector
    point: Vector
    end: Vector
    orientation: Vector
    start: Vector
    contact_m: float
    leant_rad: float = 0.0
    place: Literal["base", "start"] = "base"
    shift_m: float = 0.002
    tilt_rad: float = radians(5.0)
    height_m: float = 0.0005
    approach: bool = True
    tries: int = 8
    stop_m: float = 0.0
    settle_s: float = 0.5

    @property
    def above_m(self) -> float:
        """Height over the end to which it approaches and lifts: 2 to 5 mm over the contact, as it was shown [m]."""
        shown = float(np.dot(np.subtract(self.end, self.start), self.way))
        return float(np.clip(shown, self.contact_m + 0.002, self.contact_m + 0.005))


def read_seat(document: Document) -> Seat:
    """The block `seat`.

    Raises:
        InputError: missing, not two phases, or a wrong key or value.
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
    """A learner's body as a phase with its kind and the keys beside `phases`.

    Raises:
        InputError: the body has not one phase.
    """
    if len(body["phases"]) != 1:
        raise InputError(f"skill type {kind}", f"has {len(body['phases'])} phases here, not one", "name another kind")
    beside = {key: value for key, value in body.items() if key != "phases"}
    return {**body["phases"][0], "skill": kind, **({"beside": beside} if beside else {})}


def check(document: Document) -> None:
    """Raise `InputError` if the document or a skill of its phases is invalid."""
    read_seat(document)
    for i in (PUSH, SEARCH):
        sub = part_of(document, i)
        kind = registry().skill(sub["type"])
        if kind.check is not None:
            try:
                kind.check(sub)
            except InputError as error:
                raise InputError(error.where.replace("phases[0]", f"phases[{i}]"), error.problem, error.fix) from None
