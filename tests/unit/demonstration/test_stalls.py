"""Stalls: what repeats bit for bit is no free air, no bias, no noise, no onset, and nothing is learned from it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.conditioning.audit import audit
from skillframe.conditioning.noise import estimate_model
from skillframe.conditioning.offline import remove_bias, smooth
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import quaternion_from_matrix, rotate_spatial, rotation_matrix

NOISE = np.repeat([0.05, 0.003], 3)
BIAS = np.array([0.4, -0.3, 1.0, 0.02, 0.0, -0.01])
TOUCH, RATE, LENGTH = 7.0, 200.0, 16.0


def recording(seed: int = 0, turn: float = 0.3) -> Demonstration:
    """16 s: 30 mm/s straight down through the air to 7 s, then pressed with 12.7 N while it slides on."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, LENGTH, 1.0 / RATE)
    push = 12.7 * np.clip((time - TOUCH) / 0.05, 0.0, 1.0)
    position = np.stack(
        [0.4 + 0.0 * time, 0.02 * np.maximum(time - TOUCH, 0.0), 0.6 - 0.03 * np.minimum(time, TOUCH)], 1
    )
    position += rng.normal(scale=1e-5, size=position.shape)
    quaternion = quaternion_from_matrix(rotation_matrix(turn * (time / LENGTH)[:, None] * np.array([0.0, 0.6, 0.8])))
    wrench = BIAS + rng.normal(size=(len(time), 6)) * NOISE
    wrench[:, 1] -= 0.2 * push
    wrench[:, 2] += push
    return Demonstration(time=time, position=position, quaternion=quaternion, wrench=wrench)


def within(d: Demonstration, start: float, stop: float) -> np.ndarray:
    return np.flatnonzero((d.time >= start - 1e-9) & (d.time <= stop + 1e-9))


def stalled(d: Demonstration, start: float, stop: float, channels: slice = slice(0, 6)) -> Demonstration:
    rows, wrench = within(d, start, stop), d.wrench.copy()
    wrench[rows, channels] = wrench[rows[0], channels]
    return replace(d, wrench=wrench)


def frozen(d: Demonstration, start: float, stop: float) -> Demonstration:
    rows, position, quaternion = within(d, start, stop), d.position.copy(), d.quaternion.copy()
    position[rows], quaternion[rows] = position[rows[0]], quaternion[rows[0]]
    return replace(d, position=position, quaternion=quaternion)


SPANS = [(0.0, 3.9), (5.0, 5.5), (9.0, 10.0), (8.0, 13.0), (14.0, 15.995)]


@pytest.mark.parametrize(("start", "stop"), SPANS)
@pytest.mark.parametrize("seed", range(3))
def test_a_stall_is_an_interval_of_the_audit(start: float, stop: float, seed: int) -> None:
    found = audit(stalled(recording(seed), start, stop)).as_json()
    assert found["stalls"] == [{"what": "wrench", "start": pytest.approx(start), "stop": pytest.approx(stop)}]
    assert any("repeats one value bit for bit" in warning for warning in found["warnings"])


@pytest.mark.parametrize(("start", "stop"), SPANS)
def test_a_stall_is_no_noise_and_no_contact(start: float, stop: float) -> None:
    found = audit(stalled(recording(), start, stop))
    # the quietest quarter of some 60 windows of 50 samples, each within 10 %, chosen low
    assert found.noise == pytest.approx(NOISE, rel=0.35)
    inside = [c for c in found.contacts if c[0] < stop and c[1] > start]
    assert inside == []


def test_the_level_after_a_stall_at_the_start_is_the_live_sensor_s(tmp_path: Path) -> None:
    held = stalled(recording(), 0.0, 3.9)
    held.wrench.flags.writeable = True
    held.wrench[within(held, 0.0, 3.9), 2] = 12.7  # it repeats what it read last
    found = audit(held)
    assert found.bias == pytest.approx(BIAS, abs=0.05)  # 50 samples of 0.05 N: 0.007 N
    assert found.contacts[0][0] == pytest.approx(TOUCH, abs=0.05)


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


@pytest.mark.parametrize("channel", range(6))
def test_a_single_channel_that_stalls_is_named(channel: int) -> None:
    found = audit(stalled(recording(), 9.0, 11.0, slice(channel, channel + 1))).stalls
    assert [(s["what"], s["start"], s["stop"]) for s in found] == [
        (("fx", "fy", "fz", "tx", "ty", "tz")[channel], 9.0, 11.0)
    ]


def test_a_single_channel_that_repeats_for_less_than_a_second_is_no_stall() -> None:
    assert audit(stalled(recording(), 9.0, 9.8, slice(0, 1))).stalls == []


def test_a_pose_that_stands_still_and_jumps_has_stalled_and_one_that_waits_has_not() -> None:
    assert audit(frozen(recording(), 2.0, 3.0)).stalls == [{"what": "pose", "start": 2.0, "stop": 3.0}]
    waiting = recording()
    rows = within(waiting, 2.0, 3.0)
    position, quaternion = waiting.position.copy(), waiting.quaternion.copy()
    position[rows[0] :] = np.concatenate([np.repeat(position[rows[:1]], len(rows), 0), position[rows[0] : -len(rows)]])
    quaternion[rows[0] :] = np.concatenate(
        [np.repeat(quaternion[rows[:1]], len(rows), 0), quaternion[rows[0] : -len(rows)]]
    )
    assert audit(replace(waiting, position=position, quaternion=quaternion)).stalls == []


def held_at(d: Demonstration, every: int, pose: bool = False) -> Demonstration:
    pick = np.arange(len(d)) // every * every
    if pose:
        return replace(d, position=d.position[pick].copy(), quaternion=d.quaternion[pick].copy())
    return replace(d, wrench=d.wrench[pick].copy())


