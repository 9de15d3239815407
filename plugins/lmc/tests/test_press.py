"""A press - a way through the air, then a force on a surface that does not give way - is learned as a push."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from skillframe_lmc import intervals
from skillframe_lmc.describe import describe
from skillframe_lmc.intervals import track
from skillframe_lmc.learner import learn
from skillframe_lmc.posterior import Choice
from skillframe_lmc.press import Press, contradiction, presses
from skillframe_lmc.settings import Settings
from synthetic import valley

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.extend.reading import write_demonstration
from skillframe.frames import Float, cross, unit

RATE, SPEED = 200.0, 0.08


def wander(rng: np.random.Generator, sigma: float, tau: float, count: int, width: int) -> Float:
    """Ornstein-Uhlenbeck noise (count, width)."""
    step, driven = 1.0 / RATE, sigma * rng.normal(size=(count, width))
    driven[1:] *= np.sqrt(2.0 * step / tau)
    filtered: Float = lfilter([1.0], [1.0, step / tau - 1.0], driven, axis=0)
    return filtered


def press(
    seed: int, direction: Sequence[float] = (0.0, 0.0, -1.0), *, force: float = 40.0, length: float = 0.24,
    aim: float = 7.0, residual: float = 2.0, hold: float = 4.0, turn: float = 0.0,
) -> Demonstration:  # fmt: skip
    """A person's press: a way whose aim wanders [degrees], then a force within 5 degrees of the direction.

    In the air the wrench reads a residual [N per axis] that wanders over 0.3 s, as gravity and inertia leave one.
    `turn` lets the standing force turn to and fro by that angle [degrees].
    """
    rng = np.random.default_rng([31, seed])
    d = unit(np.array(direction, dtype=float))
    a = unit(cross(d, np.array([1.0, 0.0, 0.3])))
    b = cross(d, a)
    count, stand = int(length / SPEED * RATE), int(hold * RATE)
    off = wander(rng, np.radians(aim), 0.5, count, 2)
    heading = unit(d + off[:, :1] * a + off[:, 1:] * b)
    profile = np.sin(np.pi * (np.arange(count) + 0.5) / count) * np.pi / 2.0
    way = np.cumsum(heading * (SPEED / RATE * profile)[:, None], axis=0)
    position = np.concatenate([way, np.repeat(way[-1:], stand, axis=0)]) + np.array([0.4, 0.1, 0.5])
    ramp = np.clip((np.arange(count + stand) - count) / (0.2 * RATE), 0.0, 1.0)[:, None]
    tilt = np.radians(5.0) * rng.normal(size=2)
    swing = np.radians(turn) * np.sin(np.pi * np.arange(count + stand) / RATE)[:, None]
    pushed = unit(d + (tilt[0] + swing) * a + tilt[1] * b)
    wrench = np.zeros((count + stand, 6))
    wrench[:, :3] = wander(rng, residual, 0.3, count + stand, 3) * (1.0 - 0.5 * ramp) - force * ramp * pushed
    wrench += rng.normal(size=wrench.shape) * np.repeat([0.1, 0.005], 3)
    position = position + 4e-4 * ramp * d + 1e-5 * rng.normal(size=position.shape)
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (len(position), 1))
    return Demonstration(time=np.arange(len(position)) / RATE, position=position, quaternion=quaternion, wrench=wrench)


def translation(documents: Document) -> Document:
    part: Document = documents["phases"][0]["translation"]
    return part


def off(part: Document, direction: Sequence[float]) -> float:
    """Between the learned and the true direction [degrees]."""
    return float(np.degrees(np.arccos(np.clip(unit(np.array(direction)) @ np.array(part["desired_direction"]), -1, 1))))


CASES: dict[str, dict[str, Any]] = {
    "down": {}, "sideways": {"direction": (1.0, 0.2, 0.0)}, "aslant": {"direction": (0.3, 0.0, -1.0)},
    "up": {"direction": (0.0, 0.1, 1.0)}, "15 N": {"force": 15.0}, "100 N": {"force": 100.0},
    "a shaky hand": {"aim": 12.0}, "a short way": {"length": 0.06}, "1 s": {"hold": 1.0},
    "little in the air": {"residual": 0.3},
}  # fmt: skip


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("case", CASES)
def test_a_press_is_a_push_and_no_limpness_along_it(case: str, count: int) -> None:
    true = CASES[case].get("direction", (0.0, 0.0, -1.0))
    for seed in range(4):
        document = learn([press(10 * seed + i, **CASES[case]) for i in range(count)], LearnOptions())
        part = translation(document)
        assert part["desired_direction"] is not None, describe(document)
        # where the way alone decides, one wandering way is all there is; past 45 degrees it would slide, not press
        assert off(part, true) < 45.0
        along = [abs(np.array(axis) @ unit(np.array(true))) for axis in part["compliant_axes"]]
        assert not part["fully_compliant"]
        assert max(along, default=0.0) < np.sin(np.radians(45.0))


def found_in(d: Demonstration) -> Press:
    """What its standing force and its way say."""
    here = np.zeros(3)
    blocks = track(d, here, here, "base")
    (result,) = presses([blocks], [intervals.translation(blocks, Settings())]) or []
    return result


def test_way_and_standing_force_together_are_nearer_than_either() -> None:
    down = np.array([0.0, 0.0, -1.0])
    each = [found_in(press(2000 + seed)) for seed in range(40)]
    assert all(p.in_air for p in each)
    way, force, both = (
        float(np.sqrt(np.mean([np.degrees(np.arccos(v @ down)) ** 2 for v in vectors])))
        for vectors in ([p.way for p in each], [unit(p.votes.mean(axis=0)) for p in each], [p.push for p in each])
    )
    # two axes of 5 degrees for the force; 7 degrees over 3 s with 0.5 s of memory leave 7 sqrt(1 / 3.5) = 3.7 an axis
    # for the way, and the inverse variances add up: 3.0. 40 seeds scatter by 11 %.
    assert force == pytest.approx(np.sqrt(2.0) * 5.0, rel=0.33)
    assert way == pytest.approx(np.sqrt(2.0) * 3.7, rel=0.33)
    assert both == pytest.approx(np.sqrt(2.0) * 3.0, rel=0.33)
    assert both < min(way, force)


def test_where_nothing_was_met_on_the_way_both_decide_and_it_is_said() -> None:
    part = translation(learn([press(3)], LearnOptions()))
    assert re.match(r"nothing was met on the way, so the push is that of the way \(\d+ %", part["evidence"]["message"])
    assert part["desired_direction"] == pytest.approx(found_in(press(3)).push.tolist())
    assert part["compliant_axes"] == []


def test_a_way_with_friction_or_a_bend_is_not_mixed_in_or_counts_little() -> None:
    rubbed = press(0, residual=0.3)
    moving = np.arange(len(rubbed.time)) < int(0.24 / SPEED * RATE)
    sliding = rubbed.wrench + np.outer(moving, [8.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not found_in(replace(rubbed, wrench=sliding)).in_air
    d = press(5, aim=0.0)
    bent = d.position.copy()
    bent[:, 0] += np.minimum(0.08, 0.08 * np.arange(len(bent)) / (0.5 * 0.24 / SPEED * RATE))
    p = found_in(replace(d, position=bent))
    force = unit(p.votes.mean(axis=0))
    # half of the way runs 30 degrees aside: the scatter of its headings takes the weight off it
    assert np.arccos(p.push @ force) < 0.5 * np.arccos(p.push @ p.way)


def undecided(count: int) -> list[Document]:
    """Learned of presses of which the way alone gives no direction: by the sensor's word in the air it is free."""
    groups = [[press(100 * s + i, aim=14.0, residual=3.0) for i in range(count)] for s in range(8)]
    return [
        d for d in (learn(g, LearnOptions()) for g in groups) if "stood for" in translation(d)["evidence"]["message"]
    ]


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.slow
def test_where_the_way_gives_no_direction_the_standing_force_does_and_says_so(count: int) -> None:
    documents = undecided(count)
    assert len(documents) >= 3
    for document in documents:
        # each force is within 5 degrees per axis of the press: the worst of a few lies within 15
        assert off(translation(document), (0.0, 0.0, -1.0)) < 15.0
        assert re.search(r"N under which the tool stood for 3\.[789] s", " ".join(describe(document)))
        assert document["phases"][0]["stop"]["lead_force_n"] == pytest.approx(40.0, abs=3.0)  # what the teacher exerted
        assert translation(document)["compliant_axes"] == []


