"""Peg and valley by position and velocity, beside ideal torques, on two arms; the least damping in the valley.

`pytest -m figures -s tests/figures/test_interfaces.py -k ur5e` prints the rows that docs/how-to/own-robot.md quotes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import binomtest, qmc

from skillframe.document.file import learned
from skillframe.execution.drives.torque import TARED_IN_CONTACT
from skillframe.execution.executor import Result, Setup, begin, simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Float, norm
from skillframe.robot.interface import VIRTUAL_MASS, Control
from skillframe.robot.tables import Mount
from skillframe.skill import Skill
from tests.figures.teaching import row, taught

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
KINDS = {
    "torque": Control(),
    "position, 500 Hz, 8 ms": Control(interface="position", rate_hz=500.0),
    "position, 125 Hz, 20 ms": Control(interface="position", rate_hz=125.0, delay_s=0.02),
    "velocity, 1 kHz, 3 ms": Control(interface="velocity", delay_s=0.003, bandwidth_hz=50.0),
}
UR5E = {
    "position, 500 Hz, 8 ms": (replace(KINDS["position, 500 Hz, 8 ms"], contact_stiffness=4e4), 64, 12.0),
    "position, 125 Hz, 20 ms": (replace(KINDS["position, 125 Hz, 20 ms"], contact_stiffness=4e4), 32, 18.0),
    "ur5e_velocity": ("ur5e_velocity", 32, 12.0),
    "torque": (Control(), 32, 12.0),
    "ur5e": ("ur5e", 32, 20.0),
}
"""Interface or robot, draws of the peg, and the median time that the design calls reachable [s]."""
VARIED = {
    "peg_in_hole": ({"start.offset_z": 0.002}, {"fixture.offset_x": 0.008, "fixture.tilt_y": 0.12}),
    "valley": ({"start.offset_z": 0.035, "world.friction": 0.2}, {"fixture.offset_x": 0.015, "fixture.tilt_y": 0.45}),
}
"""Quantities that are fixed, and half the ranges of those that vary. Without the 2 mm the peg begins in contact in 8 of
64 draws, the force sensor is tared there, and every force is then 3 to 13 N wrong. 35 mm are, in steps of 5, the least
from which no draw of the valley is tared in contact (30 mm: 2 of 64, none: 46)."""
DRAWS = 20261123
"""Seed of the draws: none of them was looked at while law and watch were designed. Skills are taught by another."""
PANDA_STIFFNESS = 5.4e4
"""[N/m] of contact and servo in series: what a prototype of another make found for this arm."""


@cache
def skill(world: str, robot: str = "panda") -> Document:
    (pair,), _ = taught(world, {}, 8.0, pairs=1, robot=robot)
    return learned(registry().skill("lmc"), pair, LearnOptions())


def run(
    world: str, control: Control, count: int, seconds: float = 20.0, arm: str = "panda", mount: Mount | None = None
) -> Result:  # fmt: skip
    """Trials with the fixture moved and tilted and nobody telling, the centre of compliance at the tip."""
    runs, setup = set_up(world, control, arm, mount)
    return simulate(runs, setup, drawn(world, count)[1], generators(count), duration_s=seconds)


def set_up(world: str, control: Control, arm: str, mount: Mount | None = None) -> tuple[Skill, Setup]:
    model = load_robot_model(arm)
    robot = replace(model, spec=replace(model.spec, control=control, mount=mount))
    return prepare(robot, load_world(world, {}), skill(world, arm), "tip")


def drawn(world: str, count: int) -> tuple[dict[str, float], dict[str, Float]]:
    """What is fixed in a world, and all draws of its trials, (count,) each."""
    fixed, spans = VARIED[world]
    points = 2.0 * qmc.Sobol(len(spans), seed=DRAWS).random(max(64, count))[:count] - 1.0
    draws = {key: np.full(count, value) for key, value in fixed.items()}
    return fixed, draws | {key: span * points[:, i] for i, (key, span) in enumerate(spans.items())}


def generators(count: int) -> list[np.random.Generator]:
    return [np.random.default_rng([DRAWS, i]) for i in range(count)]


def told(name: str, result: Result) -> None:
    done = result.success
    low, high = binomtest(int(done.sum()), len(done)).proportion_ci(0.95)
    row(
        name, f"{done.sum()}/{len(done)} ({100 * low:.0f} to {100 * high:.0f} %)",
        f"{np.median(result.duration_s[done]):.1f} s, slowest "
        f"{result.duration_s[done].max():.1f} s", f"peak {np.median(result.peak_force_n):.0f} N, "
        f"95 % {np.percentile(result.peak_force_n, 95):.0f} N, largest {result.peak_force_n.max():.0f} N",
    )  # fmt: skip
    for i in np.flatnonzero(~done)[:5]:
        row("", f"trial {i}: {result.failure[i]}")


@pytest.mark.parametrize("world", VARIED)
@pytest.mark.parametrize("name", KINDS)
def test_a_late_arm_does_what_an_ideal_one_does_later_and_no_harder(world, name):
    """Of 32 draws 30 at least, which excludes a rate below 0.79 with 95 %; the peak is within the robot's own limit."""
    result = run(world, KINDS[name], 32)
    told(f"{world}, {name}", result)
    assert result.success.sum() >= 30
    if name != "torque":
        assert np.percentile(result.peak_force_n, 95) <= 80.0


