"""Faults in the audit, in what is cut off, and in what is conditioned."""

from __future__ import annotations

from pathlib import Path

import pytest
from skillframe_recordings.audit import audit
from skillframe_recordings.conditioning.offline import remove_bias, smooth

from skillframe.cli.main import run
from skillframe.demonstration.faults.fault import kept, moved
from skillframe.demonstration.faults.find import faults
from skillframe.document.frame import refuse_unfit
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from tests.unit.demonstration.test_faults import copied, displaced
from tests.unit.demonstration.test_stalls import BIAS, NOISE, TOUCH, recording

CASES = {
    "the wrench from 2.00 to 3.00 s is that from 9.00 to 10.00 s": (
        copied(recording(), 9.0, 2.0, 1.0), " --set from=3.005",
    ),
    "the tool point jumps by 20.0 mm between 9.995 and 10.000 s": (
        displaced(recording(), 10.0, 0.02), " --set to=9.995",
    ),
}  # fmt: skip


def test_neither_bias_noise_nor_contact_is_taken_from_what_did_not_happen() -> None:
    """12.7 N of contact pasted into free air."""
    pasted = audit(copied(recording(), 9.0, 2.0, 2.0))
    assert [c[0] for c in pasted.contacts] == pytest.approx([TOUCH], abs=0.05)
    assert pasted.noise == pytest.approx(NOISE, rel=0.35)
    removed = remove_bias(copied(recording(), 9.0, 2.0, 2.0))
    assert removed.stretch[1] < 2.0 and removed.payload.bias[2] == pytest.approx(BIAS[2], abs=0.05)
    with pytest.raises(InputError, match=r"the wrench is copied within 0 to 6 s, so that it shows no free air"):
        remove_bias(copied(recording(), 9.0, 2.0, 2.0), (0.0, 6.0))


@pytest.mark.parametrize("words", CASES)
def test_no_learner_takes_it_and_the_part_that_is_named_is_taken(words: str, tmp_path: Path) -> None:
    d, part = CASES[words]
    write_demonstration(d, tmp_path / "demo.npz")
    demo = read_demonstration(tmp_path / "demo.npz")
    with pytest.raises(InputError) as caught:
        refuse_unfit([demo])
    said = str(caught.value)
    assert words in said and f"convert {demo.source}{part} --out cut.npz" in said, said
    assert any(words in w for w in audit(demo).warnings)
    assert run(["convert", demo.source, *part.split(), "--out", str(tmp_path / "cut.npz")]) == 0
    refuse_unfit([read_demonstration(tmp_path / "cut.npz")])


@pytest.mark.slow
def test_faults_are_remembered_when_the_wrench_is_smoothed_and_move_with_the_clock(tmp_path: Path) -> None:
    d = copied(recording(), 9.0, 2.0, 1.0)
    assert faults(smooth(d)) == faults(d)
    write_demonstration(smooth(d), tmp_path / "a.npz")
    later = read_demonstration(tmp_path / "a.npz", start=1.0).meta["faults"]
    assert later == [f._asdict() for f in faults(d)]
    (shifted,) = kept(moved({"faults": later}, -1.0))
    assert [shifted.start, shifted.stop, shifted.value] == pytest.approx([1.0, 2.0, 8.0])
