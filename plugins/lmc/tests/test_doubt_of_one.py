"""One demonstration whose hand pushes aside is told to leave the push open."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_lmc.advice import GOOD, LIMP, OTHER_SIDE, STILL, advice

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.reading import read_demonstration
from skillframe.extend.registry import registry
from tests.sound_slides import eased, slide, slow_noise

pytestmark = pytest.mark.needs_plugins


def pushed_aside(seed: int, way: float = 0.008, sign: float = -1.0, aside_deg: float = 50.0) -> Demonstration:
    """Straight down by 260 mm, wandering, while the hand pushes aside, then a press of 60 N.

    Args:
        seed: of all that is drawn.
        way: how far it wanders [m].
        sign: -1 for the wrench of the environment, 1 for the hand's taken for it.
        aside_deg: angle of the hand's push to straight down [degrees].
    """
    rng = np.random.default_rng([seed, 19])
    time = np.arange(0.0, 5.0, 0.01)
    u = np.clip((time - 0.5) / 3.0, 0.0, 1.0)
    wander = slow_noise(rng, time, 0.6, 3) * way * np.sin(np.pi * u)[:, None]
    position = np.array([0.3, 0.2, 0.5]) - np.outer(0.26 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2), [0, 0, 1]) + wander
    aside = np.radians(aside_deg)
    hand = 25.0 * np.array([-np.sin(aside), 0.0, -np.cos(aside)])
    force = np.outer(np.clip((time - 0.5) / 0.3, 0.0, 1.0) * (time < 3.5), hand)
    force += np.outer(np.clip((time - 3.5) / 0.1, 0.0, 1.0), [-8.0, -5.0, -60.0])
    force += 3.0 * slow_noise(rng, time, 0.4, 3) * (time > 0.5)[:, None] + 0.3 * rng.normal(size=force.shape)
    wrench = np.concatenate([sign * force, 0.01 * rng.normal(size=force.shape)], axis=1)
    down = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    return Demonstration(time=time, position=position, quaternion=down, wrench=wrench, source="aside")


def said(demonstration: Demonstration) -> tuple[float | None, str, str]:
    """How far the push is from straight down [degrees], how sure it is said to be, and what is to be done next."""
    document = learned(registry().skill("lmc"), [demonstration], LearnOptions())
    push = document["phases"][0]["translation"]["desired_direction"]
    off = None if push is None else float(np.degrees(np.arccos(np.clip(-push[2], -1.0, 1.0))))
    return (off, *advice(document))


@pytest.mark.parametrize("way", [0.0, 0.008])
@pytest.mark.parametrize("seed", range(3))
def test_a_push_that_one_demonstration_never_went_along_is_wide_and_asks_for_the_other_side(
    seed: int, way: float
) -> None:
    off, sure, then = said(pushed_aside(seed, way))
    assert off is not None and off > 5.0  # of straight down, as it went
    assert then.startswith(OTHER_SIDE)
    (degrees,) = re.findall(r"(\d+) degrees", sure)
    assert int(degrees) > off


def test_the_hands_force_taken_for_the_environments_is_not_good_to_try() -> None:
    off, sure, then = said(pushed_aside(0, sign=1.0))
    assert off is None and sure.startswith("no direction was found")
    assert then == LIMP and "--set wrench-sign=teacher" in then and "run" not in then.split()


def test_a_tool_that_stays_where_it_is_is_not_good_to_try() -> None:
    d = pushed_aside(0)
    rest = Demonstration(
        time=d.time, position=np.array([0.6, 0.0, 0.4]) + 1e-5 * d.position, quaternion=d.quaternion, wrench=d.wrench
    )
    assert said(rest)[2] == STILL != GOOD


@pytest.mark.parametrize("seed", [0, 4, 12, 14])
def test_a_hand_that_wanders_far_and_pushes_aside_is_asked_for_the_other_side(seed: int) -> None:
    off, _, then = said(pushed_aside(seed, 0.02))
    assert off is not None and off > 10.0
    assert then.startswith(OTHER_SIDE)


def test_four_demonstrations_whose_hand_pushes_aside_are_doubted_because_the_press_at_the_end_is_elsewhere() -> None:
    """They agree on a push, which was the hand's in the air."""
    document = learned(
        registry().skill("lmc"), [pushed_aside(seed, 0.02, aside_deg=70.0) for seed in range(4)], LearnOptions()
    )
    sure, then = advice(document)
    assert sure.startswith("doubtful: at the end the tool was pressed") and then == OTHER_SIDE
    (degrees,) = re.findall(r"(\d+) degrees", sure)
    push = np.array(document["phases"][0]["translation"]["desired_direction"])
    pressed = np.array([-8.0, -5.0, -60.0]) / np.linalg.norm([8.0, 5.0, 60.0])
    assert float(degrees) == pytest.approx(np.degrees(np.arccos(push @ pressed)), abs=2.0)


@pytest.mark.parametrize("seed", [0, 2, 4, 13, 25, 31, 42, 47])
def test_a_slide_after_an_approach_is_not_doubted(seed: int, tmp_path) -> None:
    each = slide(seed)
    each.write(str(tmp_path / "slide.csv"))
    assert "doubtful" not in said(read_demonstration(tmp_path / "slide.csv", wrench_frame=each.frame))[1]


def test_a_slide_whose_force_shows_on_half_of_its_way_is_open() -> None:
    """Approach and leaving, which are not in contact, say nothing of the side to which it slid."""
    time = np.arange(0.0, 7.5, 0.001)
    up = 0.12 * (1.0 - eased((time - 0.5) / 2.0)) + 0.05 * eased((time - 6.0) / 1.2)
    position = np.stack([0.4 + 0.08 * eased((time - 3.0) / 3.0), 0.0 * time, up], axis=1)
    bump = np.exp(-(((time - 4.2) / 0.5) ** 2)) * (time > 2.5) * (time < 6.0)
    force = np.round(np.outer(bump, [-2.18, 0.7, 11.0]) / 0.009) * 0.009
    angle = np.radians(20.0) * eased((time - 0.5) / 5.5)
    turned = Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.3])) * Rotation.from_euler("x", np.pi)
    wrench = np.concatenate([force, np.cross(turned.apply([0.0, 0.0, 0.02]), force)], axis=1)
    d = Demonstration(time=time, position=position, quaternion=turned.as_quat(), wrench=wrench, source="slide")
    assert said(d)[1].startswith("the push is open")


def test_a_long_slide_after_a_short_approach_is_not_doubted() -> None:
    time = np.arange(0.0, 7.5, 0.01)
    up = 0.02 * (1.0 - eased((time - 0.5) / 2.0)) + 0.02 * eased((time - 6.0) / 1.2)
    position = np.stack([0.4 + 0.15 * eased((time - 3.0) / 3.0), 0.0 * time, up], axis=1)
    on = np.clip((time - 2.5) / 0.1, 0.0, 1.0) * np.clip((6.0 - time) / 0.1, 0.0, 1.0)
    slides = np.tanh(np.gradient(position[:, 0], time) / 0.002)
    force = np.stack([-3.0 * slides * on, 0.0 * on, 12.0 * on], axis=1)
    wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
    wrench += 0.05 * np.random.default_rng(0).normal(size=wrench.shape) * np.repeat([1.0, 0.02], 3)
    down = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    off, sure, _ = said(Demonstration(time=time, position=position, quaternion=down, wrench=wrench, source="slide"))
    assert off is not None and off < 60.0  # between the approach and the slide, of which either is one witness
    assert "doubtful" not in sure and sure.startswith("the push is open")
