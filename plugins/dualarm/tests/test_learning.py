"""From one arm led, while the other stands still, to two arms that insert."""

from functools import cache

import numpy as np
import pytest
from skillframe_dualarm.document import read_phase
from skillframe_dualarm.dual_peg import DualPegParams, build
from skillframe_dualarm.learner import learn
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.document.file import load, new_document, save
from skillframe.errors import InputError, UnknownName
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, prepare
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

pytestmark = pytest.mark.needs_plugins
SCENE = build(DualPegParams())


@cache
def robot():
    return load_robot_model("dual_panda")


def demonstrations(seed=0):
    return recorded(seed)


@cache
def recorded(seed):
    local = TeacherSettings(kind="teleoperation", delay_s=0.02)  # master beside slave; 0.1 s is too late to teach this
    return record(robot(), SCENE, local, count=2, seed=seed)


def degrees(a, b):
    return np.degrees(np.arccos(np.clip(np.abs(np.dot(a, b)), -1.0, 1.0)))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_one_arm_led_teaches_what_the_paper_learned(seed):
    phase = read_phase(learn(demonstrations(seed).demonstrations, LearnOptions()))
    assert degrees(phase.desired_direction, [0.0, 0.0, 1.0]) < 10.0  # threshold of the published row
    (along,), (about,) = phase.compliant_translation, phase.compliant_rotation
    assert degrees(along, [1.0, 0.0, 0.0]) < 15.0 and degrees(about, [0.0, 1.0, 0.0]) < 15.0


def test_the_second_arm_stood_still_while_the_first_was_led():
    first = demonstrations().demonstrations[0]
    assert first.meta["teacher"] == "teleoperation" and first.meta["robot"] == "dual_panda"
    assert first.position[-1, 0] - first.position[0, 0] > 0.04  # the peg went in, towards the other arm


def test_settings_choose_configuration_and_mode():
    options = LearnOptions(settings={"configuration": "C", "mode": "relative"})
    phase = read_phase(learn(demonstrations().demonstrations, options))
    assert phase.mode == "relative" and phase.arms[0].compliant == ("translation", "rotation")


def test_settings_that_nobody_knows_are_refused():
    with pytest.raises(UnknownName):
        learn(demonstrations().demonstrations, LearnOptions(settings={"configuration": "Z"}))
    with pytest.raises(InputError, match="modus"):
        learn(demonstrations().demonstrations, LearnOptions(settings={"modus": "relative"}))


@pytest.fixture
def document(tmp_path):
    kind = registry().coordinator("dual_arm")
    body = learn(demonstrations().demonstrations, LearnOptions(settings={"configuration": "D"}))
    save(new_document(kind, body, demonstrations().demonstrations), tmp_path / "pair.skill.json")
    return load(tmp_path / "pair.skill.json")


def tried(document, seconds):
    skill, setup = prepare(robot(), SCENE, document)
    draws = {"start.tilt_y": np.radians([6.0, -6.0])}
    return simulate(skill, setup, draws, [np.random.default_rng(i) for i in range(2)], duration_s=seconds)


@pytest.mark.slow
def test_what_was_learned_is_saved_read_and_runs(document):
    assert document["created_by"]["plugin"] == "skillframe-dualarm"
    result = tried(document, 0.5)
    assert all(reason.startswith("time limit") for reason in result.reason), result.reason


@pytest.mark.slow
@pytest.mark.figures
def test_what_was_learned_inserts_from_both_sides(document):
    result = tried(document, 12.0)
    assert result.success.all(), result.failure


def test_a_centre_of_compliance_from_outside_is_refused():
    body = learn(demonstrations().demonstrations, LearnOptions())
    document = new_document(registry().coordinator("dual_arm"), body)
    with pytest.raises(InputError, match="each arm"):
        prepare(robot(), SCENE, document, "tip")
