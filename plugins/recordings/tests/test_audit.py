from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from skillframe_recordings.audit import audit, compared

from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, quaternion_from_matrix, rotate_spatial, rotation_matrix


def with_time(demo: Demonstration, change: Callable[[Float], Float]) -> Demonstration:
    return replace(demo, time=change(demo.time.copy()))


def with_wrench(demo: Demonstration, change: Callable[[Float], Float | None]) -> Demonstration:
    wrench = demo.wrench.copy()
    result = change(wrench)
    return replace(demo, wrench=wrench if result is None else result)


def gap(time: Float) -> Float:
    time[120:] += 0.5
    return time


def jittered(time: Float) -> Float:
    return time + np.random.default_rng(0).uniform(0.0, 0.004, len(time))


def spiked(wrench: Float) -> None:
    wrench[30, 2] = 277.0


def drifted(wrench: Float) -> None:
    wrench[100:140, 2] += 30.0
    wrench[140:, :] = np.random.default_rng(4).normal(scale=0.02, size=(60, 6))
    wrench[140:, 2] += 1.0


def zeroed(wrench: Float) -> None:
    wrench[:, 4] = 0.0


def pasted(wrench: Float) -> None:
    wrench[:, 3] = wrench[:, 1]


def held(wrench: Float) -> None:
    wrench[:] = np.repeat(wrench[::5], 5, axis=0)


WARNINGS: dict[str, tuple[Callable[[Demonstration], Demonstration], str]] = {
    "a gap": (lambda d: with_time(d, gap), "gaps: 1 of more than 3 periods, the longest 0.51 s at t = 1.190 s"),
    "jitter": (lambda d: with_time(d, jittered), "jitter:"),
    "nanoseconds": (lambda d: with_time(d, lambda t: t * 1e9), "suggests another unit of time"),
    "a rate that is not the metadata's": (lambda d: replace(d, meta={"rate": 125}), "metadata says 125 Hz"),
    "millimetres": (lambda d: replace(d, position=d.position * 1e3), "millimetres"),
    "a jump in position": (
        lambda d: replace(d, position=d.position + 0.2 * (np.arange(200) > 80)[:, None]),
        "jump: the tool point jumps by 34",
    ),
    "a channel of zeros": (lambda d: with_wrench(d, zeroed), "ty: is exactly 0 throughout"),
    "a pasted channel": (lambda d: with_wrench(d, pasted), "fy and tx are identical"),
    "held values": (lambda d: with_wrench(d, held), "wrench: changes every 5 samples only: its rate is about 20 Hz"),
    "forces of 1e6 N": (lambda d: with_wrench(d, lambda w: w * 1e5), "force: up to 1.0"),
    "torques in Nmm": (lambda d: with_wrench(d, lambda w: np.add(w, [0, 0, 0, 0, 90.0, 0])), "lever arm of"),
    "a spike": (lambda d: with_wrench(d, spiked), "spikes: 1 sample, the largest 277.0 N at t = 0.300 s"),
    "bias": (lambda d: with_wrench(d, lambda w: np.add(w, [1.0, -2.0, 20.0, 0, 0, 0])), "bias: 20.1"),
    "drift": (lambda d: with_wrench(d, drifted), "drift: the free-air level moved by 1.0"),
    "no contact": (lambda d: with_wrench(d, lambda w: 0.05 * w), "contact: none found"),
    "the teacher's wrench": (lambda d: with_wrench(d, lambda w: -w), "wrench sign: it pushes the tool along"),
    "no motion": (
        lambda d: replace(d, position=0 * d.position + 0.3, quaternion=np.tile([0.0, 0, 0, 1], (200, 1))),
        "nothing to learn",
    ),
}


@pytest.mark.parametrize("name", WARNINGS)
def test_what_the_data_suggest_is_a_warning_with_its_evidence(demo: Demonstration, name: str) -> None:
    change, text = WARNINGS[name]
    assert not any(text in w for w in audit(demo).warnings)
    assert any(text in w for w in audit(change(demo)).warnings), audit(change(demo)).warnings


