"""A replayed insertion in the simulated world: what knowing, and not knowing, where the hole is amounts to."""

import numpy as np
import pytest
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.document.file import learned
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

TILT = np.deg2rad(8.0)  # of the world's first demonstration
TILTS = np.array([TILT, -TILT])


@pytest.fixture(scope="module")
def stage():
    """A robot, a scene, and one demonstration of the peg tilted by +8 degrees."""
    robot, scene = load_robot_model("free_tool"), load_world("peg_in_hole", {})
    recording = record(robot, scene, TeacherSettings(), count=1, seed=1)
    return robot, scene, recording.demonstrations[0]


def outcomes(stage, coc, draws, **settings):
    robot, scene, demonstration = stage
    document = learned(registry().skill("replay"), [demonstration], LearnOptions(settings=settings))
    skill, setup = prepare(robot, scene, document, coc)
    rngs = [np.random.default_rng([3, i]) for i in range(len(draws["start.tilt_y"]))]
    return simulate(skill, setup, draws, rngs, duration_s=6.0).success.tolist()


@pytest.mark.parametrize("coc", [pytest.param(None, marks=pytest.mark.slow), "tip"])
def test_shifted_to_the_start_it_inserts_from_the_demonstrated_tilt_only(stage, coc):
    assert outcomes(stage, coc, {"start.tilt_y": TILTS}) == [True, False]


@pytest.mark.parametrize("coc", [pytest.param(None, marks=pytest.mark.slow), "tip"])
def test_at_the_recorded_place_it_inserts_from_either_tilt_and_misses_a_hole_that_has_moved(stage, coc):
    draws = {"start.tilt_y": np.array([TILT, -TILT, TILT]), "fixture.offset_x": np.array([0.0, 0.0, 0.02])}
    assert outcomes(stage, coc, draws, mode="absolute") == [True, True, False]
