"""What is learned from two noisy demonstrations in contact simulation, over 20 fresh seeds a row."""

from __future__ import annotations

import numpy as np
import pytest

from tests.figures.teaching import DOWN, PAIRS, angle_deg, axis_angle_deg, phases, row, taught

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
MOST = int(np.ceil(0.95 * PAIRS))  # 95 % of the seeds
X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.4])
def test_a_sliding_contact_shows_sectors_as_wide_as_coulomb_says(friction):
    from skillframe_lmc.intervals import track, translation
    from skillframe_lmc.sectors import sectors
    from skillframe_lmc.settings import Settings

    groups, _ = taught("valley", {"friction": friction}, 3.0, pairs=PAIRS, each=1)
    widths = []
    for (demonstration,) in groups:
        grip = np.array(demonstration.meta["frames"]["tip"])
        given = sectors(translation(track(demonstration, grip, grip, "base"), Settings()))
        widths.append(np.rad2deg(np.median(given.width[given.contact])))
    expected = 90.0 - np.rad2deg(np.arctan(friction))
    row(f"sector width, mu {friction}", round(float(np.median(widths)), 2), round(expected, 2))
    assert np.all(np.abs(np.array(widths) - expected) < 2.0)


@pytest.mark.parametrize("noise", [3.0, 8.0, 15.0])
@pytest.mark.parametrize("slope_deg", [45.0, 30.0])
def test_a_valley_gives_a_feasible_direction_and_one_axis(slope_deg, noise):
    slope, friction = np.deg2rad(slope_deg), 0.2
    groups, rejected = taught("valley", {"slope": float(slope), "friction": friction}, noise)
    parts = [phase["translation"] for phase in phases(groups)]
    errors = [angle_deg(p["desired_direction"], DOWN) for p in parts if p["desired_direction"] is not None]
    feasible = sum(error < np.rad2deg(slope - np.arctan(friction)) for error in errors)
    one = sum(len(p["compliant_axes"]) == 1 for p in parts)
    row(
        f"valley {slope_deg:g} deg, noise {noise:g}", f"rejected {rejected}", f"feasible {feasible}/{PAIRS}",
        f"one axis {one}/{PAIRS}", f"error {np.median(errors):.1f}, at most {max(errors):.1f} deg",
    )  # fmt: skip
    assert feasible >= MOST
    assert one >= MOST


@pytest.mark.parametrize("noise", [3.0, 8.0, 15.0])
def test_a_peg_gives_the_published_axes(noise):
    groups, rejected = taught("peg_in_hole", {}, noise)
    found = phases(groups)
    translations, rotations = [p["translation"] for p in found], [p["rotation"] for p in found]
    errors = [angle_deg(p["desired_direction"], DOWN) for p in translations if p["desired_direction"] is not None]
    near = sum(error <= 6.0 for error in errors)
    none = sum(p["desired_direction"] is None and not p["fully_compliant"] for p in rotations)
    about = sum(len(p["compliant_axes"]) == 1 and axis_angle_deg(p["compliant_axes"][0], Y) < 20 for p in rotations)
    along = sum(len(p["compliant_axes"]) == 1 and axis_angle_deg(p["compliant_axes"][0], X) < 20 for p in translations)
    row(
        f"peg 8 deg, noise {noise:g}", f"rejected {rejected}", f"within 6 deg {near}/{PAIRS}",
        f"error {np.median(errors):.1f}, at most {max(errors):.1f} deg", f"no rotational direction {none}/{PAIRS}",
        f"axes x {along}/{PAIRS}, about y {about}/{PAIRS}",
    )  # fmt: skip
    assert min(near, none, along, about) >= MOST


@pytest.mark.parametrize("noise", [3.0, 8.0])
def test_a_hose_coupler_gives_a_push_and_one_axis_each(noise):
    groups, rejected = taught("hose_coupler", {}, noise)
    found = phases(groups)
    exists = sum(p["translation"]["desired_direction"] is not None for p in found)
    none = sum(p["rotation"]["desired_direction"] is None for p in found)
    axes = sum(len(p["translation"]["compliant_axes"]) == len(p["rotation"]["compliant_axes"]) == 1 for p in found)
    row(
        f"hose coupler 8 deg, noise {noise:g}", f"rejected {rejected}", f"translation {exists}/{PAIRS}",
        f"no rotation {none}/{PAIRS}", f"1 + 1 axes {axes}/{PAIRS}",
    )  # fmt: skip
    assert min(exists, none, axes) >= MOST


@pytest.mark.parametrize("noise", [3.0, 8.0, 15.0])
def test_levering_leaves_translation_to_the_environment(noise):
    groups, rejected = taught("edge", {}, noise, each=1)
    found = phases(groups)
    free = sum(p["translation"]["fully_compliant"] for p in found)
    turned = sum(p["rotation"]["desired_direction"] is not None for p in found)
    row(f"levering, noise {noise:g}", f"rejected {rejected}", f"3-DoF {free}/{PAIRS}", f"turn {turned}/{PAIRS}")
    assert free == PAIRS


@pytest.mark.parametrize("noise", [3.0, 8.0, 15.0])
def test_contradictory_free_motions_give_no_direction(noise):
    half = float(np.sqrt(0.5))
    left, _ = taught("free", {"direction": [half, 0.0, -half]}, noise, each=1)
    right, _ = taught("free", {"direction": [-half, 0.0, -half]}, noise, each=1)
    found = phases([a + b for a, b in zip(left, right, strict=True)])
    none = sum(p["translation"]["desired_direction"] is None for p in found)
    row(f"free motions 90 deg apart, noise {noise:g}", f"no direction {none}/{PAIRS}")
    assert none == PAIRS
