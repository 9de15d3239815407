"""Seating: what demonstrations, user and hand give, which part follows which, and what is added to the push."""

from dataclasses import replace
from math import radians, sqrt, tan
from pathlib import Path

import numpy as np
import pytest
from seat_played import DOWN, MOST_TILT, SEAT, Played, Script, known, searching
from skillframe_search import seat, seat_document
from skillframe_search.example import searching as blind
from skillframe_search.example import seated
from skillframe_search.handling import HANDLING
from skillframe_search.phase import read_phase
from skillframe_search.reach import Reach
from skillframe_search.seat import REST_S
from skillframe_search.seat_document import part_of, read_seat

from skillframe.cli.main import run as typed
from skillframe.demonstration.npz import write_npz
from skillframe.document.file import checked, learned, load
from skillframe.errors import InputError
from skillframe.extend import LearnOptions, SkillType
from skillframe.extend.registry import registry
from skillframe.frames import Pose, norm, rotation_matrix
from skillframe.skill import Observation, Skill, Status

DEPTH, GRIP = 0.012, 0.2  # of the made-up demonstrations
PUSH, SEARCH, APPROACH = seat.PUSHING, seat.SEARCHING, seat.APPROACH


def document(**settings):
    return learned(registry().skill("seat"), [seated(0.14), seated(-0.14, 1)], LearnOptions(settings=settings))


@pytest.fixture(scope="module")
def plain():
    return document()


def test_place_way_and_heights_are_those_of_the_demonstrations_tip_whatever_the_hand_did(plain):
    """The wrist moves by 28 mm as the tool is straightened, and the tip goes straight down."""
    found = read_seat(plain)
    np.testing.assert_allclose(found.way, DOWN, atol=1e-3)
    np.testing.assert_allclose(found.end, (0.4, 0.0, 0.2), atol=5e-5)  # the last sample is 5 ms before its end
    assert found.contact_m == pytest.approx(DEPTH, abs=5e-4)  # contact is seen some samples after it begins
    assert found.above_m == pytest.approx(found.contact_m + 0.005)  # they began 10 mm above it
    assert plain["frame"]["center_of_compliance"] == [0.0, 0.0, GRIP]


def test_the_push_is_learned_from_the_contact_and_not_from_the_free_air_before_it(monkeypatch):
    seen = []
    real = registry().skill("lmc")
    fake = replace(real, learn=lambda given, options: seen.extend(given) or real.learn(given, options))
    known(monkeypatch, lmc=fake)
    document()
    assert [round(each.duration, 1) for each in seen] == [1.8, 1.8]  # 1.5 s of contact, 0.3 s before it


def test_the_search_is_as_wide_as_the_user_is_unsure_and_wider_by_the_dead_band():
    """The mouth is off by the shift both ways, and by the tilt times the height of the first contact."""
    for shift, tilt, friction in ((0.002, radians(5.0), 0.5), (0.001, radians(2.0), 0.2), (0.001, radians(5.0), 0.2)):
        found = document(shift=shift, tilt=tilt, friction=friction)
        search = read_phase(part_of(found, seat_document.SEARCH))
        height = read_seat(found).contact_m
        assert search.path.radius == pytest.approx(sqrt(2.0) * (shift + tilt * height) + friction * 4.0 / 4000.0)
        assert search.stop.drop_m > 2.0 * search.path.radius * tan(tilt)  # no slope is a hole
        likely, held = sqrt(2.0) * shift, friction * 4.0 / 4000.0  # where the mouth is however high the tilt turns it
        inner = 0.0 if likely > 0.8 * (search.path.radius - held) else likely + held
        assert search.path.inner == pytest.approx(inner)


def test_a_search_is_learned_where_somebody_searched_blindfolded(tmp_path):
    write_npz(blind(), tmp_path / "blind.npz")
    found = document(blind=[str(tmp_path / "blind.npz")], search_time=7.0)
    search = read_phase(part_of(found, seat_document.SEARCH))
    assert search.exploration is not None and search.stop.time_s == 7.0
    with pytest.raises(InputError, match="has no such setting"):
        document(search_time=7.0)


def test_the_document_reads_back_and_says_where_each_figure_comes_from(plain):
    checked(plain, "it")
    words = "\n".join(registry().skill("seat").describe(plain))
    for said in ("from the demonstrations: the push", "from the user: the fixture may be off by 2 mm", "by hand"):
        assert said in words
    for part in (
        "approach: to 5.0 mm above",
        "push: adds",
        "search: where",
        "catch: brakes",
        "swing: at rest",
        "upright: pulls",
        "lost: more",
    ):
        assert part in words


@pytest.mark.parametrize(
    ("settings", "said"),
    [({"exception": "lmc"}, "lmc skill is no exception strategy; name search"), ({"shift": -1.0}, "shift"),
     ({"skill": "seat"}, "axes|phases|seat")],
)  # fmt: skip
def test_what_cannot_be_composed_is_refused_in_a_sentence(settings, said):
    with pytest.raises(InputError, match=said):
        document(**settings)


