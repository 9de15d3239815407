"""Whatever is wrong with demonstrations, settings or a policy file, one sentence says what, where and what to do."""

import copy
import json
import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from skillframe_segmenter.boundaries import Move, moved
from skillframe_segmenter.learning import relabelled
from skillframe_segmenter.segmentation import refitted

from skillframe.cli import main
from skillframe.errors import InputError, SkillframeError
from skillframe.extend import LearnOptions
from skillframe.extend.reading import write_demonstration
from skillframe.extend.registry import registry
from tests.figures import quasistatic as made

Z = np.array([0.0, 0.0, 1.0])
X = np.array([1.0, 0.0, 0.0])


def learn(demonstrations, **settings):
    named = [replace(d, source=f"demo{i + 1}.npz") for i, d in enumerate(demonstrations)]
    return registry().skill("policy").learn(named, LearnOptions(settings=settings))


def legs(seed, *directions, length=0.04):
    """A free motion leg by leg, 8 degrees of aim noise."""
    hand = made.Hand(rng=np.random.default_rng([45, seed]))
    for direction in directions:
        hand.move_free(np.asarray(direction, dtype=float), length)
    return hand.finish().demonstration


def slides(count=3):
    return [m.demonstration for m in made.demonstrations("ls", 2, count)]


def test_a_demonstration_too_short_to_have_phases_says_so():
    with pytest.raises(InputError, match="too short to have phases"):
        learn([slides(1)[0].between(0.0, 0.3)])


def test_values_that_are_not_finite_are_refused():
    one = slides(1)[0]
    wrench = one.wrench.copy()
    wrench[100, 2] = np.nan
    with pytest.raises(InputError, match="not finite"):
        learn([replace(one, wrench=wrench)])


def test_no_demonstration_is_refused():
    with pytest.raises(InputError, match="no demonstration"):
        learn([])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"temper": -1.0}, "temper"),
        ({"switch_posterior": 0.3}, "switch_posterior"),
        ({"phases_max": 50}, "phases_max"),
        ({"merge_angl_rad": 0.3}, "merge_angl_rad"),
        ({"segmenter": "wrench_hm"}, "wrench_hmm"),
        ({"skill": "lcm"}, "lmc"),
        ({"recoveries": -1}, "recoveries"),
        ({"phases": 2.5}, "phases"),
        ({"set_boundary": ["1:1"]}, "DEMONSTRATION:BOUNDARY=SECONDS"),
        ({"set_boundary": ["4:1=1.0"]}, "demonstration"),
        ({"set_boundary": ["1:9=1.0"]}, "has no boundary 9"),
    ],
)
@pytest.mark.slow
def test_settings_that_make_no_sense_are_named(settings, words):
    with pytest.raises(SkillframeError, match=words):
        learn(slides(), **settings)


ROW = {"file": "a.npz", "start": 1.0, "end": 3.0, "boundaries": [1.5, 2.0], "labels": [0, 1, 0]}


@pytest.mark.parametrize(
    ("moves", "words"),
    [
        ([(0, 1.1)], r"a.npz: boundary 1 at 1.1 s leaves a phase of 0.1 s, and one needs 0.2 s; put it from 1.20 s to"),
        ([(0, 1.9)], r"leaves a phase of 0.1 s, .* put it from 1.20 s to 1.80 s"),
        ([(1, 2.81)], r"boundary 2 at 2.81 s leaves a phase of 0.19 s, .* put it from 1.70 s to 2.80 s"),
        ([(0, 2.5), (1, 2.6)], r"boundary 1 at 2.5 s leaves a phase of 0.1 s, .* from 1.20 s to 2.40 s"),
    ],
)
def test_a_boundary_that_leaves_a_phase_too_short_is_refused_with_where_it_may_be(moves, words):
    with pytest.raises(InputError, match=words):
        moved([ROW], [Move(0, *move) for move in moves], ["a.npz"])


def test_the_shortest_phase_is_taken_on_either_side_and_what_was_found_is_kept():
    rows = moved([ROW, ROW], [Move(0, 0, 1.2), Move(0, 1, 2.8)], ["a.npz", "b.npz"])
    found = {"boundaries": [1.5, 2.0], "labels": [0, 1, 0]}
    assert rows[0] == {**ROW, "boundaries": [1.2, 2.8], "set": [0, 1], "found": found}
    assert rows[1] == {**ROW, "found": found}


def test_a_phase_found_shorter_than_that_stays_where_nobody_moves_it():
    short = {**ROW, "boundaries": [1.5, 2.85]}
    assert moved([short], [Move(0, 0, 1.4)], ["a.npz"])[0]["boundaries"] == [1.4, 2.85]


