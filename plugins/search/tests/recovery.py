"""An insertion with search as its exception. Where it comes to rest too early, search, then insert again."""

from functools import cache

import numpy as np

from skillframe.document.file import new_document
from skillframe.extend.registry import registry
from skillframe.sequence import Fallback, Part, Sequence

TIP = [0.0, 0.0, 0.2]
DEEP_M = 0.040  # less than this is a stall: the hole's goal is 45 mm deep, a search ends 3 mm deep


@cache
def insertion():
    """An LMC document: push down at 20 mm/s, soft sideways, at the tip."""

    def part(direction, speed, stiffness):
        return {
            "desired_direction": direction, "speed": speed, "compliant_axes": [], "fully_compliant": False,
            "stiffness": np.diag(stiffness).tolist(), "damping": np.eye(3).tolist(), "evidence": {},
        }  # fmt: skip

    # at rest: less than 0.5 mm in 0.4 s; while the push grows, the part leans by some milliradians
    stop = {"stall_s": 0.4, "stall_m": 5e-4, "stall_rad": 5e-3, "lead_force_n": 16.0, "force_limit_n": 75.0}
    body = {
        "frame": {"work_at": TIP, "learned_at": TIP, "center_of_compliance": TIP, "axes": "base"},
        "phases": [{
            "name": "insert", "translation": part([0.0, 0.0, -1.0], 0.02, [300.0, 300.0, 600.0]),
            "rotation": part(None, 0.0, [60.0] * 3), "pitch": None, "stop": stop,
        }],
    }  # fmt: skip
    return new_document(registry().skill("lmc"), body)


def inserting():
    """The insertion alone, as a composition of one part."""
    return Fallback([Part("insert", _insert, DEEP_M)])


def recovering(search):
    """The insertion with a search document as its exception."""

    def searching():
        return registry().skill("search").build(search)

    def again():
        return Sequence([Part("search", searching), Part("insert again", _insert, DEEP_M - 0.005)])

    return Fallback([Part("insert", _insert, DEEP_M), Part("recover", again)])


def _insert():
    return registry().skill("lmc").build(insertion())


def begins(journal, name):
    """When a part began by a journal [s], or None."""
    return next((time for time, text in journal if text.startswith(f"{name}: begins")), None)
