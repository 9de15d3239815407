"""What goes round and round is found, whatever its plane, and nothing else is. It is one phase, and no LMC."""

from dataclasses import replace

import numpy as np
import pytest
from skillframe_segmenter.describe import describe
from skillframe_segmenter.model import from_document
from skillframe_segmenter.observer import follow
from skillframe_segmenter.rounds import going_round, rounds
from skillframe_segmenter.segmentation import prepare, segment
from skillframe_segmenter.settings import Settings

from skillframe.extend.reading import read_demonstration
from skillframe.frames import quaternion_from_matrix, rotation_matrix
from tests.figures import quasistatic as made
from tests.figures.phases import policy
from tests.references import recordings_dir

RATE, RADIUS = 100.0, 0.05
HELD = np.diag([1.0, -1.0, -1.0])


def going(path, attitude=None):
    """Which windows go round of a tool that takes a path (T, 3) at 100 Hz, upright or in an attitude (T, 3, 3)."""
    one = made.lower_and_slide(1).demonstration
    count = len(path)
    pressed = np.tile([0.0, 0.0, 9.0, 0.0, 0.0, 0.0], (count, 1))
    turned = np.broadcast_to(HELD, (count, 3, 3)) if attitude is None else attitude
    taken = replace(
        one, time=np.arange(count) / RATE, position=path, quaternion=quaternion_from_matrix(turned),
        wrench=pressed + 1e-3 * np.random.default_rng(3).normal(size=(count, 6)),
    )  # fmt: skip
    prepared = prepare([taken], Settings(), "wrench_hmm")
    return going_round(prepared.cut[0], prepared.seen[0])


def circles(turns, seconds, radius=RADIUS, squeezed=1.0):
    angle = 2.0 * np.pi * turns * np.linspace(0.0, 1.0, int(seconds * RATE))
    return radius * np.column_stack([np.cos(angle), squeezed * np.sin(angle), 0.0 * angle])


def by_way_of(*corners, seconds):
    """Straight from corner to corner at one speed, without a stop."""
    corners = np.array(corners, dtype=float)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    s = np.linspace(0.0, way[-1], int(seconds * RATE))
    return np.column_stack([np.interp(s, way, c) for c in corners.T])