@pytest.mark.parametrize("world", VARIED)
@pytest.mark.parametrize("name", UR5E)
def test_a_ur5e_by_position_or_velocity_does_peg_and_valley(world, name):
    """The design's figures: 61 of 64, 30 of 32, which exclude 0.86 and 0.79 with 95 %. Times are told."""
    given, count, median = UR5E[name]
    control = load_robot_model(given).spec.control if isinstance(given, str) else given
    result = run(world, control, count if world == "peg_in_hole" else 64, arm="ur5e_torque")
    told(f"ur5e, {world}, {name}, median asked for {median if world == 'peg_in_hole' else 10.0:g} s", result)
    if name == "torque":
        return  # the reference, whose failures are told
    assert result.success.sum() >= (61 if len(result.success) == 64 else 30)
    assert np.percentile(result.peak_force_n, 95) <= 70.0


@pytest.mark.parametrize("turning", [128.0, None])
def test_through_a_soft_mount_a_ur5e_by_position_does_the_peg_faster_and_softer(turning):
    """The prototype's mount of 2e4 N/m and 200 Nm/rad, 1.4e4 N/m in series with 4e4. Of 32 draws 30, as above."""
    control = replace(KINDS["position, 500 Hz, 8 ms"], contact_stiffness=1.4e4, contact_turning_stiffness=turning)
    result = run("peg_in_hole", control, 32, arm="ur5e_torque", mount=Mount(stiffness=2e4, turning_stiffness=200.0))
    told(f"ur5e, peg_in_hole, soft mount, turning stiffness {turning}", result)
    assert result.success.sum() >= 30
    assert np.percentile(result.peak_force_n, 95) <= 70.0


@pytest.mark.parametrize("lower", [0.0, 0.002, 0.006])
@pytest.mark.parametrize("world", VARIED)
@pytest.mark.parametrize("name", ["torque", "position, 500 Hz, 8 ms"])
def test_a_tare_in_contact_is_named_and_no_other(name, world, lower):
    """What the tare leaves of the bias tells: noise leaves 0.03 N an axis, contact its own force. 256 starts each."""
    runs, setup = set_up(world, KINDS[name], "ur5e_torque")
    fixed, draws = drawn(world, 256)
    start = fixed["start.offset_z"] - (0.04 if world == "valley" and lower else 0.0)
    draws["start.offset_z"] = np.full(256, start - lower)
    loop = begin(runs, setup, draws, generators(256))
    loop.prepare()
    wrong = norm(loop.drive.limb.sensors._bias[:, :3]) >= TARED_IN_CONTACT
    named = np.array([any("was tared" in note for note in loop.drive.notes(i)) for i in range(256)])
    row(
        f"{name}, {world}, {1e3 * start - 1e3 * lower:+.0f} mm", f"tared in contact {wrong.sum()} of 256",
        f"named {(named & wrong).sum()}, missed {(~named & wrong).sum()}, false {(named & ~wrong).sum()}",
    )  # fmt: skip
    assert (named & ~wrong).sum() + (~named & wrong).sum() <= 5  # forces about 0.5 N, which noise carries either way


@pytest.mark.parametrize("name", ["position, 500 Hz, 8 ms", "velocity, 1 kHz, 3 ms"])
def test_the_least_damping_without_a_force_limit_is_within_a_fifth_of_the_formula(name, monkeypatch):
    monkeypatch.setattr("skillframe.control.admittance.CALMING", 1.0)  # or ringing would be calmed, and find no limit
    arm = KINDS[name].admittance
    late = PANDA_STIFFNESS * arm.total_delay
    formula = min(0.57 * late + 0.15 * np.sqrt(PANDA_STIFFNESS * VIRTUAL_MASS), late)
    low, high = 0.5 * formula, 2.0 * formula
    while high > 1.05 * low:
        middle = float(np.sqrt(low * high))
        own = replace(KINDS[name], contact_stiffness=middle / (1.5 * arm.total_delay), push_n=20.0,
                      contact_turning_stiffness=10.0 / (1.5 * arm.total_delay))  # fmt: skip
        result = run("valley", own, 8, 8.0 / own.pace())
        stopped = any("force" in str(reason) for reason in result.reason)
        low, high = (middle, high) if stopped else (low, middle)
    row(name, f"least damping {high:.0f} Ns/m", f"formula {formula:.0f} Ns/m")
    assert high == pytest.approx(formula, rel=0.2)
