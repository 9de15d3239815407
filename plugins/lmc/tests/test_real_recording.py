"""The HIRO snap assembly, phase by phase, where $SKILLFRAME_RECORDINGS holds it (ODbL 1.0, see the how-to page)."""

import math

import numpy as np
import pytest
from skillframe_lmc.describe import describe
from skillframe_lmc.explain import explain
from skillframe_lmc.learner import learn

from skillframe.demonstration.record import Demonstration
from skillframe.extend import Document, LearnOptions
from skillframe.extend.reading import read_demonstration
from tests.references import recordings_dir

PHASES = {"approach": (0.0, 7.07), "alignment": (7.08, 15.38), "insertion": (15.385, 16.32), "mating": (16.33, 18.5)}


def recording(trial: str, start: float, stop: float) -> Demonstration:
    base = recordings_dir()
    if base is None or not (base / "hiro_snap_assembly").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold hiro_snap_assembly")
    folder = base / "hiro_snap_assembly" / trial
    return read_demonstration(
        folder / "R_CartPos.dat", columns="t,px,py,pz,roll,pitch,yaw", euler="xyz", wrench=folder / "worldforce.dat",
        wrench_columns="t,fx,fy,fz,tx,ty,tz", start=start, stop=stop,
    )  # fmt: skip


def phase(name: str, **settings: float) -> Document:
    demos = [recording(trial, *PHASES[name]) for trial in ("02", "10")]
    return learn(demos, LearnOptions(settings=settings))


@pytest.mark.parametrize("name", PHASES)
@pytest.mark.slow
def test_every_phase_is_learned_told_and_drawn(name: str) -> None:
    body = phase(name)
    assert len(describe(body)) >= 5
    assert all(picture.svg.startswith("<svg") for picture in explain(body))


def test_alignment_is_levering_about_minus_y() -> None:
    found = phase("alignment")["phases"][0]
    assert found["translation"]["fully_compliant"]
    assert found["translation"]["evidence"]["work_fraction"] > 0.9
    # 10 degrees: the part is held askew by a few; the two trials agree within one
    assert -found["rotation"]["desired_direction"][1] > math.cos(math.radians(10.0))


def test_trial_22_alone_says_the_same_of_its_alignment() -> None:
    found = learn([recording("22", 5.24, 11.95)], LearnOptions())["phases"][0]
    assert found["translation"]["fully_compliant"]
    assert -found["rotation"]["desired_direction"][1] > math.cos(math.radians(20.0))


def test_both_trials_teach_the_same_turn() -> None:
    one, two = (
        np.array(
            learn([recording(t, *PHASES["alignment"])], LearnOptions())["phases"][0]["rotation"]["desired_direction"]
        )
        for t in ("02", "10")
    )
    assert one @ two > math.cos(math.radians(5.0))


def test_the_bent_approach_is_not_a_linear_motion_and_says_so() -> None:
    part = phase("approach")["phases"][0]["translation"]
    assert part["desired_direction"] is None
    assert "is a single linear motion" in part["evidence"]["message"]


@pytest.mark.parametrize("name", ["insertion", "mating"])
def test_motions_of_four_millimetres_are_held_and_say_how_to_count_them(name: str) -> None:
    part = phase(name)["phases"][0]["translation"]
    assert part["evidence"]["held"]
    assert "--set moving_m" in part["evidence"]["message"]
    assert not phase(name, moving_m=0.002, moving_rad=0.01)["phases"][0]["translation"]["evidence"]["held"]