def test_a_standing_force_that_no_one_push_explains_is_refused_and_not_learned_as_limpness() -> None:
    group = [press(s, aim=20.0, residual=3.0, turn=70.0, length=0.1) for s in range(3)]
    with pytest.raises(InputError, match=r"was pressed with \d+ N where it stood.* no one push explains it"):
        learn(group, LearnOptions())


def halted(share: float, pushed: Sequence[float]) -> Demonstration:
    """Straight down by 0.24 m, with a halt of 2 s after that share of it, in which it is pushed so [N]."""
    way = np.linspace(0.0, 0.24, int(3.0 * RATE))
    at = round(share * (len(way) - 1))
    depth = np.concatenate([way[:at], np.full(int(2.0 * RATE), way[at]), way[at:]])
    stands = np.concatenate([np.zeros(at), np.ones(int(2.0 * RATE)), np.zeros(len(way) - at)])
    position = np.array([0.4, 0.1, 0.5]) - depth[:, None] * [0.0, 0.0, 1.0]
    force = -stands[:, None] * np.array(pushed) + [0.5, 0.0, 0.0]
    wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (len(depth), 1))
    return Demonstration(time=np.arange(len(depth)) / RATE, position=position, quaternion=quaternion, wrench=wrench)


@pytest.mark.parametrize(
    ("share", "pushed", "found"),
    [(0.8, (0.0, 0.0, -40.0), True), (0.3, (0.0, 0.0, -40.0), False), (0.8, (40.0, 0.0, 0.0), False)],
    ids=["at its end", "early on its way", "across its way"],
)
def test_only_a_push_along_the_way_and_at_its_far_end_is_a_press(
    share: float, pushed: Sequence[float], found: bool
) -> None:
    here = np.zeros(3)
    blocks = track(halted(share, pushed), here, here, "base")
    assert (presses([blocks], [intervals.translation(blocks, Settings())]) is not None) == found


