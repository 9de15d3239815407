"""Stalls: what repeats bit for bit is no free air, no bias, no noise, no onset, and nothing is learned from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.contact import contact_evidence
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import as_meta, stalls
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import quaternion_from_matrix, rotation_matrix

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
def test_a_stall_is_an_interval(start: float, stop: float, seed: int) -> None:
    (found,) = stalls(stalled(recording(seed), start, stop))
    assert found == ("wrench", pytest.approx(start), pytest.approx(stop))
    assert "repeats one value bit for bit" in found.words()


@pytest.mark.parametrize(("start", "stop"), SPANS)
def test_a_stall_is_no_noise_and_no_contact(start: float, stop: float) -> None:
    found = contact_evidence(stalled(recording(), start, stop))
    # the quietest quarter of some 60 windows of 50 samples, each within 10 %, chosen low
    assert found.noise.quiet == pytest.approx(NOISE, rel=0.35)
    inside = [c for c in found.contacts if c[0] < stop and c[1] > start]
    assert inside == []


def test_the_level_after_a_stall_at_the_start_is_the_live_sensor_s(tmp_path: Path) -> None:
    held = stalled(recording(), 0.0, 3.9)
    held.wrench.flags.writeable = True
    held.wrench[within(held, 0.0, 3.9), 2] = 12.7  # it repeats what it read last
    found = contact_evidence(held)
    assert found.level == pytest.approx(BIAS, abs=0.05)  # 50 samples of 0.05 N: 0.007 N
    assert found.contacts[0][0] == pytest.approx(TOUCH, abs=0.05)


@pytest.mark.parametrize("channel", range(6))
def test_a_single_channel_that_stalls_is_named(channel: int) -> None:
    found = stalls(stalled(recording(), 9.0, 11.0, slice(channel, channel + 1)))
    assert found == [(("fx", "fy", "fz", "tx", "ty", "tz")[channel], 9.0, 11.0)]


def test_a_single_channel_that_repeats_for_less_than_a_second_is_no_stall() -> None:
    assert stalls(stalled(recording(), 9.0, 9.8, slice(0, 1))) == []


def test_a_pose_that_stands_still_and_jumps_has_stalled_and_one_that_waits_has_not() -> None:
    assert as_meta(stalls(frozen(recording(), 2.0, 3.0))) == [{"what": "pose", "start": 2.0, "stop": 3.0}]
    waiting = recording()
    rows = within(waiting, 2.0, 3.0)
    position, quaternion = waiting.position.copy(), waiting.quaternion.copy()
    position[rows[0] :] = np.concatenate([np.repeat(position[rows[:1]], len(rows), 0), position[rows[0] : -len(rows)]])
    quaternion[rows[0] :] = np.concatenate(
        [np.repeat(quaternion[rows[:1]], len(rows), 0), quaternion[rows[0] : -len(rows)]]
    )
    assert stalls(replace(waiting, position=position, quaternion=quaternion)) == []


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
    assert stalls(HONEST[name]()) == []


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


@pytest.mark.needs_plugins
@pytest.mark.parametrize("kind", ["lmc", "replay", "dmp", "gmr", "seds", "search"])
def test_no_learner_takes_a_demonstration_that_stalls_and_the_line_that_cuts_it_is_printed(
    kind: str, file: Callable[[Demonstration], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = file(stalled(recording(), 0.0, 3.9)), tmp_path / "skill.json"
    assert run(["learn", path, "--skill", kind, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert f"convert {path} --set from=3.905 --out cut.npz" in said
    assert not out.exists()


@pytest.mark.needs_plugins
def test_what_is_cut_off_as_printed_is_learned_from(file: Callable[[Demonstration], str], tmp_path: Path) -> None:
    cut = tmp_path / "cut.npz"
    path = file(stalled(recording(), 0.0, 3.9))
    assert run(["convert", path, "--set", "from=3.905", "--out", str(cut)]) == 0
    assert run(["learn", str(cut), "--out", str(tmp_path / "a.skill.json")]) == 0
