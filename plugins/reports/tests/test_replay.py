import base64
from dataclasses import replace

import numpy as np
import pytest
from skillframe_reports.learned import _origin
from skillframe_reports.replay import MOST_FRAMES, frame_times, run_data, scene_data, scene_key
from skillframe_reports.stage import Camera, fitted, stage_of

from skillframe.frames import norm
from tests.report_fakes import PLACE, trace


def floats(text):
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def test_frames_carry_the_poses_of_the_trace():
    run = trace()
    data = run_data(run, stage_of(run), "scene")
    poses = floats(data["poses"]).reshape(data["frames"], len(run.meta["bodies"]), 7)
    times = np.linspace(data["start"], data["stop"], data["frames"])
    for axis in range(3):
        expected = np.interp(times, run.time, run.body_position[:, 1, axis])
        assert np.abs(poses[:, 1, axis] - expected).max() < 1e-6  # float32 of lengths below a metre


def test_an_hour_gives_no_more_frames_than_a_minute():
    assert len(frame_times(np.linspace(0.0, 3600.0, 1000))) == MOST_FRAMES
    assert len(frame_times(np.array([2.0]))) >= 1


def test_runs_of_one_scene_share_its_geometry():
    first, second = trace(seed=1), trace(seed=2, success=False)
    keys = {scene_key(scene_data(stage_of(run))) for run in (first, second)}
    assert len(keys) == 1


def test_the_stage_knows_the_tool_and_cuts_only_what_stands_still_nearby():
    stage = stage_of(trace())
    assert stage.names[stage.tool] == "tool"
    assert [cut is not None for cut in stage.cut] == [True, False, False, False, False]
    assert stage.cut[0].placed(stage.position[0, 0], stage.quaternion[0, 0]).vertices[:, 1].min() > PLACE[1] - 1e-9


def test_a_fixture_in_another_arms_hand_is_cut_open_as_it_lies_at_the_end():
    run = trace()
    drift = np.linspace(0.0, 0.02, len(run.time))  # the holder gives way by 20 mm towards the viewer
    run.body_position[:, 0, 1] += drift
    names = [{**body, "name": "fixture" if i == 0 else body["name"]} for i, body in enumerate(run.meta["bodies"])]
    stage = stage_of(replace(run, meta={**run.meta, "bodies": names}))
    assert not stage.still[0] and stage.cut[0] is not None
    last = stage.cut[0].placed(stage.position[-1, 0], stage.quaternion[-1, 0])
    assert abs(last.vertices[:, 1].min() - stage.tip[-1, 1]) < 1e-9, "the plane through the tip at the end"


def test_the_close_view_looks_at_the_tip_from_near():
    stage = stage_of(trace())
    assert norm(stage.close.target - stage.tip[-1]) < 0.1
    assert stage.close.distance < 0.5 * stage.far.distance


def test_the_view_of_the_whole_scene_holds_all_of_it_and_wastes_little():
    points = np.random.default_rng(0).normal(size=(200, 3)) * [3.0, 0.4, 1.0] + [5.0, -2.0, 1.0]
    camera = fitted(points, Camera(np.zeros(3), 1.0))
    right = np.cross([0.0, 0.0, 1.0], camera.backward)
    right /= norm(right)
    seen = (points - camera.eye) @ np.stack([right, np.cross(camera.backward, right), -camera.backward]).T
    share = np.abs(seen[:, :2]) / seen[:, 2:] / (np.tan(0.5 * camera.field_of_view) * np.array([4 / 3, 1.0]))
    assert share.max() <= 1.0
    # The nearest point to an edge lies at 1 / 1.12 of the half picture at its own depth, so a little further in.
    assert share.max() > 0.75


def test_a_trace_without_bodies_has_no_stage():
    assert stage_of(trace(bodies=[])) is None


@pytest.mark.parametrize("change", [lambda q: q[..., :3], lambda q: q[:, :-1], lambda q: q[..., 0]])
def test_a_trace_whose_attitudes_do_not_fit_its_bodies_has_no_stage(change):
    run = trace()
    assert stage_of(replace(run, body_quaternion=change(run.body_quaternion))) is None


def test_sources_of_a_skill_that_are_no_list_are_left_out():
    assert not str(_origin({"learned_from": 2.5})) and "one" in str(_origin({"learned_from": [{"file": "a.npz"}]}))
