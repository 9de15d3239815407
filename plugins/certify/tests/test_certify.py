"""Certified boxes: against closed forms, over random truths, and as a folder that may be killed at any step."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, qmc
from skillframe_certify import procedure
from skillframe_certify.binding import seed_of
from skillframe_certify.box import Box, peel
from skillframe_certify.certificate import check_certificate, outcome, write_certificate
from skillframe_certify.claim import certified, family, fresh_trials, judge, most_failures, passes
from skillframe_certify.engine import Engine, Looked
from skillframe_certify.question import Question, begin, read_question
from skillframe_certify.rounds import looked
from skillframe_worlds.valley import ValleyParams

from skillframe.campaign.folder import load
from skillframe.campaign.rows import ChunkJob, rows_of
from skillframe.campaign.runner import Options
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import InputError

CLOUD = 2.0 * qmc.Sobol(2, scramble=True, rng=np.random.default_rng(0)).random(4096) - 1.0


def ellipse(points, axes=(0.8, 0.5)):
    return np.sum((points / np.array(axes)) ** 2, axis=1) < 1.0


def test_trials_without_a_failure_that_certify_are_those_of_the_closed_form():
    """p^n <= alpha: 59 trials for 0.95, 299 for 0.99; with failures as in the binomial table."""
    for rate, none in ((0.9, 29), (0.95, 59), (0.99, 299)):
        assert passes(0, none, rate, 0.05)
        assert not passes(0, none - 1, rate, 0.05)
    assert [most_failures(n, 0.95, 0.05) for n in (58, 59, 93, 124, 181)] == [-1, 0, 1, 2, 4]


@pytest.mark.parametrize(("rate", "alpha"), [(0.9, 0.05), (0.95, 0.05), (0.99, 0.025)])
def test_a_skill_five_times_better_than_claimed_passes_in_the_smallest_box(rate, alpha):
    smallest = int(0.7 * fresh_trials(rate, alpha))
    good = (1.0 - rate) / 5.0
    assert binom.cdf(most_failures(smallest, rate, alpha), smallest, good) > 0.93  # planned for 0.95, less a saw-tooth


@pytest.mark.slow
def test_a_rate_of_exactly_what_is_claimed_is_certified_at_most_with_the_level():
    """2000 campaigns of rate 0.95 everywhere: 100 expected at most, 9.7 the standard deviation; three of them."""
    rng, boxes = np.random.default_rng(2026), family(Box(-np.ones(2), np.ones(2)))
    count = sum(
        certified(judge(boxes, 2.0 * rng.random((259, 2)) - 1.0, rng.random(259) < 0.95, 0.95, 0.05)) is not None
        for _ in range(2000)
    )
    assert count <= 129


def test_the_sequence_ends_at_the_first_box_that_fails():
    """All fail between the smallest and the middle box, none beyond: the largest may not pass by what lies outside."""
    boxes = family(Box(-np.ones(1), np.ones(1)))
    points = np.linspace(-1.0, 1.0, 4001)[:, None]
    works = ~(boxes[1].holds(points) & ~boxes[0].holds(points))
    tested = judge(boxes, points, works, 0.95, 0.05)
    assert [each.passed for each in tested] == [True, False]
    assert certified(tested) is tested[0]
    every = judge(boxes, points, np.ones(len(points), dtype=bool), 0.95, 0.05)
    assert certified(every) is every[-1]  # the largest that passed
    assert certified(judge(boxes, points, np.zeros(len(points), dtype=bool), 0.95, 0.05)) is None


def test_nested_boxes_have_their_shares_of_the_volume_about_one_centre():
    box = Box(np.array([-1.0, 0.2, -0.5]), np.array([0.0, 0.4, 1.0]))
    for each, share in zip(family(box), (0.7, 0.85, 1.0), strict=True):
        assert each.share / box.share == pytest.approx(share)
        assert (each.low + each.high) / 2.0 == pytest.approx((box.low + box.high) / 2.0)


def test_the_peeled_box_of_an_ellipse_is_nearly_the_largest_that_fits():
    """Sides a sqrt(2), b sqrt(2), of area 2 a b; a little more, as 1.25 % of its points may lie outside."""
    works = ellipse(CLOUD)
    box = peel(CLOUD, works, 0.0125)
    assert np.mean(~works[box.holds(CLOUD)]) <= 0.0125
    assert 0.9 < box.share / (2.0 * 0.8 * 0.5 / 4.0) < 1.3


@pytest.mark.slow
def test_no_box_is_proposed_over_places_where_two_trials_in_three_succeed():
    """Left of the middle all succeed, right of it 65 %: more than half, and less than the 80 % that count."""
    works = (CLOUD[:512, 0] < 0.0) | (np.random.default_rng(5).random(512) < 0.65)
    question = Question(rate=0.95, confidence=0.95, ranges={"x": (-1.0, 1.0), "y": (-1.0, 1.0)})
    box = procedure.propose(question, Looked(CLOUD[:512], works))
    assert box.high[0] < 0.3
    assert box.low[0] < -0.9


def test_where_nothing_works_no_box_is_proposed():
    assert peel(CLOUD, np.zeros(len(CLOUD), dtype=bool), 0.01) is None
    assert peel(CLOUD, np.random.default_rng(0).random(len(CLOUD)) < 0.3, 0.01) is None


TEXT = """
name = "valley"
seed = 7
trials = 1
robot = "robots/box/robot.toml"
world = "valley"
skills = ["a.skill.json"]
[vary]
"fixture.tilt_y" = { uniform = [-0.4, 0.4] }
"fixture.offset_x" = { normal = [0.0, 0.01] }
"world.friction" = { choice = [0.1, 0.2] }
"""


def written(folder: Path, text=TEXT) -> CampaignSpec:
    (folder / "robots" / "box").mkdir(parents=True)
    (folder / "robots" / "box" / "robot.toml").write_text('urdf = "box.urdf"\n')
    (folder / "robots" / "box" / "box.urdf").write_text('<robot name="box"><link name="box"/></robot>')
    (folder / "a.skill.json").write_text("{}")
    (folder / "c.toml").write_text(text)
    return CampaignSpec.from_toml(folder / "c.toml", ValleyParams)


def inside(job: ChunkJob):
    """Works in an ellipse of tilt and offset; one in fifty fails for other reasons, by the trial's own number."""
    spec = CampaignSpec.from_plain(job.spec)
    drawn = draws(spec, job.trials)
    x, y = drawn["fixture.tilt_y"] / 0.4, drawn["fixture.offset_x"] / 0.02
    unlucky = np.array([np.random.default_rng([spec.seed, t]).random() < 0.005 for t in job.trials])
    works = (x / 0.8) ** 2 + (y / 0.9) ** 2 < 1.0
    works &= ~unlucky
    count = len(works)
    return rows_of(spec, job.skill, job.trials, {
        "success": works, "failure": np.where(works, "", "stuck"), "duration_s": np.full(count, 2.0),
        "peak_force_n": np.full(count, 9.0), "final_error_m": np.zeros(count), "final_error_rad": np.zeros(count),
    })  # fmt: skip


