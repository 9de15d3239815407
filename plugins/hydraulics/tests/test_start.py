"""Whether a machine can stand at a world's start, swing there and reach its goal, and the fixture that lets it."""

import dataclasses
import re

import numpy as np
import pytest
from skillframe_hydraulics.checks.pumps import swing_part
from skillframe_hydraulics.checks.start import require_start
from skillframe_hydraulics.law.hydraulic import tool_task

from plugins.hydraulics.tests.test_working_range import MACHINES, PUBLISHED, changed
from skillframe.errors import InputError
from skillframe.execution.prepare import load_world
from skillframe.robot import ClosedChain, load_model, load_robot
from skillframe.world import fixture_poses, start_poses

__all__ = ["changed"]


ROOM = {"komatsu_wa380": {"length": 0.3, "away": 0.12, "above": 0.25}}
"""Settings of `pallets` for a loader: its arm in front of a short stack, its bucket away from its dead centre."""


def refused(folder, draws=None, **changes):
    """What a run in `pallets`, of which `changes` are made, says of starts that it refuses, else ""."""
    chain = ClosedChain(load_model(load_robot(folder)))
    task, scene = tool_task(chain), dataclasses.replace(load_world("pallets", ROOM.get(folder.name, {})), **changes)
    try:
        count = len(next(iter(draws.values()))) if draws else 1
        starts = start_poses(chain.robot, scene, draws or {}, count).position
        fixtures = fixture_poses(chain.robot, draws or {}, count)
        require_start(chain, task, scene, starts, fixtures, swing_part(chain, task))
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_described_machine_has_start_swing_and_goal_of_pallets_within_reach(name):
    assert refused(MACHINES / name) == ""


FAR = {
    "bobcat_s570": ("fixture = [1.47, 0.0, 1.03]", [2.7, 0.0, 1.5]),
    "komatsu_wa380": ("fixture = [3.5, 0.0, 1.07]", [4.05, 0.0, 1.5]),
    "husqvarna_dxr310": ("fixture = [3.4, 0.0, -1.38]", [3.5, 0.0, 0.0]),
    "kubota_u17": ("fixture = [2.4, 0.0, 0.0]", [4.4, 0.5, 0.0]),
    "jcb_535_95": ("fixture = [4.6, 0.0, 0.5]", [4.6, 0.0, 30.0]),
}


@pytest.mark.parametrize("name", FAR)
def test_a_start_that_is_refused_is_accepted_with_the_fixture_that_the_sentence_gives(name, changed):
    old, far = FAR[name]
    folder = changed(name, (old, f"fixture = {far}"))
    said = refused(folder)
    assert re.search("the tool would be out of reach|the pins of arm_1 would be", said)
    (found,) = re.findall(r"write fixture = (\[.*\]) under \[workspace\] of robot.toml$", said)
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace(f"fixture = {far}", f"fixture = {found}"))
    assert refused(folder) == ""


def test_a_batch_is_refused_only_if_no_trial_of_it_can_begin_and_the_goal_moves_with_the_fixture():
    folder = MACHINES / "jcb_535_95"
    far, home = {"fixture.offset_x": np.array([9.0, 9.0])}, {"fixture.offset_x": np.array([9.0, 0.0])}
    assert "cannot begin" in refused(folder, far) and refused(folder, home) == ""
    nominal, moved = (
        refused(folder, {"fixture.offset_x": np.array([by])}, reached=((20.0, 0.0, 0.5),)) for by in (0.0, -0.25)
    )
    assert "at its goal, [24.6, 0, 1] m" in nominal and "at its goal, [24.35, 0, 1] m" in moved


def test_a_task_that_is_too_large_for_a_machine_says_so():
    said = refused(MACHINES / "jcb_535_95", reached=((0.5, 0.0, 0.5), (20.0, 0.0, 0.5)))
    assert "at its goal, [24.6, 0, 1] m, the tool would be out of reach" in said
    assert said.endswith("place start and goal nearer to each other by the world's settings")


def test_the_goal_of_pallets_is_the_corner():
    """Where its goal is reached to the millimetre; half a metre from the stop, and 0.35 m above the stack."""
    scene = load_world("pallets", {})
    np.testing.assert_allclose(np.array(scene.reached[0]) - scene.start_tip, [0.45, 0.0, -0.35], atol=1e-12)