def test_a_recording_without_contact_on_purpose_is_audited_without_complaint(demo: Demonstration) -> None:
    free = with_wrench(demo, lambda wrench: 0.0 * wrench)
    assert not any("lever" in w or "force:" in w for w in audit(free).warnings)


def test_a_recording_in_contact_from_start_to_end_is_not_told_that_it_may_have_no_contact(demo: Demonstration) -> None:
    rng = np.random.default_rng(0)
    push = np.array([0.0, 0.0, 8.0, 0.0, 0.0, 0.0]) + rng.normal(size=(200, 6)) * np.repeat([1.0, 0.05], 3)
    said = " ".join(audit(replace(demo, wrench=push)).warnings)
    assert "none found beyond the 8." in said
    assert "contact = false" not in said


def test_a_clean_demonstration_has_no_warnings(demo: Demonstration) -> None:
    found = audit(demo)
    assert found.warnings == []
    assert found.usable
    json.dumps(found.as_json(), allow_nan=False)


def test_the_figures_are_those_the_demonstration_was_made_with(demo: Demonstration) -> None:
    found = audit(demo)
    assert found.rate_hz == pytest.approx(100.0)
    assert found.duration_s == pytest.approx(1.99)
    assert found.path_m == pytest.approx(np.sqrt(0.05**2 + 0.02**2 + 0.1**2), rel=1e-6)
    assert found.turned_rad == pytest.approx(0.5, rel=1e-6)
    # the quietest quarter of eight windows of 25 samples: each scatters by 1/sqrt(50) = 14 %, chosen low
    assert found.noise[0] == pytest.approx(0.05, rel=0.4)
    assert found.contacts[0][0] == pytest.approx(1.0, abs=0.02)
    assert found.contacts[0][1] == pytest.approx(1.99)
    assert found.contacts[0][2] == pytest.approx(np.sqrt(109.0), abs=0.3)


def test_stillness_is_not_usable_and_turning_on_the_spot_is(demo: Demonstration) -> None:
    still = replace(demo, position=0 * demo.position)
    assert audit(still).usable
    assert not audit(replace(still, quaternion=np.tile([0.0, 0, 0, 1], (200, 1)))).usable


@pytest.mark.parametrize("axis", [[1.0, 0.2, 0.1], [0.1, -1.0, 0.3], [0.4, 0.3, 0.8]])
def test_a_recorder_that_keeps_w_positive_tells_which_number_is_w(demo: Demonstration, axis: list[float]) -> None:
    turn = np.linspace(np.pi - 0.3, np.pi + 0.3, 200)[:, None] * np.array(axis) / np.linalg.norm(axis)
    right = replace(demo, quaternion=quaternion_from_matrix(rotation_matrix(turn)))  # w >= 0: its sign turns at pi
    assert not any("w-first" in w for w in audit(right).warnings)
    wrong = replace(right, quaternion=np.roll(right.quaternion, 1, axis=1).copy())
    assert any("its sign is turned 1 times so that qx is never negative" in w for w in audit(wrong).warnings)
    assert not any("w-first" in w for w in audit(replace(wrong, meta={"quaternion": "xyzw"})).warnings)


def test_a_tool_that_points_down_and_turns_a_little_is_not_taken_for_w_first(demo: Demonstration) -> None:
    tilt = rotation_matrix(0.02 * np.random.default_rng(0).normal(size=(200, 3)).cumsum(axis=0) / 10.0)
    down = replace(demo, quaternion=quaternion_from_matrix(tilt @ np.diag([1.0, -1.0, -1.0])))
    assert np.abs(down.quaternion[:, 0]).min() > 0.9
    assert not any("w-first" in w for w in audit(down).warnings)


