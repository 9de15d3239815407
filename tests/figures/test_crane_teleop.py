"""Two teleoperated demonstrations of the crane: is what LMC learns feasible, how far inside, how near the intent.

Twenty operators and machines for each angle and delay. A push is feasible if it slides on stack and stop alike: with
friction 0.3, from -73.3 to -16.7 degrees.
"""

from __future__ import annotations

from functools import cache
from math import radians

import numpy as np
import pytest
from skillframe_hydraulics import teleoperation
from skillframe_hydraulics.sessions import aimed, operate
from skillframe_hydraulics.teleoperation import OperatorSettings, loop_gain

from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model, load_world
from tests.crane_corner import PEAK, into_the_corner
from tests.crane_teaching import Taught, angle_of, draws, estimate_error, learn, margin, teach
from tests.figures.teaching import row

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
SEEDS = range(500, 520)
ANGLES, DELAYS = (-30.0, -40.0, -50.0, -60.0), (0.05, 0.15)
VARIANTS = {
    "two demonstrations, contact only": (slice(0, 2), {}),
    "the one on the stack alone": (slice(0, 1), {}),
    "the one on the stop alone": (slice(1, 2), {}),
    "two, with free space": (slice(0, 2), {"contact_only": False}),
    "two, least force 2000 N": (slice(0, 2), {"force_min_n": 2000.0}),
}


@cache
def taught(angle: float, delay: float) -> tuple[list[Taught], list[str]]:
    return teach(angle, delay, SEEDS)


def learned_angles(pairs: list[Taught], which: slice, settings: dict[str, object]) -> np.ndarray:
    return np.array([angle_of(learn(pair.demonstrations[which], **settings)) for pair in pairs])


def report(angle: float, delay: float) -> np.ndarray:
    """Prints a block of the table. Returns the margins (20,) of the first variant."""
    pairs, failed = taught(angle, delay)
    peak = [trace.meta["peak_force_n"] for pair in pairs for trace in pair.traces]
    error = [estimate_error(trace) for pair in pairs for trace in pair.traces]
    row(
        f"aim {angle:.0f}, delay {1e3 * delay:.0f} ms", f"{len(failed)} redrawn",
        f"peak median {np.median(peak):.0f}, largest {max(peak):.0f} N",
        f"estimate's error in contact rms {np.median(error):.0f} N",
    )  # fmt: skip
    margins = {}
    for name, (which, settings) in VARIANTS.items():
        angles = learned_angles(pairs, which, settings)
        margins[name] = inside = np.array([margin(a) if np.isfinite(a) else -np.inf for a in angles])
        off = np.abs(angles - angle)
        row(
            f"  {name}", f"feasible {(inside > 0).sum()}/{len(inside)}",
            f"10 degrees inside {(inside >= 10).sum()}/{len(inside)}",
            f"angle {np.nanmin(angles):.1f} .. {np.nanmax(angles):.1f}",
            f"intent off by {np.nanmedian(off):.1f}, most {np.nanmax(off):.1f}",
        )  # fmt: skip
    for text in failed:
        row("", text)
    return margins["two demonstrations, contact only"]


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("angle", ANGLES)
def test_what_two_demonstrations_teach_is_feasible_and_well_inside_the_set(angle: float, delay: float) -> None:
    inside = report(angle, delay)
    assert np.all(inside > 0.0)
    assert (inside >= 10.0).sum() >= 18


@pytest.mark.parametrize("surface", ["wood", "styrofoam"])
def test_what_was_learned_ends_in_the_corner_from_three_starts(surface: str) -> None:
    """The pair of the first seed, taught with the longest delay and the least fitting angle. 36 of 36."""
    document = learn(taught(ANGLES[0], DELAYS[-1])[0][0].demonstrations)
    corner = into_the_corner(surface, 36, seed=43, document=document)
    result = corner.result
    row(
        f"{surface}, learned {angle_of(document):.1f} degrees", f"{corner.good.sum()}/36",
        f"error median {1e3 * np.median(result.final_error_m):.1f}, largest {1e3 * result.final_error_m.max():.1f} mm",
        f"peak median {np.median(result.peak_force_n):.0f}, largest {result.peak_force_n.max():.0f} N (<= {PEAK:.0f})",
    )  # fmt: skip
    assert corner.good.all(), (list(result.failure), result.peak_force_n)


@pytest.mark.parametrize("delay", DELAYS)
def test_such_a_channel_let_through_ends_at_the_force_limit_on_the_stop(delay, monkeypatch) -> None:
    """Small gain is sufficient, not necessary: on the stack the same channel came through."""
    monkeypatch.setattr(teleoperation, "require_stable_loop", lambda settings: None)
    robot, slots = load_robot_model("hiab_xs031"), [(seed, i) for seed in SEEDS[:4] for i in (0, 1)]
    scene = aimed(robot, load_world("pallets", {}), radians(-45.0))
    settings = OperatorSettings(delay_s=delay, feed_velocity=True)
    rngs = [np.random.default_rng(slot) for slot in slots]
    result = operate(robot, scene, settings, draws(-45.0, slots), rngs)
    for i, name in enumerate(("stack", "stop")):
        fine, peak = result.success[i::2], result.peak_force_n[i::2]
        row(f"let through, {1e3 * delay:.0f} ms, {name}", f"done {fine.sum()}/{len(fine)}", f"peak {peak.max():.0f} N")
    assert not result.success[1::2].any()
    assert all("force limit" in text for text in result.failure[1::2])


@pytest.mark.parametrize("delay", DELAYS)
def test_a_channel_that_feeds_the_masters_velocity_is_refused_before_anything_moves(delay: float) -> None:
    settings = OperatorSettings(delay_s=delay, feed_velocity=True)
    with pytest.raises(InputError, match=f"loop gain {loop_gain(settings):.2f} is not below 1"):
        teach(ANGLES[0], delay, SEEDS[:1], feed_velocity=True)