def test_demonstrations_that_seat_nothing_are_refused():
    short = seated(0.14).between(None, 1.7)
    with pytest.raises(InputError, match="seats nothing"):
        learned(registry().skill("seat"), [short], LearnOptions())


def test_parts_that_touch_only_at_the_bottom_and_rest_there_are_seated_along_the_way_that_they_came():
    """Of a wide and shallow hole contact shows a way of 1.6 mm, and the tip came straight from 10 mm above it."""
    whole = seated(0.14)
    stood = np.minimum(np.arange(len(whole.time)), np.searchsorted(whole.time, 1.7))
    stays = replace(whole, position=whole.position[stood], quaternion=whole.quaternion[stood])
    found = read_seat(learned(registry().skill("seat"), [stays], LearnOptions()))
    np.testing.assert_allclose(found.way, DOWN, atol=0.1)
    assert found.contact_m > 0.005


def test_a_push_that_rests_short_of_the_end_is_searched_for_and_one_at_the_end_is_done():
    played = Played()
    played.go()
    played.deep[:] = (-0.012, -0.0004, 0.0)
    command = played.go(HANDLING.stall_s + 0.05)
    assert command.status.tolist() == [Status.RUNNING, Status.SUCCESS, Status.SUCCESS]
    assert played.skill.current[0] == SEARCH and "seated, 0.4 mm from" in command.reason[1]


def test_a_place_that_goes_by_the_start_is_as_far_from_it_as_it_was_demonstrated():
    """The run begins 12 mm above the demonstrated end, the demonstrations 30 mm: so its end is 18 mm lower."""
    played = Played(place="start")
    played.go()
    played.deep[:] = 0.018
    command = played.go(REST_S + 0.2)
    assert (command.status == Status.SUCCESS).all() and "seated, 0.0 mm from" in command.reason[0]


def test_a_search_begins_about_the_nominal_axis_at_the_height_of_the_stall_however_far_the_tool_slid():
    played = Played()
    played.go()
    played.deep[0], played.aside[0], played.turn[0] = -0.011, 0.003, (0.2, 0.0, 0.0)
    played.push.ends = {0: Status.SUCCESS}
    played.go(0.02)
    _, pose = played.search.begun[0]
    np.testing.assert_allclose(pose.position[0], np.array(SEAT.end) - 0.011 * DOWN, atol=1e-12)
    np.testing.assert_allclose(pose.rotation[0], np.eye(3), atol=1e-12)


def test_a_tool_that_sinks_is_pushed_on_and_one_that_slides_down_a_slope_is_not():
    played = searching()
    slope = 0.003 * tan(SEAT.tilt_rad)
    played.aside[0], played.deep[0] = 0.003, -0.012 + slope + 0.9 * HANDLING.sunk_m
    played.go(0.02)
    assert played.skill.current[0] == SEARCH
    played.deep[0] = -0.012 + slope + 1.3 * HANDLING.sunk_m
    played.go(0.02)
    assert played.skill.current[0] == PUSH and "sank 1.3 mm" in played.skill.journal(0)[-1][1]


def test_a_push_after_a_search_begins_no_farther_tilted_than_the_fixture_may_be():
    played = searching()
    played.turn[0] = (0.3, 0.0, 0.0)
    played.search.ends = {0: Status.SUCCESS}
    played.go(0.02)
    rows, pose = played.push.begun[-1]
    assert rows.tolist() == [0]
    np.testing.assert_allclose(pose.rotation[0], rotation_matrix(np.array([MOST_TILT, 0.0, 0.0])), atol=1e-12)


def test_a_tool_beyond_the_end_is_lost_and_returns_as_often_as_it_is_allowed_to():
    played = searching(tries=2)
    played.deep[0] = HANDLING.lost_m + SEAT.height_m + 1e-4
    played.go(0.02)
    assert played.skill.current[0] == APPROACH and "lifts and returns" in played.skill.journal(0)[-1][1]
    played.deep[0] = -SEAT.above_m
    played.go(1.1)
    assert played.skill.current[0] != APPROACH  # it is back over the hole
    played.deep[0] = HANDLING.lost_m + SEAT.height_m + 1e-4
    command = played.go(0.02)
    assert command.status[0] == Status.FAILURE and "missed the hole" in command.reason[0]


def test_a_search_that_fails_is_the_end_and_without_search_a_stall_is():
    played = searching()
    played.search.ends = {0: Status.FAILURE}
    assert played.go(0.02).status[0] == Status.FAILURE
    played = Played(tries=0)
    command = played.go(HANDLING.stall_s + 0.1)
    assert command.status.tolist() == [Status.FAILURE] * 3
    assert "stalled 12.0 mm short of the demonstrated end" in command.reason[0]