def test_a_scalar_part_that_passes_zero_while_x_does_not_is_no_evidence(demo: Demonstration) -> None:
    """A tool that points down and turns by 30 degrees about x does that."""
    w = np.linspace(-0.2, 0.4, 200)
    rest = np.sqrt(1.0 - w**2)[:, None] * np.array([0.4, 0.8, -np.sqrt(0.2)])
    found = audit(replace(demo, quaternion=np.column_stack([rest, w]))).warnings
    assert not any("w-first" in text for text in found)


def test_a_lever_s_torque_takes_back_what_its_force_gives_and_is_not_taken_for_the_teacher_s(
    demo: Demonstration,
) -> None:
    rotation = rotation_matrix(np.linspace(0.0, 0.8, 200)[:, None] * np.array([0.0, 1.0, 0.0]))
    arm = rotation @ np.array([0.0, 0.0, 0.1])  # from the edge that the tool turns on to the tool's point
    push = 10.0 * np.cross([0.0, 1.0, 0.0], arm) / 0.1  # of the edge, along the point's motion
    turned = replace(demo, position=0.3 + arm, quaternion=quaternion_from_matrix(rotation))
    whole = replace(turned, wrench=np.hstack([push, np.cross(-arm, push)]))
    assert not any("wrench sign" in w for w in audit(whole).warnings)
    bare = replace(turned, wrench=np.hstack([push, np.zeros((200, 3))]))
    assert any("wrench sign" in w for w in audit(bare).warnings)


def test_a_wrench_left_in_tool_axes_is_suspected(demo: Demonstration) -> None:
    rotation = rotation_matrix(np.linspace(0.0, 2.0, 200)[:, None] * np.array([1.0, 0.3, 0.1]))
    base = rotate_spatial(rotation, np.array([5.0, -3, 8, 0, 0, 0])) + weight_wrench(rotation, 0.9, np.zeros(3))
    turning = replace(demo, quaternion=quaternion_from_matrix(rotation))
    noise = np.random.default_rng(0).normal(scale=0.05, size=(200, 6))
    tool = replace(turning, wrench=rotate_spatial(np.swapaxes(rotation, -1, -2), base) + noise)
    assert any("wrench frame" in w for w in audit(tool).warnings)
    assert not any("wrench frame" in w for w in audit(replace(turning, wrench=base + noise)).warnings)


def test_the_one_demonstration_of_five_that_wanders_off_is_named(demo: Demonstration) -> None:
    turn = np.array([[np.cos(0.42), -np.sin(0.42), 0], [np.sin(0.42), np.cos(0.42), 0], [0, 0, 1]])
    flat = replace(demo, position=demo.position * [1, 1, 0])
    demos = [flat, flat, replace(flat, position=flat.position @ turn.T), flat, flat]
    found = compared(demos, [audit(d) for d in demos])
    assert ["direction: 24 degrees off the other recordings' mean" in a.warnings for a in found] == [
        False, False, True, False, False,
    ]  # fmt: skip


def test_a_recording_given_twice_is_named_with_the_one_that_it_repeats(demo: Demonstration) -> None:
    first, other, copy = (replace(demo, source=name) for name in ("a.npz", "b.npz", "copy.npz"))
    other = replace(other, position=demo.position + 0.001)
    found = [a.warnings for a in compared([first, other, copy], [audit(d) for d in (first, other, copy)])]
    assert [any("repeated" in text for text in warnings) for warnings in found] == [False, False, True]
    assert "repeated: the same samples as a.npz" in found[2]


def test_a_recording_of_two_samples_can_be_audited() -> None:
    tiny = Demonstration(
        time=np.array([0.0, 0.1]), position=np.array([[0.0, 0, 0], [0.01, 0, 0]]),
        quaternion=np.tile([0.0, 0, 0, 1], (2, 1)), wrench=np.arange(12.0).reshape(2, 6),
    )  # fmt: skip
    assert audit(tiny).usable
