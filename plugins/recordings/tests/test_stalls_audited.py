"""Stalls in the audit, in the commands and in what is conditioned: no bias, noise or onset comes from one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_recordings.audit import audit
from skillframe_recordings.conditioning.offline import remove_bias, smooth
from skillframe_recordings.conditioning.wrench_model import estimate_model

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import rotate_spatial
from tests.unit.demonstration.test_stalls import BIAS, TOUCH, held_at, recording, stalled, within


@pytest.fixture
def file(tmp_path: Path) -> Callable[[Demonstration], str]:
    def written(d: Demonstration) -> str:
        write_demonstration(d, tmp_path / "demo.npz")
        return str(tmp_path / "demo.npz")

    return written


def test_a_contact_that_follows_a_stall_has_no_onset() -> None:
    assert audit(stalled(recording(), 5.0, 9.0)).onsets_unseen == [pytest.approx(9.005)]
    assert audit(stalled(recording(), 9.0, 10.0)).onsets_unseen == [pytest.approx(10.005)]
    assert audit(recording()).onsets_unseen == []


@pytest.mark.parametrize("stop", [6.9, 7.5, 9.0])
def test_a_bias_is_never_taken_from_a_stall_or_from_what_follows_one_at_the_start(stop: float) -> None:
    with pytest.raises(InputError, match=r"repeats one value .* no free air is known; name a stretch"):
        remove_bias(stalled(recording(), 0.0, stop))
    with pytest.raises(InputError, match="stalls within 0 to 1 s"):
        remove_bias(stalled(recording(), 0.0, stop), (0.0, 1.0))


@pytest.mark.parametrize(("start", "stop"), [(2.0, 6.5), (5.0, 9.0), (9.0, 14.0)])
def test_a_bias_is_that_of_the_free_air_before_a_stall(start: float, stop: float) -> None:
    held = stalled(recording(), start, stop)
    removed = remove_bias(held)
    assert removed.stretch[1] <= min(start, TOUCH)
    live = np.setdiff1d(np.arange(len(held)), within(held, start, stop))
    # bias in tool axes, which turn by 0.3 rad at most: it is constant to 30 % of 1.1 N, and contact is 12.7 N
    assert np.abs(removed.demonstration.wrench - recording().wrench + BIAS)[live].max() < 0.4


@pytest.mark.slow
def test_a_stall_is_remembered_when_the_wrench_is_smoothed_or_turned(tmp_path: Path) -> None:
    held = stalled(recording(), 9.0, 10.0)
    assert audit(smooth(held)).stalls == audit(held).stalls != []
    tool = rotate_spatial(np.swapaxes(held.pose.rotation, -1, -2), recording().wrench)
    tool[within(held, 9.0, 10.0)] = tool[within(held, 9.0, 10.0)[0]]
    turning = replace(held, wrench=tool)
    path = tmp_path / "tool.csv"
    write_demonstration(turning, path)
    read = read_demonstration(path, wrench_frame="tool")
    assert np.any(read.wrench[1810] != read.wrench[1811])  # it turns with the tool
    assert audit(read).stalls == [{"what": "wrench", "start": pytest.approx(9.0), "stop": pytest.approx(10.0)}]
    write_demonstration(smooth(read), tmp_path / "again.npz")
    assert audit(read_demonstration(tmp_path / "again.npz")).stalls == audit(read).stalls
    shifted = read_demonstration(tmp_path / "again.npz", start=8.0, zero_time=False)
    assert audit(shifted).stalls == audit(read).stalls


def test_the_noise_model_of_a_recording_is_the_same_with_a_stall_in_it() -> None:
    whole, held = recording(), stalled(recording(), 8.0, 15.0)
    live = np.ones(len(held), dtype=bool)
    live[within(held, 8.0, 15.0)] = False
    plain = estimate_model(whole.time, whole.wrench)
    assert estimate_model(held.time, held.wrench, live).noise == pytest.approx(plain.noise, rel=0.25)


def test_the_rate_of_a_pose_that_is_slower_than_the_rest_is_told() -> None:
    assert any(
        "pose: moves every 20 samples only: its rate is about 10" in w
        for w in audit(held_at(recording(), 20, True)).warnings
    )
    assert not any(w.startswith("pose:") for w in audit(recording()).warnings)


def test_check_shows_stalls_in_words_and_in_json(
    file: Callable[[Demonstration], str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = file(stalled(recording(), 0.0, 3.9))
    assert run(["check", path]) == 0
    assert "stalls   wrench 0.00-3.90 s" in capsys.readouterr().out
    assert run(["check", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["stalls"] == [{"what": "wrench", "start": 0.0, "stop": 3.9}]


def test_filter_refuses_a_recording_whose_free_air_is_a_stall(
    file: Callable[[Demonstration], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.npz"
    path = file(stalled(recording(), 0.0, 7.5))
    assert run(["filter", path, "--out", str(out)]) == 2
    assert "no free air is known" in capsys.readouterr().err
    assert not out.exists()
    assert run(["filter", path, "--no-bias", "--out", str(out)]) == 0
    assert "warning: the wrench repeats one value bit for bit from 0.00 to 7.50 s" in capsys.readouterr().err


def test_the_audit_says_that_a_stall_counts_as_nothing() -> None:
    found = audit(stalled(recording(), 5.0, 5.5))
    assert [stall["what"] for stall in found.stalls] == ["wrench"]
    assert any("repeats one value bit for bit" in warning for warning in found.warnings)