def test_a_boundary_with_no_room_says_to_move_its_neighbours():
    tight = {**ROW, "boundaries": [1.5, 1.6, 1.8], "labels": [0, 1, 0, 1]}
    with pytest.raises(InputError, match="move its neighbours too"):
        moved([tight], [Move(0, 1, 1.65)], ["a.npz"])


@pytest.fixture(scope="module")
def policy():
    body = learn(slides())
    return {**body, "type": "policy", "type_version": 1}


def check(document):
    registry().skill("policy").check(document)


def test_a_policy_whose_phase_model_does_not_match_its_phases_says_how_many_it_knows(policy):
    fewer = copy.deepcopy(policy)
    del fewer["phases"][1]
    with pytest.raises(InputError, match="knows 2 phases, but the file holds 1"):
        check(fewer)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("phase_model"), "phase_model"),
        (lambda d: d["phase_model"].pop("scales"), "scales"),
        (lambda d: d["phase_model"]["scales"].pop("force"), "four"),
        (lambda d: d["phase_model"].update(phase_of=[0, 0]), "phase_of"),
        (lambda d: d["phase_model"]["direction"].pop(), "direction"),
        (lambda d: d["phase_model"].update(covariance="wide"), "covariance"),
        (lambda d: d["phase_model"].update(successors=[[1.0, 1.0]]), "phases"),
        (lambda d: d["phase_model"].update(version=99), "version"),
        (lambda d: d["phase_model"].update(version=1), "segment again"),  # its gate was another
        (lambda d: d["phase_model"]["gate"].pop("mean"), "mean"),
        (lambda d: d["phase_model"]["gate"].update(covariance=[[[0.0] * 6] * 6] * 2), "positive definite"),
        (lambda d: d["phase_model"].update(type=3), "phase_model"),
        (lambda d: d.update(recoveries=-1), "recoveries"),
        (lambda d: d["demonstrations"][0].update(labels=[0, 2]), r"demonstrations\[0\]"),
        (lambda d: d.update(demonstrations="three"), "demonstrations"),
        (lambda d: d["phases"][1].pop("skill"), r"phases\[1\]"),
        (lambda d: d["phases"][1]["translation"].pop("stiffness"), r"phases\[1\]"),
    ],
)
def test_a_policy_file_that_was_edited_names_the_key(policy, change, words):
    edited = copy.deepcopy(policy)
    change(edited)
    with pytest.raises(InputError, match=words):
        check(edited)


class Said(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys):
    def run(*words):
        code = main.run([str(w) for w in words])
        return Said(code, *capsys.readouterr())

    return run


@pytest.fixture
def files(tmp_path):
    for i, demonstration in enumerate(slides(2)):
        write_demonstration(demonstration, tmp_path / f"d{i + 1}.npz")
    return [tmp_path / "d1.npz", tmp_path / "d2.npz"]


@pytest.mark.slow
def test_segment_writes_a_policy_with_boundaries_and_labels_in_the_order_of_its_arguments(run, files, tmp_path):
    out = tmp_path / "p.json"
    result = run("segment", *files, "--out", out)
    assert result.code == 0, result.err
    document = json.loads(out.read_text())
    assert document["format"] == "skillframe.skill" and document["type"] == "policy"
    assert len(document["phases"]) == 2 and "phase_model" in document
    for row, file in zip(document["demonstrations"], files, strict=True):
        assert row["file"].endswith(file.name)
        assert len(row["labels"]) == len(row["boundaries"]) + 1


@pytest.mark.slow
def test_a_boundary_that_a_person_moves_stays_where_it_was_put(run, files, tmp_path):
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    assert run("segment", *files, "--out", first).code == 0
    before = [row["boundaries"] for row in json.loads(first.read_text())["demonstrations"]]
    wanted = before[1][0] + 0.2
    assert run("segment", *files, "--out", second, "--set-boundary", f"d2.npz:1={wanted}").code == 0
    after = [row["boundaries"] for row in json.loads(second.read_text())["demonstrations"]]
    assert after[1] == [wanted]
    assert after[0] == pytest.approx(before[0], abs=0.3)
    document = json.loads(second.read_text())
    assert document["phase_model"]["direction"] != json.loads(first.read_text())["phase_model"]["direction"]


