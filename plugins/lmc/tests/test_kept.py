"""Evidence in a skill file is checked when it is read, so that no words or pictures fail on it later."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from typing import Any

import pytest
import synthetic as syn
from skillframe_lmc.learner import learn
from skillframe_lmc.phase import read_phase

from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions


@cache
def valley() -> Document:
    return learn(syn.valley(45, 0.2), LearnOptions())


DELETE = object()
DAMAGE: dict[str, tuple[tuple[str | int, ...], Any]] = {
    "translation.evidence.message: expected text": (("message",), 5),
    "translation.evidence.held: expected true or false": (("held",), 1),
    "translation.evidence.work_teacher_j: expected a number": (("work_teacher_j",), [1.0]),
    "translation.evidence.work_teacher_j: is too large": (("work_teacher_j",), 10**400),
    "translation.evidence.pyramid_angle_rad: expected a number": (("pyramid_angle_rad",), "wide"),
    "translation.evidence: holds explained without": (("feasible_solid_angle_sr",), None),
    "translation.evidence.criterion: expected a list": (("criterion",), 1.0),
    "translation.evidence: lacks the key 'criterion'": (("criterion",), DELETE),
    "demonstrations.1.: lacks the key 'push'": (("demonstrations", 1, "push"), DELETE),
    "demonstrations.1..push.0.: expected 3 values": (("demonstrations", 1, "push", 0), [1.0]),
    "demonstrations.1..motion.0..2.: expected a number": (("demonstrations", 1, "motion", 0, 2), None),
    "demonstrations.1.: holds motion, push, edge, contact": (
        ("demonstrations", 1, "contact"),
        [],
    ),
}


@pytest.mark.parametrize("message", DAMAGE)
def test_damaged_evidence_is_named_by_its_key(message: str) -> None:
    path, value = DAMAGE[message]
    document = deepcopy(valley())
    place: Any = document["phases"][0]["translation"]["evidence"]
    for key in path[:-1]:
        place = place[key]
    if value is DELETE:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    with pytest.raises(InputError, match=message):
        read_phase(document)


def test_a_skill_written_by_hand_needs_no_evidence() -> None:
    document = deepcopy(valley())
    for part in ("translation", "rotation"):
        document["phases"][0][part]["evidence"] = {}
    assert read_phase(document).translation.evidence == {}
