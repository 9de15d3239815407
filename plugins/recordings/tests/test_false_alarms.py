"""Sound recordings get no warning: each test is of a kind of recording that a rule once took for damage."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_recordings.audit import audit
from skillframe_recordings.conditioning.offline import remove_bias, smooth

from skillframe.demonstration.contact import Contact
from skillframe.demonstration.faults.find import faults, refuse_faults
from skillframe.demonstration.phases import several_phases
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import stalls
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Float
from tests.sound_slides import slide

DOWN = np.array([1.0, 0.0, 0.0, 0.0])


def recording(
    time: Float, position: Float, force: Float, quaternion: Float = DOWN, noise: float = 0.05
) -> Demonstration:  # fmt: skip
    """Forces (T, 3) at a point 20 mm beyond the tool point, with white noise."""
    rng = np.random.default_rng(0)
    quaternion = np.array(np.broadcast_to(quaternion, (len(time), 4)))
    torque = np.cross(Rotation.from_quat(quaternion).apply([0.0, 0.0, 0.02]), force)
    wrench = np.concatenate([force, torque], axis=1) + noise * rng.normal(size=(len(time), 6)) * np.repeat([1, 0.02], 3)
    return Demonstration(time=time, position=position, quaternion=quaternion, wrench=wrench, source="d")


def kinds(d: Demonstration) -> set[str]:
    return {text.split(":")[0] for text in audit(d).warnings}


def read(seed: int, folder: Path) -> Demonstration:
    """A sound slide, as a person reads it."""
    each = slide(seed)
    each.write(str(folder / "slide.csv"))
    return read_demonstration(folder / "slide.csv", wrench_frame=each.frame)


def leaps(size: float, rate: float) -> Demonstration:
    """A tool held for 6 s, which then moves by a size in one sample and creeps on at 10 mm/s."""
    time = np.arange(0.0, 12.0, 1.0 / rate)
    along = np.where(time > 6.0, size + 0.01 * (time - 6.0), 0.0)
    position = np.stack([0.4 + 0.0 * time, 0.1 + 0.0 * time, 0.2 + along], axis=1)
    position += 2e-6 * np.random.default_rng(0).normal(size=position.shape)
    return recording(time, position, np.outer((time > 3.0) & (time < 6.0), [0.0, 0.0, -3.0]))


def test_a_tool_that_lets_go_does_not_jump() -> None:
    """3.4 mm in a sample of 20 Hz are 68 mm/s and 1.4 m/s^2."""
    d = leaps(0.0034, 20.0)
    assert faults(d) == []
    refuse_faults(d)


@pytest.mark.parametrize(("size", "rate"), [(0.0034, 100.0), (0.04, 20.0), (0.2, 10.0)])
def test_a_jump_needs_more_than_ten_metres_per_second_squared(size: float, rate: float) -> None:
    """34, 16 and 20 m/s^2."""
    (found,) = faults(leaps(size, rate))
    assert found.kind == "jump" and found.value == pytest.approx(size, rel=0.2)  # less the way of a sample
    with pytest.raises(InputError, match="two recordings"):
        refuse_faults(leaps(size, rate))


def bell(top: Float, resolution: float, seed: int = 0) -> Demonstration:
    """A smooth push that a sensor of 1 kHz shows in steps of its resolution."""
    time = np.arange(0.0, 7.5, 1e-3)
    force = np.outer(np.exp(-(((time - 4.2) / 0.5) ** 2)), top)
    d = recording(time, np.stack([0.1 * time, 0.0 * time, 0.0 * time], axis=1), force, noise=1e-5)
    step = resolution * np.repeat([1.0, 0.1], 3)
    return replace(d, wrench=np.round(d.wrench / step) * step)


@pytest.mark.parametrize("resolution", [0.002, 0.009, 0.05])
def test_a_smooth_top_in_steps_of_the_resolution_does_not_saturate(resolution: float) -> None:
    found = audit(bell(np.array([-2.18, 0.7, 11.0]), resolution))
    assert found.faults == []
    assert not any(text.startswith(("saturation", "wrench")) for text in found.warnings)


def test_a_channel_does_not_saturate_where_another_of_the_same_sensor_goes_further() -> None:
    time = np.arange(0.0, 6.0, 0.01)
    force = np.outer(np.sin(np.pi * time / 6.0) ** 2, [0.0, 0.0, 20.0])
    d = recording(time, np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1), force)
    wrench = d.wrench.copy()
    wrench[250:280, 0] = 5.0  # held, and the least that would be called a range
    assert not any(f.kind == "saturation" for f in faults(replace(d, wrench=wrench)))
    wrench = wrench.copy()
    wrench[:, :3] = np.minimum(wrench[:, :3], 5.0)
    assert {f.what for f in faults(replace(d, wrench=wrench)) if f.kind == "saturation"} == {"fx", "fz"}


@pytest.mark.parametrize("seed", [2, 23, 29, 31])
def test_a_file_without_a_quaternion_gets_no_word_of_one(seed: int, tmp_path: Path) -> None:
    d = read(seed, tmp_path)
    assert "rvx" in slide(seed).header
    assert d.meta["quaternion"] == "xyzw"
    swapped = replace(d, quaternion=d.quaternion[:, [3, 0, 1, 2]].copy())
    assert "quaternion" not in kinds(d) | kinds(swapped)


def test_a_tared_weight_is_no_order_of_a_quaternion() -> None:
    """0.8 kg, 60 mm from the tool point, set to zero in the first attitude; the tool turns by 60 degrees and slides."""
    time = np.arange(0.0, 7.5, 1.0 / 200.0)
    s = np.clip((time - 0.5) / 5.5, 0.0, 1.0)
    attitude = Rotation.from_rotvec(np.outer(np.radians(60.0) * s**2 * (3.0 - 2.0 * s), [0.0, 1.0, 0.3]))
    attitude = attitude * Rotation.from_quat(DOWN)
    pressed = np.outer((time > 2.5) & (time < 6.0), [-3.0, 0.0, 12.0])
    position = np.stack([0.4 + 0.02 * time, 0.0 * time, 0.0 * time], axis=1)
    d = recording(time, position, pressed, attitude.as_quat())
    gravity = np.tile([0.0, 0.0, -7.85], (len(time), 1))
    weight = np.concatenate([gravity, np.cross(attitude.apply([0.0, 0.0, 0.06]), gravity)], axis=1)
    local = np.concatenate([attitude.inv().apply(weight[:, :3]), attitude.inv().apply(weight[:, 3:])], axis=1)
    left = local - local[0]
    d = replace(d, wrench=d.wrench + np.c_[attitude.apply(left[:, :3]), attitude.apply(left[:, 3:])])
    assert "weight" in kinds(d) and "quaternion" not in kinds(d)


@pytest.mark.parametrize("seed", [0, 7, 25])
@pytest.mark.slow
def test_a_tool_that_points_down_and_turns_is_no_sign_of_another_order(seed: int, tmp_path: Path) -> None:
    assert "quaternion" not in kinds(read(seed, tmp_path))


def touch_and_slide(rest: float, early: float = 0.0) -> Demonstration:
    """Comes to rest at a table, presses at once, slides after a rest, leaves at once; the wrench early by some time."""
    time = np.arange(0.0, 6.0, 1.0 / 200.0)
    down, along, up = (np.clip((time - a) / b, 0.0, 1.0) for a, b in ((0.5, 1.45), (1.95 + rest, 2.7), (4.95, 1.0)))
    ease = [u**3 * (10.0 - 15.0 * u + 6.0 * u**2) for u in (down, along, up)]
    position = np.stack([0.06 * ease[1], 0.0 * time, 0.12 * (1.0 - ease[0]) + 0.02 * ease[2]], axis=1)
    felt = time + early
    load = 21.0 * np.clip((felt - 1.95) / 0.03, 0.0, 1.0) * np.clip((4.95 - felt) / 0.03, 0.0, 1.0)
    speed = np.interp(felt, time, np.gradient(position[:, 0], time))
    force = np.stack([-0.33 * load * np.tanh(speed / 0.002), 0.0 * load, load], axis=1)
    return recording(time, position, force)


@pytest.mark.parametrize("rest", [0.1, 0.3])
def test_a_touch_a_press_and_a_slide_on_one_clock_raise_no_alarm_of_the_clock(rest: float) -> None:
    assert "clocks" not in kinds(touch_and_slide(rest))


@pytest.mark.parametrize("seed", [16, 26, 29, 35, 39])
def test_slides_of_every_kind_on_one_clock_raise_no_alarm_of_the_clock(seed: int, tmp_path: Path) -> None:
    assert "clocks" not in kinds(read(seed, tmp_path))


def test_a_touch_of_a_third_of_a_second_at_40_hz_is_no_spike() -> None:
    time = np.arange(0.0, 6.0, 1.0 / 40.0)
    touch = 22.0 * np.clip(1.0 - np.abs(time - 3.0) / 0.1, 0.0, None)
    d = recording(time, np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1), np.outer(touch, [0.0, 0.0, 1.0]))
    assert audit(d).spikes == 0
    wrench = d.wrench.copy()
    wrench[40, 2] += 22.0
    assert audit(replace(d, wrench=wrench)).spikes == 1


def test_a_force_that_is_there_at_once_is_no_spike() -> None:
    time = np.arange(0.0, 4.0, 1.0 / 300.0)
    rings = np.exp(-np.clip(time - 2.0, 0.0, None) / 0.02) * np.cos(2.0 * np.pi * 30.0 * (time - 2.0))
    force = np.outer((time >= 2.0) * (10.0 + 10.0 * rings), [0.0, 0.0, 1.0])
    d = recording(time, np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1), force)
    assert audit(d).spikes == 0


def test_a_sensor_that_resolves_less_than_its_noise_is_not_slower_than_the_rest() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 8.0, 1.0 / 43.0)
    d = recording(time, np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1), np.zeros((len(time), 3)))
    coarse = 0.2 * np.round(rng.normal(scale=0.04, size=(len(time), 6)) / 0.2 + 0.15)
    coarse[:, 2] += np.where(time > 4.0, 8.0, 0.0)
    repeats = np.all(coarse[1:] == coarse[:-1], axis=1).mean()
    assert repeats > 0.5
    assert not any("rate is about" in text for text in audit(replace(d, wrench=coarse)).warnings)
    held = np.repeat(d.wrench[::4], 4, axis=0)[: len(time)]
    assert any("changes every 4 samples" in text for text in audit(replace(d, wrench=held)).warnings)


def vibrating(push: float = 0.0, seconds: float = 0.0) -> Demonstration:
    """No contact, turned half round, while the arm rings at 13 to 17 Hz, and 0.5 N of weight are left. Or a touch."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 6.26, 1.0 / 700.0)
    force = np.zeros((len(time), 3))
    for start, size, rate in ((0.85, 2.5, 14.0), (2.3, 5.0, 17.0), (3.1, 2.5, 15.0), (4.0, 2.0, 13.0)):
        since = np.clip(time - start, 0.0, None)
        ring = size * np.exp(-since / 0.35) * np.sin(2.0 * np.pi * rate * since)
        force += np.outer(ring, rng.normal(size=3) / 1.7)
    u = np.clip(time / 6.0, 0.0, 1.0)
    angle = np.pi * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    force += 0.25 * np.stack([np.sin(angle), np.cos(angle) - 1.0, 0.0 * angle], axis=1)
    force[:, 2] += push * ((time > 1.8) & (time < 1.8 + seconds))
    attitude = Rotation.from_rotvec(np.outer(angle, [1.0, 0.0, 0.0])).as_quat()
    return recording(time, np.tile([0.5, 0.0, 0.4], (len(time), 1)), force, attitude)


