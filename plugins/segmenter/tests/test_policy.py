"""A policy tells which phase ran when and why it switched: fed with what a demonstration felt, and run end to end."""

import re

import numpy as np
import pytest
from skillframe_segmenter.document import read, skill_of
from skillframe_segmenter.learning import _alike, as_phase, pieces

from skillframe.cli import main
from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Pose, matrix_from_quaternion
from skillframe.skill import Observation, Status
from tests.figures import quasistatic as made

DT = 1e-3


@pytest.fixture(scope="module")
def document():
    return learned(registry().skill("policy"), [m.demonstration for m in made.demonstrations("ls", 2)], LearnOptions())


def test_a_policy_does_not_go_on_to_what_one_demonstration_did_after_the_others_had_ended(document):
    rows = [{**document["demonstrations"][0], "labels": labels} for labels in ([0, 1], [0, 1, 0], [0, 1])]
    model = {**document["phase_model"], "successors": [[0.0, 3.0, 1.0], [1.0, 0.0, 2.0]]}
    lingered = {**document, "demonstrations": rows, "phase_model": model}
    np.testing.assert_array_equal(read(lingered).successors, [[0.0, 3.0, 1.0], [0.0, 0.0, 3.0]])


def felt(demonstration, shift=0.0, seconds=None):
    """What a tool would see that went as the demonstration did: resampled to 1 kHz, one trial."""
    wanted = np.arange(0.0, seconds or demonstration.duration, DT)
    at = np.searchsorted(demonstration.time, wanted).clip(max=len(demonstration.time) - 1)
    rotation = matrix_from_quaternion(demonstration.quaternion[at])
    for time, i, r in zip(wanted, at, rotation, strict=True):
        pose = Pose(demonstration.position[i][None] + shift, r[None])
        yield Observation(np.array([time]), DT, pose, np.zeros((1, 6)), demonstration.wrench[i][None])


def followed(document, observations):
    skill, begun = registry().skill("policy").build(document), False
    for observation in observations:
        if not begun:
            skill.start(observation, [np.random.default_rng(1)])
            begun = True
        command = skill.step(observation)
    return skill.journal(0), command


def test_a_policy_goes_on_when_the_wrench_of_the_next_phase_is_felt_and_says_so(document):
    one = made.demonstrations("ls", 2, 1, first=4)[0]
    journal, command = followed(document, felt(one.demonstration, seconds=one.changes[0] + 1.5))
    (begun, first), (switched, second), *_ = journal
    assert (begun, first) == (0.0, "phase 1: begins")
    assert second.startswith("phase 2: begins, as the wrench indicates (")
    # the gate waits two windows of 50 ms; a tool that still moves must have been asked for a second
    assert one.changes[0] < switched < one.changes[0] + 1.3
    assert command.status[0] == Status.RUNNING


@pytest.mark.slow
def test_a_policy_does_not_mind_where_the_table_stands(document):
    one = made.demonstrations("ls", 2, 1, first=4)[0]
    here, _ = followed(document, felt(one.demonstration, seconds=one.changes[0] + 1.5))
    there, _ = followed(document, felt(one.demonstration, shift=0.03, seconds=one.changes[0] + 1.5))
    assert there == here


@pytest.mark.slow
def test_a_report_of_a_run_shows_which_phase_ran_when_and_why_it_switched(tmp_path, capsys):
    out, trace, page = tmp_path / "p.json", tmp_path / "t.npz", tmp_path / "r.html"
    demo = tmp_path / "demo.npz"
    record = ["record", "--world", "corner", "--robot", "free_tool", "--teacher", "kinesthetic"]
    assert main.run([*record, "--count", "3", "--seed", "5", "--out", str(demo)]) == 0
    assert main.run(["segment", *map(str, sorted(tmp_path.glob("demo*.npz"))), "--out", str(out)]) == 0
    assert main.run(["run", str(out), "--world", "corner", "--robot", "free_tool", "--out", str(trace)]) == 0
    assert main.run(["report", str(trace), "--out", str(page)]) == 0
    told = page.read_text()
    assert re.search(r"phase 1: begins", told)
    assert re.search(r"phase 2: begins, as (the wrench indicates|phase 1 ended: came to rest)", told)
    assert "└─ phase 2" in capsys.readouterr().out


def test_what_phases_say_beside_themselves_is_kept_apart_unless_they_agree():
    bodies = [{"frame": {"axes": "base"}, "rate": 4.0, "trajectory": [k], "phases": [{"blend": k}]} for k in (1, 2)]
    shared = _alike(bodies)
    assert shared == ["frame", "rate"]
    phases = [as_phase(body, "replay", shared) for body in bodies]
    assert phases[1] == {"blend": 2, "skill": "replay", "beside": {"trajectory": [2]}}
    document = {"frame": {"axes": "base"}, "rate": 4.0, "phases": phases, "phase_model": {}, "type": "policy"}
    assert [skill_of(document, k) for k in range(2)] == [{**body, "type": "replay"} for body in bodies]


@pytest.mark.parametrize("skill", ["lmc", pytest.param("gmr", marks=pytest.mark.slow)])
def test_every_phase_holds_all_that_its_own_pieces_taught(skill):
    """A mixture's demonstrations stand beside its phase in the file. In a policy, each phase has its own."""
    taught = [m.demonstration for m in made.demonstrations("ls", 2)]
    kind = registry().skill(skill)
    document = learned(registry().skill("policy"), taught, LearnOptions(settings={"skill": skill}))
    count = len(document["phases"])
    assert count == 2
    for k in range(count):
        body = kind.learn(pieces(document, taught, [k]), LearnOptions())
        again = skill_of(document, k)
        assert {key: again[key] for key in body} == body
