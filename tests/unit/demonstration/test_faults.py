"""Steps of the bias, copies, saturation and jumps: where they are, what they touch, and that nothing learns of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skillframe.demonstration.contact import contact_evidence
from skillframe.demonstration.faults.fault import Flaw, kept
from skillframe.demonstration.faults.find import alive, faults
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import refuse_unfit
from skillframe.errors import InputError
from tests.unit.demonstration.test_stalls import NOISE, TOUCH, recording, within


def stepped(start: float, stop: float, size: float, channel: int = 0) -> Demonstration:
    d = recording()
    wrench = d.wrench.copy()
    wrench[within(d, start, stop), channel] += size
    return replace(d, wrench=wrench)


def copied(d: Demonstration, start: float, to: float, seconds: float, channels: slice = slice(0, 6)) -> Demonstration:
    wrench, rows = d.wrench.copy(), within(d, start, start + seconds)
    wrench[rows + round((to - start) * d.rate), channels] = d.wrench[rows, channels]
    return replace(d, wrench=wrench)


def displaced(d: Demonstration, at: float, by: float) -> Demonstration:
    position = d.position.copy()
    position[d.time >= at - 1e-9] += by * np.array([0.6, 0.0, 0.8])
    return replace(d, position=position)


def plain(d: Demonstration) -> list[tuple[str, str, float, float]]:
    return [(f.kind, f.what, round(f.start, 3), round(f.stop, 3)) for f in faults(d)]


@pytest.mark.parametrize(("channel", "size"), [(2, -3.0), (2, -1.5)])
def test_a_force_that_stays_while_the_tool_goes_along_it_is_another_bias(channel: int, size: float) -> None:
    """It goes down by 30 mm/s until 7 s: a contact that pushes it down would be left after a third of a second."""
    (found,) = faults(stepped(3.0, 16.0, size, channel))
    assert (found.kind, found.what, found.start) == ("step", "fz", pytest.approx(3.0))
    assert found.value == pytest.approx(size, abs=6.0 * NOISE[channel])  # the difference of two samples
    assert plain(stepped(2.0, 5.0, size, channel)) == [("step", "fz", 2.0, 5.0)]


def test_what_stops_the_tool_or_rises_over_samples_is_contact() -> None:
    assert faults(recording()) == []
    d = recording()
    wrench = d.wrench.copy()
    wrench[d.time >= 3.0, 0] += 2.0 * np.clip((d.time[d.time >= 3.0] - 3.0) / 0.015, 0.0, 1.0)
    assert faults(replace(d, wrench=wrench)) == []  # three samples
    landed = d.wrench.copy()
    landed[d.time >= TOUCH, :3] += [0.0, -1.0, 9.0]  # within a sample, as the tool stops
    assert faults(replace(d, wrench=landed)) == []


@pytest.mark.parametrize(("change", "told"), [([1.0, 0, -3.0], "fx, fz"), ([1.0, 0, 3.0], ""), ([2.0, 0, 0], "")])
def test_a_force_against_the_motion_or_across_it_may_be_contact(change: list[float], told: str) -> None:
    d = recording()
    wrench = d.wrench.copy()
    wrench[d.time >= 3.0, :3] += change
    assert [f.what for f in faults(replace(d, wrench=wrench))] == ([told] if told else [])


def test_a_force_that_ends_within_a_sample_is_a_contact_that_let_go() -> None:
    d = recording()
    wrench = d.wrench.copy()
    wrench[(d.time >= 1.0) & (d.time < 3.0), 2] += 9.0 * np.clip(
        d.time[(d.time >= 1.0) & (d.time < 3.0)] - 1.0, 0.0, 1.0
    )
    assert faults(replace(d, wrench=wrench)) == []


def test_a_force_that_ends_as_the_tool_goes_is_contact_however_sudden() -> None:
    d = recording()
    wrench = d.wrench.copy()
    wrench[(d.time >= 3.0) & (d.time < 3.2), 2] -= 3.0  # 6 mm
    assert faults(replace(d, wrench=wrench)) == []


@pytest.mark.parametrize(("start", "to"), [(8.0, 2.0), (1.0, 9.0), (9.0, 12.5)])
def test_a_copied_stretch_is_named_with_its_original(start: float, to: float) -> None:
    (found,) = faults(copied(recording(), start, to, 1.0))
    assert (found.kind, found.what) == ("copy", "wrench")
    if min(start, to) > TOUCH:  # both in one contact: nothing tells which is the copy
        start, to = (start, to) if found.value < found.start else (to, start)
    assert [found.start, found.stop, found.value] == pytest.approx([to, to + 1.0, start])


@pytest.mark.parametrize("channel", [0, 5])
def test_a_copied_channel_is_named_alone(channel: int) -> None:
    (found,) = faults(copied(recording(), 8.0, 2.0, 1.0, slice(channel, channel + 1)))
    assert (found.kind, found.what) == ("copy", ("fx", "fy", "fz", "tx", "ty", "tz")[channel])


def test_a_coarse_sensor_repeats_itself_by_chance_and_is_no_copy() -> None:
    """At 0.1 N and 0.01 Nm two increments in three are zero: 50 equal samples come by chance."""
    d = recording()
    coarse = np.round(d.wrench / np.repeat([0.1, 0.01], 3)) * np.repeat([0.1, 0.01], 3)
    assert [f for f in faults(replace(d, wrench=coarse)) if f.kind == "copy"] == []
    assert plain(copied(replace(d, wrench=coarse), 8.0, 2.0, 1.0))[0][:2] == ("copy", "wrench")


def test_a_tool_point_that_jumps_parts_two_recordings_and_one_that_stops_does_not() -> None:
    (found,) = faults(displaced(recording(), 9.0, 0.01))
    assert (found.kind, found.what) == ("jump", "pose")
    assert [found.start, found.stop, found.value] == pytest.approx([8.995, 9.0, 0.01], rel=0.02)
    d = recording()
    fast = replace(d, position=d.position - 0.9 * np.minimum(d.time, 1.0)[:, None] * np.array([1.0, 0.0, 0.0]))
    assert faults(fast) == []  # 4.5 mm a sample, stopped from one to the next


def test_saturation_is_an_interval_that_stays_contact() -> None:
    d = recording()
    found = contact_evidence(replace(d, wrench=np.minimum(d.wrench, 9.0)))
    assert [(f.kind, f.what) for f in found.faults] == [("saturation", "fz")]
    assert found.faults[0].start == pytest.approx(TOUCH, abs=0.06)
    assert len(found.contacts) == 1 and found.contacts[0][1] == pytest.approx(15.995)


def test_a_step_is_told_and_learned_from_all_the_same() -> None:
    """A hard touch between two samples can look like one."""
    d = stepped(4.0, 16.0, -2.0, 2)
    words = "fz steps by -2.19 N within one sample, from 4.00 to 16.00 s, while the motion goes on"
    assert [fault.words() for fault in faults(d)] == [words]
    refuse_unfit([d])
    assert alive(d).all()


@pytest.mark.parametrize("wrong", ["a", [1], [{"kind": "step"}], [{"kind": "x", "what": "fx", "start": 0, "stop": 1,
                                                                    "value": 1}]])  # fmt: skip
def test_faults_in_metadata_that_are_none_are_refused(wrong: object) -> None:
    with pytest.raises(InputError, match="faults"):
        kept({"faults": wrong}, "demo.npz")


def test_each_kind_says_what_where_and_what_it_touches() -> None:
    step, copy = Flaw("step", "fx", 1.0, 2.0, 3.0), Flaw("copy", "pose", 1.0, 2.0, 5.0)
    assert step.warning() == (
        "step: fx steps by 3 N within one sample, from 1.00 to 2.00 s, while the motion goes on: what follows may "
        "have another bias; a hard touch between two samples can do the same, so all of it counts"
    )
    assert copy.words() == "the pose from 1.00 to 2.00 s is that from 5.00 to 6.00 s bit for bit"


def test_a_level_is_a_fault_only_where_one_of_its_ends_shows() -> None:
    """A part that was cut out of the new level has one bias throughout."""
    step = Flaw("step", "fx", 4.0, 16.0, 2.0)
    assert [step.within(a, b) for a, b in ((0.0, 16.0), (4.0, 16.0), (5.0, 9.0), (4.0, 17.0))] == [
        True,
        False,
        False,
        True,
    ]
    copy = step._replace(kind="copy")
    assert copy.within(5.0, 9.0) and not copy.within(16.0, 20.0)