def failed(row):
    return row | {"success": False, "failure": "stuck"}


ENGINE = Engine(inside, lambda spec: {"fixture": []}, ValleyParams, Options(traces=0))


def asked(tmp_path, **changed):
    spec = replace(written(tmp_path / "in"), **changed)
    out = tmp_path / "out"
    begin(spec, out, ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    return out


def through(out: Path, engine=ENGINE, entropy="e" * 64):
    """As the command does, but for the entropy, which is chosen so that two folders can come out alike."""
    if not procedure.claims(out):
        procedure.look(out, engine)
        question = read_question(out)
        box = procedure.propose(question, looked(out, ValleyParams))
        if box is None:
            return write_certificate(out, None, ValleyParams)
        procedure.write_claim(out, question, box, ValleyParams, entropy)
    procedure.run_fresh(out, procedure.claims(out)[-1], engine)
    return write_certificate(out, outcome(out, ValleyParams), ValleyParams)


def content(folder: Path):
    """All that does not tell of times and machines."""
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("rows.jsonl", "summary.json", "lock")
    }


def test_a_box_is_certified_and_lies_where_the_skill_works(whole):
    out, said = whole, json.loads((whole / "certificate.json").read_text())["predicate"]
    assert said["certified"]
    (tilt, offset) = said["box"]["fixture.tilt_y"], said["box"]["fixture.offset_x"]
    corners = np.array([[t / 0.4, o / 0.02] for t in tilt for o in offset])
    assert np.all(np.sum((corners / [0.8, 0.9]) ** 2, axis=1) < 1.3)  # proposals may hold 1.25 % of failures
    assert said["share_of_declared"] > 0.2
    assert said["declared"]["fixture.offset_x"] == [-0.02, 0.02]  # two standard deviations
    assert load(out / "claim1" / "fresh", ValleyParams).vary["world.friction"].kind == "choice"
    assert check_certificate(out, ValleyParams) == []


