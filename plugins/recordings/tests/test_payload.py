from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_recordings.conditioning.offline import filter_wrench, remove_bias, smooth
from skillframe_recordings.conditioning.payload import gravity_in_tool, identify_payload

from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float, norm, rotate_spatial
from tests.references import recordings_dir

BIAS = np.array([9.08, -1.02, 9.99, 0.43, -0.69, -0.16])
MASS, COM = 0.932, np.array([0.004, -0.007, 0.0439])


def readings(rotation: Float, noise: float, seed: int = 0) -> Float:
    """What a sensor reads in free air at these attitudes, in tool axes."""
    rng = np.random.default_rng(seed)
    weight = rotate_spatial(np.swapaxes(rotation, -1, -2), weight_wrench(rotation, MASS, COM))
    return weight + BIAS + rng.normal(size=(len(rotation), 6)) * np.repeat([noise, noise / 20], 3)


def test_without_noise_the_payload_is_exact() -> None:
    rotation = Rotation.random(24, random_state=0).as_matrix()
    found = identify_payload(readings(rotation, 0.0), gravity_in_tool(rotation))
    assert found.mass == pytest.approx(MASS, rel=1e-12)
    assert found.com == pytest.approx(COM, abs=1e-12)
    assert found.bias == pytest.approx(BIAS, abs=1e-11)
    assert found.residual_force < 1e-12
    assert found.advice == ""
    assert found.wrench(rotation) == pytest.approx(rotate_spatial(rotation, readings(rotation, 0.0)), abs=1e-11)


@pytest.mark.parametrize("seed", range(10))
def test_with_noise_the_payload_is_within_its_standard_error(seed: int) -> None:
    rotation = Rotation.random(24, random_state=seed).as_matrix()
    found = identify_payload(readings(rotation, 0.1, seed), gravity_in_tool(rotation))
    # standard error of the mass is 0.1 / (9.81 sqrt(24)) = 2.1 g; five of them
    assert found.mass == pytest.approx(MASS, abs=5 * 0.1 / (9.81 * np.sqrt(24)))
    assert found.residual_force == pytest.approx(0.1, rel=0.4)
    assert found.com == pytest.approx(COM, abs=0.002)


def about(axis: str, degrees: float, count: int = 60) -> Float:
    """A tool that hangs down (its z axis up) and is turned about one of its horizontal axes."""
    return Rotation.from_euler(axis, np.linspace(0.0, degrees, count)[:, None], degrees=True).as_matrix()


@pytest.mark.parametrize("degrees", [0.0, 3.0, 12.0])
def test_a_tool_that_hardly_turns_gives_the_bias_with_the_weight_in_it_and_says_about_what_to_turn(
    degrees: float,
) -> None:
    rotation = about("x", degrees)
    found = identify_payload(readings(rotation, 0.05), gravity_in_tool(rotation))
    assert found.mass == 0.0
    assert found.bias[2] == pytest.approx(BIAS[2] - 9.81 * MASS, abs=0.4)
    assert f"only {degrees:.0f} degrees" in found.advice
    assert "about its x axis" in found.advice or "about its y axis" in found.advice


@pytest.mark.parametrize(("axis", "unseen"), [("x", "y"), ("y", "x")])
def test_turning_about_one_axis_gives_the_mass_and_says_which_axis_is_missing(axis: str, unseen: str) -> None:
    rotation = about(axis, 60.0)
    found = identify_payload(readings(rotation, 0.02), gravity_in_tool(rotation))
    assert found.mass == pytest.approx(MASS, abs=0.01)
    assert f"about its {unseen} axis as well" in found.advice
    both = np.concatenate([rotation, about(unseen, 60.0)])
    complete = identify_payload(readings(both, 0.02), gravity_in_tool(both))
    assert complete.advice == ""
    assert complete.com == pytest.approx(COM, abs=0.001)


def test_turning_about_the_vertical_shows_nothing() -> None:
    rotation = about("z", 170.0)
    assert identify_payload(readings(rotation, 0.05), gravity_in_tool(rotation)).mass == 0.0


def demonstration(weighs: bool, seed: int = 0, turn: float = 1.5) -> tuple[Demonstration, Float]:
    """Free air with turning for 3 s, then a press: the recording, and the true wrench."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, 1000)
    angles = np.stack([turn * np.sin(6 * s), turn * np.sin(9 * s), 0 * s], axis=-1)
    rotation = Rotation.from_rotvec(angles)
    truth = np.zeros((1000, 6))
    truth[750:, 2] = 15.0
    bias = rotate_spatial(rotation.as_matrix(), BIAS)
    weight = weight_wrench(rotation.as_matrix(), MASS, COM) if weighs else 0.0
    noise = rng.normal(size=(1000, 6)) * np.repeat([0.05, 0.003], 3)
    demo = Demonstration(
        time=s * 4.0, position=np.zeros((1000, 3)), quaternion=rotation.as_quat(), wrench=truth + bias + weight + noise,
        meta={"wrench": {"frame": "base", "includes_tool_weight": weighs}},
    )  # fmt: skip
    return demo, truth


@pytest.mark.parametrize("weighs", [True, False])
def test_bias_and_weight_are_removed_from_the_whole_recording(weighs: bool) -> None:
    demo, truth = demonstration(weighs)
    removed = remove_bias(demo, (0.0, 2.9))
    assert (removed.demonstration.wrench - truth).mean(axis=0) == pytest.approx(np.zeros(6), abs=0.02)
    assert removed.payload.mass == pytest.approx(MASS if weighs else 0.0, abs=0.005)
    assert removed.demonstration.meta["wrench"]["includes_tool_weight"] is False


def test_weight_that_cannot_be_told_apart_stays_declared() -> None:
    demo, _ = demonstration(weighs=True, turn=0.01)
    removed = remove_bias(demo)
    assert removed.demonstration.meta["wrench"]["includes_tool_weight"] is True
    assert "cannot be separated" in removed.payload.advice


def test_a_stretch_that_is_too_short_is_refused() -> None:
    with pytest.raises(InputError, match="too short to find a bias"):
        remove_bias(demonstration(weighs=False)[0], (1.0, 1.05))


def test_smoothing_notes_its_figures_and_lowers_the_noise() -> None:
    demo, truth = demonstration(weighs=False, turn=0.0)
    clean = remove_bias(demo, (0.0, 2.9)).demonstration
    for run in (smooth, filter_wrench):
        result = run(clean)
        said = result.meta["conditioning"]
        assert said["noise"][0] == pytest.approx(0.05, rel=0.2)
        assert (result.wrench - truth)[:700].std() < (clean.wrench - truth)[:700].std()


def test_the_static_poses_of_the_kuka_recording_give_the_published_payload() -> None:
    base = recordings_dir()
    if base is None or not (base / "kuka_ati").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold kuka_ati")
    table = np.loadtxt(base / "kuka_ati" / "0-calibration_fts-accel.csv", delimiter=",", skiprows=1)
    for gravity in (table[:, 9:12], gravity_in_tool(table[:, 12:].reshape(-1, 3, 3))):
        found = identify_payload(table[:, :6], gravity)
        assert found.bias[:3] == pytest.approx([9.08, -1.02, 9.99], abs=0.01)
        assert found.mass * norm(gravity).mean() == pytest.approx(0.932 * 9.821, abs=0.01)  # their g; ours is 9.81
        assert found.com == pytest.approx([0.0, 0.0, 0.0439], abs=0.0005)
        assert found.residual_force == pytest.approx(0.086, abs=0.001)