def test_a_valley_does_not_ask_the_standing_force() -> None:
    assert "stood" not in translation(learn(valley(45.0, 0.2), LearnOptions()))["evidence"]["message"]


def slanted(seed: int) -> Demonstration:
    """Straight down, and in the air the wrench reads the teacher's grip: 5.7 N aslant, without any contact."""
    d = press(seed, aim=7.0, residual=0.3, hold=0.0, length=0.2)
    wrench = d.wrench + np.array([4.0, 0.0, 4.0, 0.0, 0.0, 0.0])
    return Demonstration(time=d.time, position=d.position, quaternion=d.quaternion, wrench=wrench)


@pytest.mark.slow
def test_a_direction_that_no_motion_took_is_open_and_asks_for_the_other_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All went straight down, and the wrench reads a push from 45 degrees aside."""
    paths = [str(tmp_path / f"{seed}.npz") for seed in range(5)]
    for seed, path in enumerate(paths):
        write_demonstration(slanted(seed), Path(path))
    assert run(["learn", *paths, "--out", str(tmp_path / "a.skill.json")]) == 0
    part = translation(learn([slanted(seed) for seed in range(5)], LearnOptions()))
    assert 5.0 < off(part, (0.0, 0.0, -1.0)) < np.degrees(part["evidence"]["feasible_half_width_rad"])
    said = " ".join(capsys.readouterr().out.split())
    assert "sure: the push is open: up to" in said
    assert "next: add a demonstration from the other side, going towards -x" in said
    assert "open" not in translation(learn(valley(45.0, 0.2), LearnOptions()))["evidence"]["message"]


@pytest.mark.parametrize(("degrees_off", "contradicts"), [(23.0, False), (27.0, True)])
def test_a_standing_force_contradicts_a_push_beyond_its_half_width_and_the_lean_of_a_hand(degrees_off, contradicts):
    """20 degrees and 5."""
    off = np.radians(degrees_off)
    votes = np.tile([np.sin(off), 0.0, -np.cos(off)], (5, 1))
    stood = SimpleNamespace(votes=votes)
    push = Choice(np.array([0.0, 0.0, -1.0]), 0.9, 0.3, np.radians(20.0))
    assert contradiction([stood], push) == pytest.approx(off if contradicts else 0.0)
    assert contradiction([stood], None) == contradiction([stood], push._replace(direction=None)) == 0.0