@pytest.mark.parametrize("seed", range(4))
def test_circles_go_round_in_whatever_plane_and_sense(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    assert going(circles(3.0, 4.0) @ turn.T)[2:-2].all()  # the outermost edges are means of half a bin


@pytest.mark.parametrize("squeezed", [0.4, 0.7])
def test_ellipses_go_round_at_any_speed(squeezed):
    for seconds in (2.0, 8.0):
        assert going(circles(3.0, seconds, squeezed=squeezed))[2:-2].all()


def test_an_approach_and_a_retreat_are_no_part_of_the_round():
    """Half a round's time off at most at either end, for the tightest round is found, not the turn into it."""
    wiped = circles(3.0, 4.5)
    down, up = (by_way_of(a, b, seconds=1.5) for a, b in (((0.05, 0.0, 0.2), wiped[0]), (wiped[-1], (0.05, 0.0, 0.2))))
    found = going(np.concatenate([down, wiped, up]))
    edges = np.flatnonzero(np.diff(found.astype(int))) * 0.05
    np.testing.assert_allclose(edges, [1.5, 6.0], atol=0.3)


def test_there_and_back_is_two_motions_and_no_round():
    assert not going(by_way_of((0, 0, 0), (0.1, 0, 0), (0, 0.004, 0), (0.1, 0.008, 0), (0, 0, 0), seconds=6.0)).any()


@pytest.mark.parametrize("height", [0.1, 0.04])
def test_straight_strokes_round_a_rectangle_are_strokes(height):
    """So is a tool that goes out, down, back and home: it does not turn all the time."""
    corners = [(0, 0, 0), (0.1, 0, 0), (0.1, 0, height), (0, 0, height)]
    assert not going(by_way_of(*corners, *corners, corners[0], seconds=8.0)).any()


def test_a_crank_s_handle_that_turns_along_goes_straight_for_the_tool():
    path = circles(3.0, 4.0)
    angle = 6.0 * np.pi * np.linspace(0.0, 1.0, len(path))
    assert not going(path, rotation_matrix(angle[:, None] * np.array([0.0, 0.0, 1.0])) @ HELD).any()


def test_a_hand_that_trembles_in_small_circles_goes_nowhere():
    assert not going(circles(6.0, 4.0, radius=0.004)).any()


@pytest.mark.parametrize("task", ["valley", "ls", "hose", "peg"])
@pytest.mark.slow
def test_no_task_of_straight_motions_has_a_round(task):
    prepared = prepare([m.demonstration for m in made.demonstrations(task, 11, noise=15.0)], Settings(), "wrench_hmm")
    assert prepared.going is None


@pytest.mark.slow
def test_what_one_demonstration_of_three_does_by_the_way_is_no_phase():
    wiped, straight = made.demonstrations("wipe", 21), made.demonstrations("ls", 21)
    for chosen, expected in (([*straight[:2], wiped[0]], None), ([*wiped[:2], straight[0]], 2)):
        prepared = prepare([m.demonstration for m in chosen], Settings(), "wrench_hmm")
        found = rounds(prepared.cut, prepared.seen)
        assert (found is None) if expected is None else sum(each.any() for each in found) == expected


@pytest.mark.parametrize("seed", [21, 22])
@pytest.mark.slow
def test_a_wipe_between_reach_and_retreat_is_one_phase_and_said_to_be_no_lmc(seed):
    taught = made.demonstrations("wipe", seed)
    document = policy([t.demonstration for t in taught])
    for one, row in zip(taught, document["demonstrations"], strict=True):
        assert row["labels"] == [0, 1, 2]
        np.testing.assert_allclose(row["boundaries"], one.changes, atol=0.35)
    assert document["phase_model"]["round"] == 1
    assert any("phase 2 is not an LMC" in line for line in describe(document))


def test_a_wipe_is_followed_online():
    """It takes half a round, of 2.5 s at most, until it can be told from a straight stroke."""
    taught = made.demonstrations("wipe", 21)
    document = segment([t.demonstration for t in taught], None, {}, "wrench_hmm")
    for one in taught:
        switches = follow(from_document(document["phase_model"]), one.demonstration)
        assert [phase for _, phase in switches] == [0, 1, 2]
        np.testing.assert_allclose([time for time, _ in switches[1:]], one.changes, atol=1.25)


@pytest.mark.slow
def test_all_that_goes_round_is_one_phase_whether_the_number_is_given_or_not():
    wiped = [t.demonstration.between(*t.changes) for t in made.demonstrations("wipe", 23)]
    for phases in (None, 1):
        document = segment(wiped, phases, {}, "wrench_hmm")
        assert [row["labels"] for row in document["demonstrations"]] == [[0]] * 3
        assert document["phase_model"]["round"] == 0


@pytest.mark.slow
def test_a_moved_boundary_of_the_wipe_stays_where_it_is_put():
    taught = made.demonstrations("wipe", 21)
    there = taught[1].changes[0] + 0.4
    document = policy([t.demonstration for t in taught], set_boundary=[f"2:1={there}"])
    assert document["demonstrations"][1]["boundaries"][0] == there
    assert [row["labels"] for row in document["demonstrations"]] == [[0, 1, 2]] * 3


W_FIRST = {"qw": "qx", "qx": "qy", "qy": "qz", "qz": "qw"}


@pytest.mark.parametrize("reading", ["as the header says", "w-first and in the tool's axes"])
@pytest.mark.slow
def test_the_real_wipe_is_one_phase_alike_in_all_recordings_and_said_to_be_no_lmc(reading):
    """However quaternions are read, the phase has all of the hand's label but half a second at either end."""
    base = recordings_dir()
    if base is None or not (base / "icsc_wiping").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold icsc_wiping")
    names = ("px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz")
    said = reading == "as the header says"
    given = {n: n.removeprefix("p") if said else W_FIRST.get(n, n.removeprefix("p")) for n in names}
    columns = "t=t," + ",".join(f"{n}={g}" for n, g in given.items())
    wipes = [
        read_demonstration(
            base / "icsc_wiping" / f"rim{i}.csv", columns=columns, wrench_frame="base" if said else "tool"
        )
        for i in range(3)
    ]
    document = policy(wipes)
    turning = document["phase_model"]["round"]
    for i, (one, row) in enumerate(zip(wipes, document["demonstrations"], strict=True)):
        lines = (base / "icsc_wiping" / f"rim{i}.labels.csv").read_text().split()
        start, stop = (float(one.time[int(line.split(",")[0])]) for line in lines[2:4])
        edges = [row["start"], *row["boundaries"], row["end"]]
        (k,) = (k for k, label in enumerate(row["labels"]) if label == turning)
        assert edges[k] < start + 0.5 and edges[k + 1] > stop - 0.5
    assert any(f"phase {turning + 1} is not an LMC" in line for line in describe(document))
