"""The page of cuts: what it shows of recordings, which boundaries it lets move, and the line it begins with."""

import json
import re

import numpy as np
import pytest
from skillframe_reports.cuts import cut_of, page
from skillframe_reports.demonstration_curves import lanes_of, velocity_of

from skillframe.demonstration.record import Demonstration

ROW = {"file": "a.npz", "start": 0.0, "end": 4.0, "boundaries": [1.0, 2.0], "labels": [0, 1, 0]}
WORDS = ["policy of 2 phases", "├─ phase 1: push along -z; then phase 2", "└─ phase 2: slide <b>fast</b>; then the end"]
LINE = "skillframe segment a.npz --out p.json"


def recording(wrench=None, **extra):
    time = np.linspace(0.0, 4.0, 401)
    position = np.stack([0.02 * time, 0.0 * time, 0.3 - 0.01 * time**2], axis=1)
    quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (401, 1))
    return Demonstration(
        time=time, position=position, quaternion=quaternion, extra=extra,
        wrench=np.ones((401, 6)) if wrench is None else wrench,
    )  # fmt: skip


def document(*rows, **more):
    return {"demonstrations": list(rows), "phases": [{}, {}], "phase_min_s": 0.2, **more}


def shown(*rows, **more):
    return page(document(*rows, **more), WORDS, [recording()] * len(rows), LINE)


def data(text):
    return json.loads(re.search(r'id="cuts">(.*?)</script>', text, re.S)[1])


def test_without_moves_what_is_shown_is_what_was_found_and_what_a_boundary_goes_back_to():
    cut = cut_of(ROW, True)
    assert cut == ([1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [False, False], True)


def test_a_moved_boundary_goes_back_to_where_it_was_found():
    cut = cut_of({**ROW, "boundaries": [1.4, 2.0], "found": {**ROW}, "set": [0]}, True)
    assert (cut.rest, cut.set) == ([1.0, 2.0], [True, False])


def test_a_recording_that_followed_counts_as_without_and_goes_back_to_where_it_is():
    cut = cut_of({**ROW, "boundaries": [1.1, 2.0], "labels": [1, 0, 1], "found": {**ROW}}, True)
    assert (cut.found, cut.rest, cut.movable) == ([1.0, 2.0], [1.1, 2.0], True)


def test_a_recording_that_followed_into_other_phases_cannot_be_moved_and_says_why():
    row = {**ROW, "boundaries": [1.1], "labels": [0, 1], "found": {**ROW}}
    assert not cut_of(row, True).movable
    text = shown(row, ROW)
    assert "begin without --set-boundary" in text
    assert [each["movable"] for each in data(text)["recordings"]] == [False, True]
    assert text.count('role="slider"') == 2


def test_the_page_needs_nothing_else_and_text_from_files_stays_text():
    text = shown({**ROW, "file": "<script>alert(1)</script>"})
    assert "default-src &#x27;none&#x27;" in text
    assert not re.search(r"https?://|src=|@import|url\(", text)
    assert text.count("<script") == 2
    assert "slide &lt;b&gt;fast&lt;/b&gt;" in text


def test_the_page_holds_the_line_the_least_phase_and_every_boundary():
    text = shown(ROW, {**ROW, "file": "b.npz", "boundaries": [], "labels": [1]})
    assert data(text)["line"] == LINE
    assert data(text)["min"] == 0.2
    assert [each["shown"] for each in data(text)["recordings"]] == [[1.0, 2.0], []]
    assert text.count('class="band"') == 4
    assert "A phase keeps at least 0.2 s" in text


def test_recordings_that_name_places_are_shown_without_handles_and_told_what_to_do():
    given = document(ROW, places={})
    del given["phase_min_s"]
    text = page(given, WORDS, [recording()], LINE)
    assert 'role="slider"' not in text
    assert "<code>--set places=false</code> learns in base" in text


def test_where_nothing_is_cut_the_page_says_what_asks_for_more():
    assert "--phases sets their number" in shown({**ROW, "boundaries": [], "labels": [0]})


def test_speed_is_that_of_the_motion():
    velocity = velocity_of(recording())
    np.testing.assert_allclose(velocity[5:-5, 0], 0.02, rtol=1e-9)
    np.testing.assert_allclose(velocity[5:-5, 2], -0.02 * recording().time[5:-5], rtol=1e-6)


def test_lanes_are_position_attitude_speed_force_and_torque_with_their_norms():
    lanes = lanes_of(recording())
    told = [(re.search("<strong>(.*?)</strong> \\[(.*?)\\]", lane).groups(), lane.count("<path")) for lane in lanes]
    assert told == [(("Position", "mm"), 3), (("Orientation", "°"), 3), (("Speed", "mm/s"), 4), (("Force", "N"), 4),
                    (("Torque", "Nm"), 4)]  # fmt: skip
    assert ["|v|" in lanes[2], "|F|" in lanes[3], "|T|" in lanes[4]] == [True] * 3


@pytest.mark.parametrize("valid", [0.0, 1.0])
def test_a_force_that_is_not_valid_is_shaded(valid):
    lanes = lanes_of(recording(force_valid=np.full(401, valid)))
    assert ["doubtful" in lane for lane in lanes] == [False, False, False, valid == 0.0, valid == 0.0]


def test_a_recording_without_torques_is_drawn():
    wrench = np.ones((401, 6))
    wrench[:, 3:] = np.nan
    assert lanes_of(recording(wrench))[4].count("<path") == 0