@pytest.mark.slow
def test_a_certificate_whose_files_are_gone_or_changed_does_not_hold(certified):
    out = certified
    named = [each["name"] for each in json.loads((out / "certificate.json").read_text())["subject"]]
    assert {"look/results.csv", "claim1/claim.json", "claim1/fresh/results.csv", "question.json"} <= set(named)
    for name in named:
        kept = (out / name).read_bytes()
        (out / name).write_bytes(kept + b"\n")
        assert check_certificate(out, ValleyParams) == [f"{name} was changed"]
        (out / name).unlink()
        assert check_certificate(out, ValleyParams) == [f"{name} is gone"]
        (out / name).write_bytes(kept)
    path = out / "certificate.json"
    path.write_text(path.read_text().replace('"failures": ', '"failures": 1', 1))
    assert check_certificate(out, ValleyParams) == ["the figures do not follow from the trials: tested"]


@pytest.mark.parametrize("edited", ["boxes", "seed", "trials"])
def test_only_fresh_draws_as_the_claim_announced_them_carry_it(certified, edited):
    out = certified
    claim = json.loads((out / "claim1" / "claim.json").read_text())
    if edited == "boxes":
        claim["boxes"] = [{name: [2.0 * a, 2.0 * b] for name, (a, b) in each.items()} for each in claim["boxes"]]
    else:
        claim[edited] += 1
    (out / "claim1" / "claim.json").write_text(json.dumps(claim))
    with pytest.raises(InputError, match="was changed after it was written: its seed does not follow"):
        outcome(out, ValleyParams)
    assert check_certificate(out, ValleyParams) == ["claim1/claim.json was changed"]


def test_a_smaller_box_is_not_changed_after_its_trials(certified):
    out = certified
    claim = json.loads((out / "claim1" / "claim.json").read_text())
    claim["boxes"][0] = claim["boxes"][1]
    (out / "claim1" / "claim.json").write_text(json.dumps(claim))
    with pytest.raises(InputError, match="was changed after it was written"):
        outcome(out, ValleyParams)
    claim["seed"] = seed_of(claim)  # by somebody who means it
    (out / "claim1" / "claim.json").write_text(json.dumps(claim))
    with pytest.raises(InputError, match="boxes that do not lie in each other as a claim's do"):
        outcome(out, ValleyParams)


@pytest.mark.parametrize(
    ("file", "before", "after", "said"),
    [
        ("claim1/claim.json", '"rate": 0.95', '"rate": 0.9', "was changed after it was written"),
        ("claim1/claim.json", '"alpha": 0.05', '"alpha": 0.15', "was changed after it was written"),
        ("question.json", '"rate": 0.95', '"rate": 0.99', "has another rate or confidence than claim1"),
        ("question.json", '"confidence": 0.95', '"confidence": 0.999', "has another rate or confidence"),
    ],
)
def test_a_claim_is_not_changed_after_its_trials(certified, file, before, after, said):
    out = certified
    text = (out / file).read_text()
    assert text.count(before) == 1
    (out / file).write_text(text.replace(before, after))
    with pytest.raises(InputError, match=said):
        outcome(out, ValleyParams)


