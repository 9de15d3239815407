"""What is compared on each assembly: a push that nobody taught, a replay, and what two demonstrations teach.

A method makes a skill from the demonstrations of an assembly. All methods have the same settings on all assemblies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skillframe import LearnedSkill, learn
from skillframe.demonstration.record import Demonstration

Method = Callable[[Sequence[Demonstration]], LearnedSkill]
PUSH_N, STIFF_N_M, SPEED_M_S = 12.0, 1500.0, 0.02
"""Of the hand-written push: largest push, stiffness along it, speed. Our choice, as light as a hand."""
ACROSS, ALONG = 40.0, 120.0  # Ns/m
TURN_NM_RAD, TURN_DAMPING = 3.0, 0.3
FORCE_N = 80.0
"""Contact force that ends a trial, for every method [N]."""


def push(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """A straight push down the base's z, free across it and soft in rotation, as one would write it by hand.

    Of the demonstrations it takes the tool's frames alone.
    """
    frames = {name: list(point) for name, point in demonstrations[0].meta["frames"].items()}
    along = _diagonal(0.0, 0.0, STIFF_N_M)
    translation = {
        "desired_direction": [0.0, 0.0, -1.0], "speed": SPEED_M_S, "fully_compliant": False, "stiffness": along,
        "compliant_axes": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], "damping": _diagonal(ACROSS, ACROSS, ALONG),
    }  # fmt: skip
    rotation = {
        "desired_direction": None, "speed": 0.0, "fully_compliant": False, "compliant_axes": [],
        "stiffness": _diagonal(*[TURN_NM_RAD] * 3), "damping": _diagonal(*[TURN_DAMPING] * 3),
    }  # fmt: skip
    stop = {"lead_force_n": PUSH_N, "force_limit_n": FORCE_N, "time_limit_s": 60.0, "travel_limit_m": 0.3}
    phase: dict[str, Any] = {"pitch": None, "stop": stop}
    phase |= {"translation": {**translation, "evidence": {}}, "rotation": {**rotation, "evidence": {}}}
    document = {
        "format": "skillframe.skill", "version": 1, "type": "lmc", "type_version": 1, "learned_from": [],
        "created_by": {"by": "hand"}, "phases": [phase],
        "frame": {"axes": "base", "frames": frames, **dict.fromkeys(PLACES, frames["tip"])},
    }  # fmt: skip
    return LearnedSkill(document=document, name="push")


PLACES = ("center_of_compliance", "learned_at", "work_at")


def _diagonal(x: float, y: float, z: float) -> list[list[float]]:
    return [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]


def lmc(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """Linear motion with compliance, from both demonstrations."""
    return learn(demonstrations, "lmc")


def replay(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The first demonstration's path, stiff."""
    return learn(demonstrations[:1], "replay")


def lmc_search(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """What was learned, with an approach, and a search where it stalls, as `learn --exception search` makes it."""
    return learn(demonstrations, "lmc", exception="search")


def push_search(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The same approach and search around the push that nobody taught: what the learned push adds is the difference."""
    made = lmc_search(demonstrations)
    by_hand = {"skill": "lmc", **push(demonstrations).document["phases"][0]}
    document = {**made.document, "phases": [by_hand, *made.document["phases"][1:]]}
    return LearnedSkill(document=document, name="push_search")


def push_spiral(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The push that nobody taught, and a plain spiral where it stalls: no approach, and nothing added to the push."""
    return LearnedSkill(document=plain_spiral(push_search(demonstrations).document), name="push_spiral")


def plain_spiral(document: Mapping[str, Any]) -> dict[str, Any]:
    """A seating's document with its push, and of the rest a plain spiral alone, as one would write it by hand.

    12 N, 2500 N/m, pitch 0.4 mm, radius 3 mm, 12 mm/s, after 0.15 s without progress: our choice.
    """
    nothing = ("catch_ns_m", "lean_nm_rad", "upright_nm_rad", "rock_nm", "slow_nm", "keep_n_m", "follow_s", "centre_n")
    seat = {**document["seat"], **dict.fromkeys(nothing, 0.0), "approach": False, "stall_s": 0.15, "lost_m": 1.0}
    spiral = document["phases"][1]
    path = {"speed": 0.012, "acceleration": 0.3, "pitch": 4e-4, "radius": 0.003, "passes": 1, "inner": 0.0}
    search = {
        **spiral, "push": {**spiral["push"], "force": 12.0}, "path": {**spiral["path"], **path}, "dither": {},
        "stiffness": {"translation": 2500.0, "rotation": 60.0, "turn": None}, "stop": {"time_s": 10.0},
    }  # fmt: skip
    return {**document, "phases": [document["phases"][0], search], "seat": {**seat, "tilt_rad": 0.0}}


METHODS: Mapping[str, Method] = {
    "push": push, "push_spiral": push_spiral, "push_search": push_search, "lmc": lmc, "lmc_search": lmc_search,
    "replay": replay,
}  # fmt: skip
"""By the names that results give them."""