@pytest.mark.slow
def test_a_vibration_is_no_contact_before_or_after_conditioning() -> None:
    d = vibrating()
    assert audit(d).contacts == []
    assert audit(smooth(remove_bias(d).demonstration)).contacts == []


@pytest.mark.parametrize("seconds", [0.06, 0.2, 0.4])
def test_a_touch_between_vibrations_is_contact(seconds: float) -> None:
    ((start, stop, _),) = audit(vibrating(3.0, seconds)).contacts
    assert start == pytest.approx(1.8, abs=0.02) and stop == pytest.approx(1.8 + seconds, abs=0.05)


def test_pushing_to_and_fro_twice_a_second_is_contact() -> None:
    time = np.arange(0.0, 6.0, 0.01)
    force = np.outer(np.where((time > 1.0) & (time < 5.0), 5.0 * np.sin(4.0 * np.pi * time), 0.0), [1.0, 0.0, 0.0])
    found = audit(recording(time, np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1), force)).contacts
    assert found and found[0][0] < 1.1 and found[-1][1] > 4.9


def test_filter_is_advised_for_a_bias_only_where_it_finds_free_air() -> None:
    time = np.arange(0.0, 6.0, 0.01)
    position = np.stack([0.02 * time, 0.0 * time, 0.0 * time], axis=1)
    for rise, told in (
        (2.0, "`skillframe filter` takes off what was read from 0.00 to"),
        (0.05, "--free-air FROM,TO"),
    ):
        force = np.outer(np.clip((time - rise) / 0.3, 0.0, 1.0), [0.0, 0.0, 12.0]) + np.array([3.0, 0.0, 0.0])
        d = recording(time, position, force)
        (said,) = [text for text in audit(d).warnings if text.startswith("bias:")]
        assert told in said
        if "takes off" in told:
            assert "bias" not in kinds(remove_bias(d).demonstration)
        else:
            with pytest.raises(InputError, match="free air"):
                remove_bias(d)


