"""An identified tool that cannot be one is refused with its figure: there was contact, or a unit or frame is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_recordings.conditioning.offline import remove_bias

from skillframe.cli.main import run
from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import write_demonstration
from skillframe.frames import quaternion_from_matrix, rotate_spatial, rotation_matrix

MASS, COM = 0.93, np.array([0.0, 0.01, 0.044])


def swing(mass: float = MASS, com: np.ndarray = COM, vibration: float = 0.05, seed: int = 0) -> Demonstration:
    """20 s of a tool that turns by 60 degrees about two axes in free air, weight and bias in the wrench."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.01)
    turn = np.stack([np.sin(0.6 * time), np.sin(0.41 * time), 0.1 * np.sin(0.2 * time)], axis=1)
    rotation = rotation_matrix(np.pi * np.array([1.0, 0.0, 0.0])) @ rotation_matrix(turn)
    bias = np.array([9.0, -1.0, 10.0, 0.1, 0.0, -0.2])
    wrench = weight_wrench(rotation, mass, com) + rotate_spatial(rotation, np.tile(bias, (len(time), 1)))
    wrench += rng.normal(size=wrench.shape) * np.repeat([vibration, 0.05 * vibration], 3)
    position = np.tile([0.4, 0.0, 0.5], (len(time), 1)) + 0.02 * turn
    meta = {"wrench": {"includes_tool_weight": True}, "contact": False}
    return Demonstration(
        time=time, position=position, quaternion=quaternion_from_matrix(rotation), wrench=wrench, meta=meta
    )  # fmt: skip


def pressed(force: float, lever: float, start: float = 12.0, stop: float = 18.0, **made: float) -> Demonstration:
    """The same with a push along base z in the middle of it, that far beside the tool point."""
    d = swing(**made)
    wrench = d.wrench.copy()
    inside = (d.time > start) & (d.time < stop)
    wrench[inside] += np.array([0.0, 0.0, force, 0.0, -lever * force, 0.0])
    return replace(d, wrench=wrench)


@pytest.mark.parametrize("mass", [0.05, 0.93, 5.0, 30.0])
@pytest.mark.parametrize("vibration", [0.02, 0.6, 2.0])
def test_a_real_tool_is_identified_whatever_it_weighs_and_the_robot_vibrates(mass: float, vibration: float) -> None:
    found = remove_bias(swing(mass=mass, vibration=vibration)).payload
    # 6000 force samples over a gravity that moves by 1 g: the standard error is vibration / 9.81 / sqrt(6000) times 3
    assert found.mass == pytest.approx(mass, abs=0.01 * vibration)


@pytest.mark.parametrize("force", [8.0, 20.0, -30.0])
def test_a_contact_in_the_stretch_is_refused_with_what_the_fit_leaves(force: float) -> None:
    with pytest.raises(
        InputError, match=r"resembles a tool of .* kg (that leaves [\d.]+ N rms|with its centre of mass)"
    ):
        remove_bias(pressed(force, 0.1))


def test_a_centre_of_mass_4_5_m_away_is_refused_with_its_lever() -> None:
    far = swing(mass=0.235, com=np.array([0.0, 0.0, 4.5]))
    with pytest.raises(
        InputError, match=r"a tool of 0\.23\d kg with its centre of mass 4\.5 m away, where 1 m is the most"
    ):
        remove_bias(far)


def test_a_tool_of_tonnes_is_refused_with_its_mass() -> None:
    with pytest.raises(InputError, match=r"a tool of 1\.2e\+03 kg, where 1000 kg is the most"):
        remove_bias(swing(mass=1200.0))


@pytest.mark.slow
def test_filter_says_it_in_one_sentence_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "swing.npz", tmp_path / "clean.npz"
    write_demonstration(swing(mass=0.235, com=np.array([0.0, 0.0, 4.5])), path)
    assert run(["filter", str(path), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "centre of mass 4.5 m away" in said
    assert "--free-air FROM,TO" in said
    assert len(said.strip().splitlines()) == 1
    assert not out.exists()
    assert run(["filter", str(path), "--no-weight", "--out", str(out)]) == 0
