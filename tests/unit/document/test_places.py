"""Places that recordings name, and recordings seen from them."""

from __future__ import annotations

import numpy as np
import pytest

from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import as_plain, load_places, places_of, read_places, seen_from
from skillframe.errors import InputError
from skillframe.frames import Pose, quaternion_from_matrix, rotate, rotate_spatial, rotation_matrix

PLACE = Pose(np.array([0.4, -0.2, 0.1]), rotation_matrix([0.3, -0.8, 1.9]))


def recording(**meta):
    rng = np.random.default_rng(1)
    turns = rotation_matrix(rng.normal(0.0, 0.5, (50, 3)))
    return Demonstration(
        time=np.arange(50) / 100.0, position=rng.normal(0.0, 0.1, (50, 3)), quaternion=quaternion_from_matrix(turns),
        wrench=rng.normal(0.0, 5.0, (50, 6)), meta=meta,
    )  # fmt: skip


def carried(demonstration, by):
    pose = by.compose(demonstration.pose)
    return Demonstration(
        time=demonstration.time, position=pose.position, quaternion=quaternion_from_matrix(pose.rotation),
        wrench=rotate_spatial(by.rotation, demonstration.wrench), meta=demonstration.meta,
    )  # fmt: skip


def test_a_recording_carried_along_with_its_place_is_the_same_seen_from_it():
    shown = recording()
    seen = seen_from(carried(shown, PLACE), PLACE)
    np.testing.assert_allclose(seen.position, shown.position, atol=1e-12)  # rounding of a few products of size 1
    np.testing.assert_allclose(seen.pose.rotation, shown.pose.rotation, atol=1e-12)
    np.testing.assert_allclose(seen.wrench, shown.wrench, atol=1e-12)


def test_the_power_of_the_wrench_does_not_depend_on_where_it_is_seen_from():
    shown = recording()
    seen = seen_from(shown, PLACE)
    power = [(np.diff(d.position, axis=0) * d.wrench[1:, :3]).sum(-1) for d in (shown, seen)]
    np.testing.assert_allclose(power[0], power[1], atol=1e-12)


def test_a_recording_seen_from_a_place_names_no_places_and_keeps_the_rest():
    seen = seen_from(recording(places=as_plain({"hole": PLACE}), task="board"), PLACE)
    assert seen.meta == {"task": "board"}
    assert places_of(seen) == {}


def test_places_come_back_as_they_were_written():
    pose = places_of(recording(places=as_plain({"hole": PLACE})))["hole"]
    np.testing.assert_allclose(pose.position, PLACE.position, atol=1e-15)
    np.testing.assert_allclose(rotate(pose.rotation, np.ones(3)), rotate(PLACE.rotation, np.ones(3)), atol=1e-12)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"hole": [0, 0, 0]}, "hole: is no pose"),
        ({"hole": {"position": [0, 0, 0], "turn": 3}}, "hole: is no pose"),
        ({"hole": {"position": [0, 0]}}, "hole.position: is not 3 numbers"),
        ({"hole": {"position": [0, 0, float("nan")]}}, "hole.position: is not 3 numbers"),
        ({"hole": {"position": [0, 0, 0], "quaternion": [1, 1, 0, 0]}}, "has norm 1.41, not 1"),
        (["hole"], "is not a table"),
    ],
)
def test_what_is_no_place_is_refused_by_its_name(table, said):
    with pytest.raises(InputError, match=said):
        read_places(table, "board.toml: places")


def test_a_file_of_places_is_read_and_one_without_is_refused(tmp_path):
    file = tmp_path / "places.toml"
    file.write_text("[places.hole]\nposition = [0.4, 0.0, 0.1]\n")
    pose = load_places(file)["hole"]
    assert pose.position.tolist() == [0.4, 0.0, 0.1]
    assert pose.rotation.tolist() == np.eye(3).tolist()
    file.write_text("hole = 3\n")
    with pytest.raises(InputError, match="names no places"):
        load_places(file)
