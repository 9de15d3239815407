"""What theory and the papers say a compliant push can and cannot do, run on the shipped worlds."""

import numpy as np
import pytest

from skillframe.frames import norm
from tests.laws.pushing import Push, impedance
from tests.laws.runs import run, setup

DOWN = (0.0, 0.0, -1.0)
RESOLUTION = 1.0


def free_across(direction):
    """Stiffness (N, 6, 6) without any in the x-z plane across the push, as a valley's skill is learned."""
    across = np.stack([-direction[:, 2], 0 * direction[:, 0], direction[:, 0]], axis=-1)
    stiffness = np.broadcast_to(impedance(), (len(direction), 6, 6)).copy()
    stiffness[:, :3, :3] -= 1000.0 * across[:, :, None] * across[:, None, :]
    return stiffness


@pytest.mark.parametrize("slope", [45.0, pytest.param(30.0, marks=pytest.mark.slow)])
def test_a_tilted_push_slides_down_a_slope_up_to_the_slope_less_the_friction_angle(slope):
    """Statics of Coulomb friction, on both sides of the valley: the boundary, in 1 degree steps, is within 2."""
    friction, beyond, side = np.array([0.1, 0.2, 0.4]), np.arange(-5.0, 5.0 + RESOLUTION, RESOLUTION), [1.0, -1.0]
    theory = slope - np.rad2deg(np.arctan(friction))
    mu, over, sign = (a.ravel() for a in np.meshgrid(friction, beyond, side, indexing="ij"))
    tilt = np.deg2rad(np.repeat(theory, len(beyond) * 2) + over)
    direction = np.stack([sign * np.sin(tilt), np.zeros_like(tilt), -np.cos(tilt)], axis=-1)
    draws = {"start.offset_x": 0.015 * sign, "world.friction": mu}
    skill = Push(direction, free_across(direction), speed=0.03)
    result = run(skill, setup(params={"slope": np.deg2rad(slope)}), draws, len(mu), duration_s=8.0)
    slid = result.success.reshape(3, len(beyond), 2)
    moved = 0.015 - result.final_error_m.reshape(slid.shape)
    assert (np.abs(moved[~slid]) < 0.005).all()  # what does not slide down sticks near where it touched
    for i, mu_i in enumerate(friction):
        for j, name in enumerate(("right", "left")):
            found = theory[i] + beyond[slid[i, :, j]].max()
            print(f"slope {slope:g}, friction {mu_i:g}, {name}: boundary {found:.1f}, theory {theory[i]:.1f} degrees")
            assert abs(found - theory[i]) <= 2.0
            assert np.all(np.diff(slid[i, :, j].astype(int)) <= 0)  # one boundary, nothing slides beyond it


def largest_tilts(point, tilts, stall):
    """The largest whole-degree tilt up to which all tilts of a sign insert, for + and -, at friction 0.2."""
    signed = np.concatenate([tilts, -tilts])
    skill = Push(DOWN, impedance("x", "y"), stall=stall)
    draws = {"start.tilt_y": np.deg2rad(signed)}
    result = run(skill, setup("free_tool", "peg_in_hole", point), draws, len(signed), duration_s=9.0)
    limits = []
    for inserted in result.success.reshape(2, -1):
        stop = len(tilts) if inserted.all() else int(np.argmin(inserted))
        limits.append(float(tilts[stop - 1]) if stop else 0.0)
    print(f"compliant at the {point}: largest tilt {limits[0]:g} and {-limits[1]:g} degrees, stall stop {stall}")
    return limits


@pytest.mark.slow
@pytest.mark.parametrize(
    ("point", "tilts", "least", "most"),
    [
        ("wrist", np.arange(1.0, 9.0), 3.0, 5.0),  # published: 4
        ("tip", np.array([4.0, 8.0, *np.arange(11.0, 19.0)]), 12.0, 16.0),  # published: 12; lmc's own trials: 14
    ],
)
@pytest.mark.figures
def test_the_centre_of_compliance_decides_from_which_tilts_a_peg_goes_in(point, tilts, least, most):
    patient = largest_tilts(point, tilts, stall=False)
    assert patient[0] == patient[1]
    assert least <= patient[0] <= most
    hasty = largest_tilts(point, tilts, stall=True)  # a peg near its limit stands still for a while and then goes on
    assert least <= min(hasty)
    assert max(hasty) <= most
    assert abs(hasty[0] - hasty[1]) <= RESOLUTION


def align(free_axes):
    skill = Push(DOWN, impedance(free_axes, "y"))
    return run(
        skill, setup("free_tool", "hose_coupler", "wrist"), {"start.tilt_y": np.deg2rad([-8.0, -4.0, 4.0, 8.0])}, 4,
        duration_s=8.0,
    )  # fmt: skip


@pytest.mark.slow
def test_a_coupler_aligns_from_both_sides_when_x_is_free():
    result = align("x")
    assert result.success.all()
    assert (result.final_error_rad < np.deg2rad(0.3)).all()


@pytest.mark.slow
def test_a_coupler_does_not_align_when_x_is_stiff_because_the_flange_is_far_from_the_face():
    result = align("")
    assert not result.success.any()
    assert (result.final_error_rad > np.deg2rad(2.0)).all()


@pytest.mark.parametrize("faces", [3, *(pytest.param(faces, marks=pytest.mark.slow) for faces in (4, 6))])
def test_a_funnel_leads_to_its_middle_from_all_sides(faces):
    azimuth = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    draws = {"start.offset_x": 0.015 * np.cos(azimuth), "start.offset_y": 0.015 * np.sin(azimuth)}
    result = run(
        Push(DOWN, impedance("xy"), speed=0.03),
        setup(world="funnel", params={"faces": faces}),
        draws,
        8,
        duration_s=8.0,
    )
    assert result.success.all()
    assert norm(np.array([result.peak_force_n])).max() < 120.0


@pytest.mark.slow
def test_a_straight_push_on_a_slope_flatter_than_the_friction_angle_sticks():
    result = run(
        Push(DOWN, impedance("x")),
        setup(params={"slope": 0.3, "friction": 0.4}),
        {"start.offset_x": 0.02},
        duration_s=3.0,
    )
    assert not result.success[0]
    assert result.final_error_m[0] > 0.015
