"""A search obeys the laws of the loop's contract. `test_every_installed_plugin_conforms` checks every kind of skill."""

import numpy as np
import pytest
from skillframe_search.example import example
from skillframe_testkit.suites import SkillConformance, random_observations

from skillframe.extend.registry import registry
from skillframe.skill import rows_of

pytestmark = pytest.mark.slow


class TestSearch(SkillConformance):
    skill_type = "search"


class TestSpiral(SkillConformance):
    skill_type = "search"

    @property
    def document(self):
        return example("spiral")


class TestRandomWalk(SkillConformance):
    skill_type = "search"

    @property
    def document(self):
        return example("random_walk")


def test_a_trial_that_begins_anew_does_what_it_would_alone():
    """Bit for bit: a search entered late by one trial of a batch, as a composition does it."""
    document, rng = example(), np.random.default_rng(3)
    seen = random_observations(rng, 3, 30, 0.02)
    skill, alone = (registry().skill("search").build(document) for _ in range(2))
    skill.start(seen[0], [np.random.default_rng(i) for i in range(3)])
    for observation in seen[:10]:
        skill.step(observation)
    rows = np.array([1])
    skill.restart(rows, seen[10], [np.random.default_rng(9)])
    alone.start(rows_of(seen[10], rows), [np.random.default_rng(9)])
    for observation in seen[10:]:
        mine, single = skill.step(observation), alone.step(rows_of(observation, rows))
        np.testing.assert_array_equal(mine.pose.position[1], single.pose.position[0])
        np.testing.assert_array_equal(mine.pose.rotation[1], single.pose.rotation[0])
        np.testing.assert_array_equal(mine.feedforward[1], single.feedforward[0])
        np.testing.assert_array_equal(mine.impedance.stiffness[1], single.impedance.stiffness[0])
        assert mine.status[1] == single.status[0]