def test_a_frame_is_refused_only_where_the_other_explains_the_force(tmp_path: Path) -> None:
    """A hand's unsteady press on a turning tool is neither weight nor bias in any axes."""
    for seed in (20, 46, 99):
        read(seed, tmp_path)


def test_a_coarse_sensors_channel_that_rests_in_a_press_does_not_stall(tmp_path: Path) -> None:
    """Seed 5010: 7.4 N in steps of 0.2 N for 1.3 s, between a landing and a slide."""
    d = read(5010, tmp_path)
    assert stalls(d) == [] == faults(d)


@pytest.mark.parametrize("aligned", [True, False])
def test_a_channel_that_rests_stalls_only_where_the_others_take_many_values(aligned: bool) -> None:
    """A channel that repeats its value for 2 s of a press: beside channels that change by a step, and by ten."""
    time = np.arange(0.0, 10.0, 0.01)
    rng = np.random.default_rng(3)
    on = np.clip((time - 3.0) / 0.05, 0.0, 1.0) * np.clip((6.0 - time) / 0.05, 0.0, 1.0)
    force = np.outer(on, [0.0, 2.5, 12.1]) + 0.5 * rng.normal(size=(len(time), 3)) * (on < 1.0)[:, None]
    force[:, 1:] += 0.06 * rng.normal(size=(len(time), 2))
    force[:, 0] += 5.02 * on
    held = np.round(force / 0.2) * 0.2
    held = held if aligned else Rotation.from_rotvec([0.7, 0.0, 0.0]).apply(held)  # as in base axes
    still = np.stack([0.4 + 0.01 * time, 0.0 * time, 0.0 * time], axis=1)
    d = recording(time, still, held, noise=0.0)
    assert np.unique(d.wrench[(time > 3.5) & (time < 5.5), 0]).size == 1
    assert [s for s in stalls(d) if s.what == "fx"] == []
    moving = held + 2.0 * np.sin(3.0 * time)[:, None] * [0.0, 1.0, 0.0]
    assert [s.what for s in stalls(recording(time, still, moving, noise=0.0)) if s.what == "fx"] == ["fx"]


@pytest.mark.parametrize("seed", [9003, 9033])
def test_a_slide_on_which_the_tool_turns_by_60_degrees_is_one_phase(seed: int, tmp_path: Path) -> None:
    d = read(seed, tmp_path)
    assert several_phases(d, [Contact(*each) for each in audit(d).contacts]) == ""


def test_a_recording_of_35_hz_has_no_clock_that_differs_by_its_own_samples(tmp_path: Path) -> None:
    assert "clocks" not in kinds(read(9029, tmp_path))