def faster(every: int) -> Demonstration:
    """A recorder at 1 kHz or more that repeats a sensor of 200 Hz."""
    d = recording()
    time = np.arange(every * len(d)) / (RATE * every)
    return replace(
        d, time=time, position=np.repeat(d.position, every, 0), quaternion=np.repeat(d.quaternion, every, 0),
        wrench=np.repeat(d.wrench, every, 0),
    )  # fmt: skip


def quantised(step: float, rest: float) -> Demonstration:
    """A sensor that resolves `step` N, whose noise at rest in the air is a share of that in contact."""
    d = recording()
    quiet = np.where((d.time < TOUCH)[:, None], rest, 1.0)
    clean = d.wrench - (noise := np.random.default_rng(5).normal(size=d.wrench.shape) * NOISE)
    wrench = clean + quiet * noise if rest else np.where(quiet == 0.0, BIAS, d.wrench)
    unit = np.repeat([step, 0.06 * step], 3)
    return replace(d, wrench=np.round(wrench / unit) * unit)


def closed_form() -> Demonstration:
    d = recording()
    force = np.where((d.time < TOUCH)[:, None], BIAS, BIAS + np.array([0.0, -2.5, 12.7, 0.0, 0.0, 0.0]))
    return replace(d, wrench=force)


def dead_zone() -> Demonstration:
    d = recording()
    return replace(d, wrench=np.where((d.time < TOUCH)[:, None], 0.0, d.wrench))


HONEST: dict[str, Callable[[], Demonstration]] = {
    "a live sensor": recording,
    "a recorder at 1 kHz with a sensor of 200 Hz": lambda: faster(5),
    "a recorder at 2 kHz with a sensor of 200 Hz": lambda: faster(10),
    "a sensor of 10 Hz recorded at 200 Hz": lambda: held_at(recording(), 20),
    "a sensor of 2 Hz recorded at 200 Hz": lambda: held_at(recording(), 100),
    "a pose of 10 Hz": lambda: held_at(recording(), 20, pose=True),
    "a sensor that resolves 0.1 N and is quieter in still air": lambda: quantised(0.1, 0.2),
    "a sensor that resolves 0.5 N": lambda: quantised(0.5, 1.0),
    "a sensor that resolves 0.05 N and is silent in still air": lambda: quantised(0.05, 0.0),
    "a closed form without noise": closed_form,
    "a dead zone": dead_zone,
    "no contact on purpose": lambda: replace(stalled(recording(), 2.0, 6.0), meta={"contact": False}),
}


@pytest.mark.parametrize("name", HONEST)
def test_what_may_repeat_is_no_stall(name: str) -> None:
    assert audit(HONEST[name]()).as_json()["stalls"] == []


def test_the_rate_of_a_pose_that_is_slower_than_the_rest_is_told() -> None:
    assert any(
        "pose: moves every 20 samples only: its rate is about 10" in w
        for w in audit(held_at(recording(), 20, True)).warnings
    )
    assert not any(w.startswith("pose:") for w in audit(recording()).warnings)


def test_metadata_that_name_no_stalls_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "demo.csv"
    for value in ("3", "[1]", '[{what = "fish", start = 0.0, stop = 1.0}]', '[{what = "wrench", start = 2, stop = 1}]'):
        write_demonstration(recording(), path)
        path.with_name("demo.meta.toml").write_text(f"stalls = {value}\n")
        with pytest.raises(InputError, match="stalls"):
            read_demonstration(path)


@pytest.fixture
def file(tmp_path: Path) -> Callable[[Demonstration], str]:
    def written(d: Demonstration) -> str:
        path = tmp_path / "demo.npz"
        write_demonstration(d, path)
        return str(path)

    return written


def test_check_shows_stalls_in_words_and_in_json(
    file: Callable[[Demonstration], str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = file(stalled(recording(), 0.0, 3.9))
    assert run(["demonstration", "check", path]) == 0
    assert "stalls   wrench 0.00-3.90 s" in capsys.readouterr().out
    assert run(["demonstration", "check", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["stalls"] == [{"what": "wrench", "start": 0.0, "stop": 3.9}]


def test_condition_refuses_a_recording_whose_free_air_is_a_stall(
    file: Callable[[Demonstration], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.npz"
    path = file(stalled(recording(), 0.0, 7.5))
    assert run(["condition", path, "--out", str(out)]) == 2
    assert "no free air is known" in capsys.readouterr().err
    assert not out.exists()
    assert run(["condition", path, "--no-bias", "--out", str(out)]) == 0
    assert "warning: the wrench repeats one value bit for bit from 0.00 to 7.50 s" in capsys.readouterr().err


@pytest.mark.needs_plugins
@pytest.mark.parametrize("kind", ["lmc", "replay", "dmp", "gmr", "seds", "search"])
def test_no_learner_takes_a_demonstration_that_stalls_and_the_line_that_cuts_it_is_printed(
    kind: str, file: Callable[[Demonstration], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = file(stalled(recording(), 0.0, 3.9)), tmp_path / "skill.json"
    assert run(["learn", path, "--skill", kind, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert f"convert {path} --from 3.905 --out cut.npz" in said
    assert not out.exists()


@pytest.mark.needs_plugins
def test_what_is_cut_off_as_printed_is_learned_from(file: Callable[[Demonstration], str], tmp_path: Path) -> None:
    cut = tmp_path / "cut.npz"
    path = file(stalled(recording(), 0.0, 3.9))
    assert run(["demonstration", "convert", path, "--from", "3.905", "--out", str(cut)]) == 0
    assert run(["learn", str(cut), "--out", str(tmp_path / "a.skill.json")]) == 0
