"""Which demonstrations look like several phases: motions that are made up, and what the simulated teacher records."""

import re

import numpy as np
import pytest

from skillframe.demonstration.contact import contact_evidence
from skillframe.demonstration.phases import several_phases
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Pose, quaternion_from_matrix, rotation_matrix

RATE = 100.0
PRESS = np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0])
FREE = np.zeros(6)


def shown(*legs):
    """A demonstration of legs (seconds, displacement [m], turning [rad], wrench), after half a second of free air."""
    position, angles, wrench = [np.zeros(3)], [np.zeros(3)], [FREE]
    for seconds, move, turn, felt in [(0.5, (0, 0, 0), (0, 0, 0), FREE), *legs]:
        n = round(seconds * RATE)
        position += [position[-1] + np.array(move) * k / n for k in range(1, n + 1)]
        angles += [angles[-1] + np.array(turn) * k / n for k in range(1, n + 1)]
        wrench += [felt] * n
    noise = np.random.default_rng(0).normal(size=(len(position), 6)) * 0.01
    rotation = np.array([rotation_matrix(angle) for angle in angles])
    return Demonstration(
        time=np.arange(len(position)) / RATE, position=np.array(position),
        quaternion=quaternion_from_matrix(rotation), wrench=np.array(wrench) + noise, meta={},
    )  # fmt: skip


def said(demonstration):
    return several_phases(demonstration, contact_evidence(demonstration).contacts)


ALONG, ACROSS, STILL = (0.04, 0, 0), (0, 0.04, 0), (0, 0, 0)
SLIDE, TURN = (2.0, ALONG, STILL, PRESS), (2.0, STILL, (0, 0, 0.7), PRESS)


@pytest.mark.parametrize(
    "legs",
    [
        [(2.0, ALONG, STILL, PRESS)],
        [(2.0, ALONG, STILL, PRESS), (1.0, STILL, STILL, PRESS), (2.0, ALONG, STILL, PRESS)],  # a rest on the way
        [(2.0, ACROSS, STILL, FREE), (2.0, ALONG, STILL, PRESS)],  # the approach is free
        [(2.0, ALONG, STILL, FREE), (2.0, ACROSS, STILL, FREE)],  # nothing is touched at all
        [(0.4, (0, 0.008, 0), STILL, PRESS), (0.4, (0, -0.008, 0), STILL, PRESS), SLIDE],  # feels about
        [(2.0, STILL, (0, 0, 0.7), PRESS)],
        [(3.0, STILL, STILL, PRESS)],
    ],
    ids=["slide", "rest", "approach", "air", "feeling", "turn", "press"],
)  # fmt: skip
def test_one_motion_in_contact_looks_like_one_phase(legs):
    assert said(shown(*legs)) == ""


@pytest.mark.parametrize(
    ("legs", "words"),
    [
        ([SLIDE, (2.0, ACROSS, STILL, PRESS)], r"moves by (3.|40) mm from .* moves by (3.|40) mm another way"),
        ([SLIDE, (1.0, ACROSS, STILL, FREE), (2.0, (0, 0, -0.04), STILL, PRESS)], "another way"),
        ([(2.0, ALONG, STILL, PRESS), (2.0, (-0.04, 0, 0), STILL, PRESS)], "another way"),
        ([SLIDE, TURN], "moves by .* and turns by (3.|40) degrees another way"),
        ([(1.5, STILL, STILL, PRESS), TURN], r"it turns by (3.|40) degrees .* after 1\.[45] s in contact"),
    ],
    ids=["corner", "lifted", "back", "screw", "press then turn"],
)  # fmt: skip
def test_two_ways_in_contact_look_like_two_phases_and_both_are_told(legs, words):
    assert re.search(words, said(shown(*legs)))


def test_the_answer_is_the_same_in_another_base():
    one = shown((2.0, ALONG, STILL, PRESS), (2.0, STILL, (0, 0, 0.7), PRESS))
    turned = rotation_matrix(np.array([0.4, -1.1, 0.7]))
    pose = Pose(one.position @ turned.T, turned @ one.pose.rotation)
    wrench = np.concatenate([one.wrench[:, :3] @ turned.T, one.wrench[:, 3:] @ turned.T], axis=1)
    other = Demonstration(
        time=one.time, position=pose.position, quaternion=quaternion_from_matrix(pose.rotation), wrench=wrench, meta={}
    )
    assert said(other) == said(one) != ""


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.parametrize(
    ("world", "changes", "several"),
    [
        ("valley", {}, False), ("peg_in_hole", {}, False), ("funnel", {}, False), ("edge", {}, False),
        ("corner", {}, False), ("hose_coupler", {}, False), ("valley", {"wall_distance": 0.05}, True),
        ("hose_coupler", {"interlock": 0.7}, True),
    ],
)  # fmt: skip
@pytest.mark.figures
def test_what_the_teacher_shows_of_one_phase_is_silent_and_of_two_is_not(tmp_path, world, changes, several):
    from skillframe.cli.main import run
    from skillframe.extend.reading import read_demonstration

    settings = [word for key, value in changes.items() for word in ("--set", f"world.{key}={value}")]
    words = ["record", "--world", world, "--robot", "free_tool", "--count", "4", "--seed", "31"]
    assert run([*words, "-q", *settings, "--out", str(tmp_path / "d.npz")]) == 0
    found = [said(read_demonstration(tmp_path / f"d{i}.npz")) for i in range(1, 5)]
    share = sum(map(bool, found)) / len(found)
    assert share == 1.0 if several else share <= 0.5, found  # the note asks for more than half