@pytest.mark.slow
def test_a_folder_that_was_interrupted_at_any_chunk_ends_as_one_that_was_not(tmp_path):
    whole = tmp_path / "whole"
    whole.mkdir()
    through(asked(whole))
    out = asked(tmp_path)
    left = [0]

    def dies(job):
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return inside(job)

    engine = ENGINE._replace(evaluate=dies, options=Options(traces=0, chunk=32))
    for _ in range(40):
        left[0] = 2
        try:
            through(out, engine)
            break
        except KeyboardInterrupt:
            continue
    assert content(out) == content(whole / "out")


@pytest.mark.slow
def test_a_claim_that_fails_is_not_certified_and_the_next_one_costs(tmp_path):
    """The look is kind (a seed of luck), the fresh trials are not: one in ten fails wherever it is."""

    def unkind(job):
        rows = inside(job)
        fresh = CampaignSpec.from_plain(job.spec).vary["fixture.tilt_y"].kind == "uniform"
        return [failed(row) if fresh and row["trial"] % 10 == 0 else row for row in rows]

    out = asked(tmp_path)
    engine = ENGINE._replace(evaluate=unkind)
    said = through(out, engine)["predicate"]
    assert not said["certified"]
    assert [each["passed"] for each in said["tested"]] == [False]
    box = procedure.propose(read_question(out), looked(out, ValleyParams))
    again = procedure.read_claim(procedure.write_claim(out, read_question(out), box, ValleyParams))
    assert (again["number"], again["alpha"]) == (2, pytest.approx(0.025))
    assert again["alpha_spent"] == pytest.approx(0.075)
    assert again["trials"] > 259
    assert again["seed"] != procedure.read_claim(out / "claim1")["seed"]


def test_nothing_to_certify_is_said(tmp_path):
    never = ENGINE._replace(evaluate=lambda job: [failed(row) for row in inside(job)])
    said = through(asked(tmp_path), never)["predicate"]
    assert not said["certified"]
    assert said["looked_at"] == {"trials": 128, "successes": 0, "refused": 0, "border_rounds": 0}
    assert check_certificate(tmp_path / "out", ValleyParams) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('"start.tilt_x" = { grid = [0.0, 0.1] }', "is a grid axis, which has no fresh samples"),
        ('"start.tilt_x" = { values = [0.0] }', "is a values axis, which has no fresh samples"),
        ("\n".join(f'"start.offset_{a}" = {{ uniform = [0.0, 0.01] }}' for a in "xyz"), "declares 5 ranges"),
        ('"start.tilt_x" = { normal = [0.0, 0.0] }', "has no width"),
    ],
)
def test_axes_from_which_no_box_can_be_made_are_refused(tmp_path, change, said):
    text = TEXT.replace("trials = 1", "trials = 2" if "grid" in change else "trials = 1") + change + "\n"
    with pytest.raises(InputError, match=said):
        begin(written(tmp_path, text), tmp_path / "out", ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    assert not (tmp_path / "out").exists()


def test_a_rate_or_folder_that_cannot_be_is_refused(tmp_path):
    spec = written(tmp_path / "in")
    for rate, confidence in ((1.0, 0.95), (0.2, 0.95), (0.95, 1.0), (float("nan"), 0.95)):
        with pytest.raises(InputError, match=r"give a number from 0\.5"):
            begin(spec, tmp_path / "out", ENGINE.describe, ValleyParams, rate=rate, confidence=confidence)
    with pytest.raises(InputError, match="is not an empty folder"):
        begin(spec, tmp_path / "in", ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    with pytest.raises(InputError, match="holds no question"):
        read_question(tmp_path / "in")
