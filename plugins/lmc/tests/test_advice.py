"""What `learn` says last: how sure what was learned is, and what to do next. Each rule by itself, on one document."""

import copy

import numpy as np
import pytest
from skillframe_lmc.advice import CUT, GOOD, LIMP, NO_PUSH, OTHER_SIDE, STILL, advice
from skillframe_lmc.evidence import NOT_ONE_MOTION
from skillframe_lmc.learner import learn
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

pytestmark = pytest.mark.needs_plugins


@pytest.fixture(scope="module")
def known():
    """A phase whose push is known, from two demonstrations, and which only holds its orientation."""
    return learned(registry().skill("lmc"), list(example_demonstrations()), LearnOptions())


def with_push(document, files=2, **evidence):
    changed = copy.deepcopy(document)
    changed["learned_from"] = changed["learned_from"][:1] * files
    changed["phases"][0]["translation"]["evidence"] |= evidence
    return changed


def test_the_angle_is_the_largest_half_width_of_the_directions_that_explain_as_much(known):
    """Not that of a cone of their solid angle: a slide leaves a long and narrow set."""
    sure, then = advice(with_push(known, feasible_half_width_rad=np.radians(10.0)))
    assert (sure, then) == ("the push is known to about 10 degrees; from 2 demonstrations", GOOD)


def test_an_open_or_a_doubtful_direction_and_one_demonstration_ask_for_the_other_side(known):
    sure, then = advice(with_push(known, ambiguous=True, feasible_half_width_rad=np.radians(30.0)))
    assert sure.startswith("the push is open: up to 30 degrees to either side") and then == OTHER_SIDE
    sure, then = advice(with_push(known, message="doubtful: all went one way; look"))
    assert sure == "doubtful: all went one way; from 2 demonstrations" and then == OTHER_SIDE
    sure, then = advice(with_push(known, files=1))
    assert sure.endswith("from 1 demonstration") and then == f"{OTHER_SIDE}; one contradicts nothing"


def test_without_a_direction_nothing_is_good_to_try(known):
    limp = with_push(known, message="no one push explains what was seen")
    limp["phases"][0]["translation"] |= {"desired_direction": None, "fully_compliant": True, "compliant_axes": []}
    assert advice(limp) == (
        "no direction was found: what is free and what is held is all that was learned; from 2 demonstrations", LIMP,
    )  # fmt: skip
    partly = copy.deepcopy(limp)
    partly["phases"][0]["translation"] |= {"fully_compliant": False, "compliant_axes": [[1.0, 0.0, 0.0]]}
    assert advice(partly)[1] == NO_PUSH
    several = with_push(limp, message=f"no one push explains what was seen; {NOT_ONE_MOTION}")
    assert advice(several)[1] == CUT
    assert advice(with_push(limp, held=True))[1] == STILL


def test_a_phase_that_the_learner_gives_has_advice(known):
    document = {"learned_from": [{}], **learn(list(example_demonstrations()[:1]), LearnOptions())}
    assert advice(document)[1].startswith(f"{OTHER_SIDE}, going towards")  # one slope leaves the direction open