@pytest.mark.slow
def test_boundaries_are_counted_after_phases_are_joined_and_any_of_them_can_be_moved():
    """Joining takes boundaries away that the segmenter has found. Nobody sees those, and they must not come back."""
    demonstrations = [legs(i, X, Z, -X) for i in range(3)]
    found = registry().segmenter("wrench_hmm").fit(demonstrations, None, {})
    joined = relabelled(found, 1, 2)
    assert all(len(a["boundaries"]) > len(b["boundaries"]) for a, b in zip(*map(rows_in, (found, joined)), strict=True))
    for i, row in enumerate(rows_in(joined)):
        move = Move(i, 0, row["boundaries"][0] + 0.1)
        rows = moved(rows_in(joined), [move], ["a", "b", "c"])
        again = rows_in(refitted(joined, demonstrations, rows, {i}, None, {}))
        assert again[i]["boundaries"] == [move.time]
        assert [other["labels"] for other in again] == [other["labels"] for other in rows]


def rows_in(document):
    return document["demonstrations"]


@pytest.mark.parametrize("name", ["pose_hmm", "zvc"])
@pytest.mark.slow
def test_the_baselines_write_policies_that_are_read_again(run, files, tmp_path, name):
    out = tmp_path / "p.json"
    assert run("segment", *files, "--out", out, "--segmenter", name).code == 0
    shown = run("show", out)
    assert shown.code == 0 and "phase 1" in shown.out


@pytest.mark.slow
def test_the_policy_s_tree_prints_as_text(run, files, tmp_path):
    out = tmp_path / "p.json"
    result = run("segment", *files, "--out", out)
    assert "├─ phase 1: push along -z" in result.out
    assert "└─ phase 2:" in result.out and "then the end" in result.out
    assert run("show", out).out.count("phase 1") >= 2


def half(count=3):
    """Slides of which the last is cut off before the tool slides."""
    whole = slides(count)
    return [*whole[:-1], whole[-1].between(0.0, made.demonstrations("ls", 2, count)[-1].changes[0] - 0.1)]


@pytest.mark.parametrize(
    ("given", "options", "words"),
    [
        (lambda: [legs(1, -Z), legs(2, -Z), legs(3, X)], (), "d3.npz: shares no phase with the other demonstrations"),
        (half, (), "d3.npz: stops half-way: ends in phase 1, .* go on to phase 2"),
        (
            lambda: [legs(1, -Z, X), legs(2, -Z, X), legs(3, X, -Z)],
            (),
            r"d3.npz: goes through its phases the other way round \(2 - 1\)",
        ),
        (lambda: [legs(1, -Z, X), legs(3, X, -Z)], (), "the other way round"),
        (slides, ("--phases", "60"), r"d\d.npz: is \d.\d\d s long, which allows 1 to \d+ phases, not 60"),
        (slides, ("--phases", "0"), r"d\d.npz: is \d.\d\d s long, which allows 1 to \d+ phases, not 0"),
        (slides, ("--set-boundary", "1:1=99"), "boundary 1 cannot be at 99 s"),
        (slides, ("--set-boundary", "1:1=-1"), "boundary 1 cannot be at -1 s"),
        (slides, ("--set-boundary", "7:1=1.0"), "demonstration '7'"),
    ],
)
@pytest.mark.slow
def test_demonstrations_that_do_not_belong_together_end_segment_with_2_and_a_sentence(
    run, tmp_path, given, options, words
):
    demonstrations = given()
    files = [tmp_path / f"d{i + 1}.npz" for i in range(len(demonstrations))]
    for demonstration, path in zip(demonstrations, files, strict=True):
        write_demonstration(demonstration, path)
    result = run("segment", *files, "--out", tmp_path / "p.json", *options)
    assert result.code == 2
    assert re.search(words, " ".join(result.err.split())) and "Traceback" not in result.err
    assert not (tmp_path / "p.json").exists()


@pytest.mark.parametrize("command", [("show",), ("run", "--world", "corner", "--out", "t.npz")])
@pytest.mark.slow
def test_a_policy_file_whose_phase_model_does_not_match_ends_with_2_and_a_sentence(run, files, tmp_path, command):
    out = tmp_path / "p.json"
    assert run("segment", *files, "--out", out).code == 0
    document = json.loads(out.read_text())
    document["phases"] = document["phases"][:1]
    out.write_text(json.dumps(document))
    options = [str(tmp_path / w) if w.endswith(".npz") else w for w in command[1:]]
    words = [command[0], out, *options] if command[0] == "run" else [*command, out]
    result = run(*words)
    assert result.code == 2
    assert "knows 2 phases, but the file holds 1" in " ".join(result.err.split()) and "Traceback" not in result.err
    assert not list(tmp_path.glob("t*.npz"))
