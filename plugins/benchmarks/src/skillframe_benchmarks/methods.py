"""Compared methods: an untaught push, a replay, and skills of two demonstrations or of taking the part out.

A method makes a skill from an assembly's recordings, with the same settings on all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from skillframe_search.straight import straight_push

from skillframe import LearnedSkill, learn
from skillframe.demonstration import Demonstration

Method = Callable[[Sequence[Demonstration]], LearnedSkill]


def push(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """A straight push down the base's z, compliant across it and in rotation.

    It uses only the tool's frames of the demonstrations.
    """
    document = {
        "format": "skillframe.skill", "version": 1, "type": "lmc", "type_version": 1, "learned_from": [],
        "created_by": {"by": "hand"}, **straight_push(demonstrations[0].meta["frames"], np.array([0.0, 0.0, -1.0])),
    }  # fmt: skip
    return LearnedSkill(document=document, name="push")


def lmc(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """Linear motion with compliance, from both demonstrations."""
    return learn(demonstrations, "lmc")


def replay(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The first demonstration's path, stiff."""
    return learn(demonstrations[:1], "replay")


def lmc_search(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The learned push with approach and search, as of `learn --skill seat`."""
    return learn(demonstrations, "seat")


def push_search(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The same approach and search around the untaught push, to show what the learned push adds."""
    made = lmc_search(demonstrations)
    by_hand = {"skill": "lmc", **push(demonstrations).document["phases"][0]}
    document = {**made.document, "phases": [by_hand, *made.document["phases"][1:]]}
    return LearnedSkill(document=document, name="push_search")


def push_spiral(demonstrations: Sequence[Demonstration]) -> LearnedSkill:
    """The untaught push and a plain spiral where it stalls."""
    return LearnedSkill(document=plain_spiral(push_search(demonstrations).document), name="push_spiral")


def plain_spiral(document: Mapping[str, Any]) -> dict[str, Any]:
    """A seating's document with its push and a plain spiral on a stall, with no approach and nothing that settles.

    12 N, 2500 N/m, pitch 0.4 mm, radius 3 mm, 12 mm/s. What a seating adds to its push stays.
    """
    spiral = document["phases"][1]
    path = {"speed": 0.012, "acceleration": 0.3, "pitch": 4e-4, "radius": 0.003, "passes": 1, "inner": 0.0}
    search = {
        **spiral, "push": {**spiral["push"], "force": 12.0}, "path": {**spiral["path"], **path}, "dither": {},
        "stiffness": {"translation": 2500.0, "rotation": 60.0, "turn": None}, "stop": {"time_s": 10.0},
    }  # fmt: skip
    seat = {**document["seat"], "approach": False, "settle_s": 0.0}
    return {**document, "phases": [document["phases"][0], search], "seat": seat}


def removal(recordings: Sequence[Demonstration]) -> LearnedSkill:
    """A straight push and the same search, learned from taking the part out, as `skillframe practise` does."""
    return learn(recordings, "seat", removal=True)


METHODS: Mapping[str, Method] = {
    "push": push, "push_spiral": push_spiral, "push_search": push_search, "lmc": lmc, "lmc_search": lmc_search,
    "replay": replay,
}  # fmt: skip
"""Methods by name."""
WITHOUT_DEMONSTRATION: Mapping[str, Method] = {"removal": removal}
