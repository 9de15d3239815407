"""A trial that begins inside something is none: it is told apart with both names and the depth, before its start."""

import dataclasses
import re

import numpy as np
import pytest
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.cli.main import run as typed
from skillframe.skill import Status
from skillframe.world.plant import START_DEPTH
from skillframe.world.scene import Geom
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

STIFF = np.diag([1000.0] * 3 + [20.0] * 3)
ABOVE = 0.001
"""Of the peg's tip over the plate at home [m]."""


def deep(depth):
    """The plate comes up beside the hole until the peg is so deep in it."""
    return {"fixture.offset_x": 0.02, "fixture.offset_z": ABOVE + np.asarray(depth)}


def test_a_start_a_millimetre_inside_the_fixture_is_no_trial_and_says_so_with_names_and_depth():
    result = run(Hold(STIFF), setup(world="peg_in_hole"), deep([0.001]), count=1, duration_s=0.1)
    assert result.ended_by[0] == "start"
    assert not result.success[0]
    assert result.failure[0] == "begins inside something: the tool is 1 mm inside the fixture"
    assert result.duration_s[0] == 0.0


def test_a_start_that_touches_by_less_than_a_tenth_of_a_millimetre_runs():
    result = run(Hold(STIFF), setup(world="peg_in_hole"), deep([5e-5, 0.9e-4, 1.1e-4]), count=3, duration_s=0.1)
    assert [*result.ended_by] == ["time", "time", "start"]
    assert START_DEPTH == 1e-4


def test_a_refused_start_leaves_the_trials_beside_it_as_they_are_to_the_last_bit():
    push = Push((0.0, 0.0, -1.0), impedance(free_axes="x"), stall=False)
    alone = run(push, setup(world="peg_in_hole"), deep([-0.001]), count=1, duration_s=0.3)
    beside = run(push, setup(world="peg_in_hole"), deep([-0.001, 0.004]), count=2, duration_s=0.3)
    assert [*beside.ended_by] == ["time", "start"]
    assert beside.peak_force_n[0] == alone.peak_force_n[0] > 1.0
    assert beside.status[0] == alone.status[0] == Status.RUNNING


def test_a_link_in_the_fixture_is_refused_from_a_tenth_of_a_millimetre_on():
    """A ball beside link 1, pushed in by as much as its distance was, and more: drawn shapes tell how deep."""
    now = setup("panda", "free")

    def beside(x):
        at = np.array([x, 0.0, 0.35]) - now.robot.spec.workspace.fixture
        ball = Geom(kind="sphere", size=(0.02,), position=tuple(at.tolist()))
        task = dataclasses.replace(now.scene, fixture=(*now.scene.fixture, ball))
        return run(Hold(STIFF), dataclasses.replace(now, scene=task), duration_s=0.002)

    touch = 0.1 - beside(0.1).distance_to_collision_m[0]
    ends = {depth: beside(touch - depth) for depth in (5e-5, 5e-4)}
    assert ends[5e-5].ended_by[0] == "time"
    assert ends[5e-4].ended_by[0] == "start"
    assert re.fullmatch(
        r"begins inside something: link 'link1' is 0\.[1-5] mm inside the fixture", ends[5e-4].failure[0]
    )


@pytest.mark.parametrize("name", [record.name for record in world_types()])
def test_no_shipped_world_begins_inside_something_at_home_or_where_a_person_begins(name):
    now = setup("free_tool", name, point=(0.0, 0.0, 0.0))
    starts = [{}, *now.scene.task.starts]
    draws = {key: [float(each.get(key, 0.0)) for each in starts] for key in {key for each in starts for key in each}}
    assert "start" not in run(Hold(STIFF), now, draws, count=len(starts), duration_s=0.001).ended_by


@pytest.mark.needs_plugins
def test_run_refuses_a_start_inside_the_fixture_in_a_sentence_and_exits_with_2(tmp_path, capsys):
    from skillframe_testkit.checks.examples import example_demonstrations

    from skillframe.extend.reading import write_demonstration

    write_demonstration(example_demonstrations()[0], tmp_path / "left.npz")
    words = ["run", f"lmc:{tmp_path / 'left.npz'}", "--world", "peg_in_hole", "--robot", "free_tool"]
    inside = ["--set", "fixture.offset_x=20mm", "--set", "fixture.offset_z=2mm", "--out", str(tmp_path / "run.npz")]
    assert typed([*words, *inside]) == 2
    said = capsys.readouterr().err
    assert "the start: is no trial: the tool is 1 mm inside the fixture; move it with start.offset_x" in said
    assert not (tmp_path / "run.npz").exists()
    touching = ["--set", "fixture.offset_x=20mm", "--set", "fixture.offset_z=1.05mm", "--duration", "0.1"]
    assert typed([*words, *touching]) == 1