def test_an_outside_kind_of_skill_can_be_the_exception_strategy(monkeypatch):
    """It needs a record with `exception`, and no word of this plug-in."""
    seen = []

    def wiggle(stalled):
        seen.append(stalled)
        return {"frame": stalled.frame, "phases": [{"wiggle": 1.0}]}

    known(monkeypatch, wiggle=SkillType(name="wiggle", summary="", build=lambda d: Script(), exception=wiggle))
    found = document(exception="wiggle", shift=0.001)
    assert found["phases"][seat_document.SEARCH]["skill"] == "wiggle"
    assert isinstance(seat.build(found), Skill)
    np.testing.assert_allclose(seen[0].way, DOWN, atol=1e-3)
    assert seen[0].radius == pytest.approx(sqrt(2.0) * (0.001 + seen[0].tilt * read_seat(found).contact_m))


def test_a_way_back_lifts_first_then_goes_straight_and_ends_upright():
    goal = np.array([[0.4, 0.0, 0.22]])
    skill = Reach(goal, np.eye(3), DOWN, 0.05, 0.2)
    tilted = Pose(np.array([[0.41, 0.0, 0.2]]), rotation_matrix(np.array([[0.1, 0.0, 0.0]])))
    seen = Observation(np.zeros(1), 0.01, tilted,
                       np.zeros((1, 6)), np.zeros((1, 6)))  # fmt: skip
    skill.start(seen, [np.random.default_rng(0)])
    places = []
    for time in np.arange(0.0, 1.5, 0.01):
        command = skill.step(seen._replace(time=np.array([time])))
        places.append(command.pose.position[0].copy())
        if command.status[0]:
            break
    places = np.array(places)
    lifting = places[:, 2] < 0.22 - 1e-9
    np.testing.assert_allclose(places[lifting][:, 0], 0.41)
    np.testing.assert_allclose(places[-1], goal[0], atol=1e-9)
    np.testing.assert_allclose(command.pose.rotation[0], np.eye(3), atol=1e-9)
    assert command.status[0] == Status.SUCCESS and norm(np.diff(places, axis=0)).max() < 0.05 * 0.01 + 1e-9


def test_a_way_back_stops_where_it_touches_and_refuses_to_cross_the_room():
    far = Reach(np.array([[0.4, 0.5, 0.22]]), np.eye(3), DOWN, 0.05, 0.1)
    near = Reach(np.array([[0.4, 0.0, 0.22]]), np.eye(3), DOWN, 0.05, 0.1)
    pose = Pose(np.array([[0.4, 0.0, 0.25]]), np.eye(3)[None])
    seen = Observation(np.zeros(1), 0.01, pose, np.zeros((1, 6)), np.array([[0.0, 0.0, 9.0, 0.0, 0.0, 0.0]]))
    for skill, status, said in (
        (far, Status.FAILURE, "learn with --set place=start"),
        (near, Status.SUCCESS, "touched"),
    ):
        skill.start(seen, [np.random.default_rng(0)])
        command = [skill.step(seen._replace(time=np.array([0.01 * k]))) for k in range(30)][-1]
        assert command.status[0] == status and said in command.reason[0]


@pytest.mark.slow
def test_one_command_composes_them_in_one_file_and_its_page_says_what_each_adds(tmp_path, capsys):
    files = [str(tmp_path / "1.npz"), str(tmp_path / "2.npz")]
    for file, tilt in zip(files, (0.14, -0.14), strict=True):
        write_npz(seated(tilt), Path(file))
    out = str(tmp_path / "seat.skill.json")
    assert typed(["learn", *files, "--skill", "seat", "--set", "shift=0.001", "--out", out]) == 0
    said = capsys.readouterr().out
    assert "seat a part" in said and "the fixture may be off by 1 mm across" in said and "search: press along" in said
    found = load(Path(out))
    assert (found["type"], [each["skill"] for each in found["phases"]]) == ("seat", ["lmc", "search"])
    page = tmp_path / "seat.html"
    assert typed(["show", out, "--page", str(page)]) == 0
    assert (
        "from the demonstrations: the push" in page.read_text() and "The search: Where it searches" in page.read_text()
    )


def test_what_the_command_cannot_compose_is_one_sentence(tmp_path, capsys):
    file = str(tmp_path / "1.npz")
    write_npz(seated(0.14), Path(file))
    for more, said in (
        (["--set", "exception=replay"], "is no exception strategy; name search"),
        (["--set", "exception=sarch"], "search"),
        (["--set", f"blind=['{tmp_path}/none.npz']"], "none.npz"),
        (["--axes", "phase_start"], "base axes"),
    ):
        assert typed(["learn", file, "--skill", "seat", *more, "--out", str(tmp_path / "a.json")]) == 2
        told = capsys.readouterr().err
        assert said in told and told.count("\n") == 1
