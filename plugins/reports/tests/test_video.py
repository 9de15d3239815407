from dataclasses import fields, replace

import av
import numpy as np
import pytest
from skillframe_reports import opengl
from skillframe_reports.stage import stage_of
from skillframe_reports.video import FRAME_RATE, OWN, STOPPED, film_samples, write_film

from skillframe.errors import InputError
from tests.report_fakes import trace


@pytest.fixture(autouse=True)
def no_opengl(monkeypatch):
    monkeypatch.setattr(opengl, "backend", lambda: None)


def frames(path):
    with av.open(str(path)) as film:
        return [f.to_ndarray(format="rgb24") for f in film.decode(video=0)]


def shortened(run, count):
    arrays = {f.name: getattr(run, f.name)[:count] for f in fields(run) if f.name not in ("machine", "meta")}
    return replace(run, **arrays)


def test_a_second_of_a_run_lasts_a_second_and_the_last_sample_is_shown():
    time = np.arange(0.0, 2.0005, 0.01)
    samples = film_samples(time)
    assert len(samples) == 2 * FRAME_RATE + 1
    assert np.abs(time[samples] - np.arange(len(samples)) / FRAME_RATE).max() < 0.01
    assert samples[-1] == len(time) - 1


@pytest.mark.slow
def test_a_film_moves_and_ends_with_what_was_drawn_last(tmp_path):
    run = shortened(trace(samples=101), 4)  # of 25 samples a second
    told = []
    count, drawn_by = write_film(run, tmp_path / "run.mp4", lambda done, total: told.append((done, total)))
    assert drawn_by == OWN
    shown = frames(tmp_path / "run.mp4")
    assert len(shown) == count == len(told)
    assert told[-1] == (count, count)
    assert shown[0].shape[:2] == (560, 960)
    # the encoder changes a flat colour by a few of 255 levels; a tool that has moved changes it by a hundred
    assert np.abs(shown[0].astype(int) - shown[-1]).max() > 100
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.mp4"]


def test_a_name_that_is_no_film_and_a_trace_without_geometry_are_refused(tmp_path):
    with pytest.raises(InputError, match="not the name of a video"):
        write_film(trace(), tmp_path / "run.gif")
    bare = trace()
    bare.meta["bodies"] = []
    assert stage_of(bare) is None
    with pytest.raises(InputError, match="no geometry"):
        write_film(bare, tmp_path / "run.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_where_opengl_stops_half_way_the_whole_film_is_drawn_again_and_that_is_said(tmp_path, monkeypatch):
    def dies(stage, samples, cameras, height, name):
        yield [np.zeros((height, width, 3), dtype=np.uint8) for _, width in cameras]
        raise opengl.NoPicture("OpenGL stopped drawing")

    run = shortened(trace(samples=101), 2)
    assert write_film(run, tmp_path / "own.mp4").renderer == OWN
    monkeypatch.setattr(opengl, "backend", lambda: "egl")
    monkeypatch.setattr(opengl, "pictures", dies)
    assert write_film(run, tmp_path / "run.mp4") == (2, f"{STOPPED}OpenGL stopped drawing")
    assert np.array_equal(frames(tmp_path / "run.mp4"), frames(tmp_path / "own.mp4"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["own.mp4", "run.mp4"]
