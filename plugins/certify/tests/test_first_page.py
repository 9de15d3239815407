"""The certificate's page: verdicts from counts, and what stands on the map."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc
from skillframe_certify.question import Question
from skillframe_certify.report.answers import Asked, read_asked
from skillframe_certify.report.border_map import border_map
from skillframe_certify.report.first_page import certificate_page, stand
from skillframe_reports.page import render
from skillframe_reports.sources import Chapter, read_chapters
from skillframe_reports.theory import regions

from skillframe.extend.registry import registry

RANGES = {"fixture.offset_x": (-0.02, 0.02), "fixture.tilt_y": (-0.4, 0.4), "world.friction": (0.1, 0.5)}
POINTS = 2.0 * qmc.Sobol(3, scramble=True, rng=np.random.default_rng(0)).random(128) - 1.0
BOX = {"fixture.offset_x": [-0.01, 0.01], "fixture.tilt_y": [-0.2, 0.2], "world.friction": [0.1, 0.5]}
CLAIM = {"boxes": [BOX], "alpha_spent": 0.05, "number": 1}
BREAK = {
    "confirmed": True, "point": {"fixture.offset_x": 0.015, "fixture.tilt_y": 0.1, "world.friction": 0.3}, "size": 0.8,
    "nominal": {"fixture.offset_x": 0.0, "fixture.tilt_y": 0.0, "world.friction": 0.2}, "confirmations": [8],
    "fresh_trials": 8, "round": 1, "trials": 200,
}  # fmt: skip


def told(trials, failures, *, certified=False):
    return {"certified": certified, "rate": 0.95, "confidence": 0.95, "share_of_declared": 0.25,
            "box": BOX if certified else None, "failed_trials": list(range(failures)),
            "tested": [{"trials": trials, "failures": failures, "passed": certified}]}  # fmt: skip


def asked(predicate=None, **changes):
    """Works where offset and tilt are small, whatever the friction."""
    works = np.sum(POINTS[:, :2] ** 2, axis=1) < 0.6
    question = Question(rate=0.95, confidence=0.95, ranges=RANGES)
    return replace(
        Asked(folder="out", question=question, evidence="claim1/fresh", predicate=predicate, claim=CLAIM, found={},
              points=POINTS, works=works), **changes,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("predicate", "word"),
    [
        (told(181, 4, certified=True), "pass"),
        (told(181, 9), "undecided"),  # 95.0 % succeed: neither above nor below is shown
        (told(181, 40), "fail"),  # 78 %, at most 84 % with the two-sided interval
        ({"certified": False, "rate": 0.95}, "fail"),
        (None, "undecided"),
    ],
)
def test_a_failed_test_is_a_failed_skill_only_where_its_whole_interval_is_below_the_rate(predicate, word):
    assert stand(asked(predicate)).word == word


@pytest.mark.slow
def test_the_axes_of_the_map_are_the_two_quantities_that_matter_and_the_box_is_where_it_is():
    drawn = border_map(asked(told(181, 0, certified=True), found={"break": BREAK}))
    assert "offset along x [mm]" in drawn and "tilt about y [°]" in drawn
    assert "cut is at friction 0.3" in drawn  # the middle of the certified box
    x, y, width, height = (float(v) for v in re.search(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)" class="box"', drawn).groups())  # fmt: skip
    left, right, top, bottom = 52.0, 448.0, 26.0, 290.0  # of the frame
    assert (x, width) == pytest.approx((left + 0.25 * (right - left), 0.5 * (right - left)), abs=0.2)
    assert (y, height) == pytest.approx((top + 0.25 * (bottom - top), 0.5 * (bottom - top)), abs=0.2)
    assert 'class="break"' in drawn
    assert drawn.count('class="looked') == 128
    assert all(f'class="shade {kind}"' in drawn for kind in ("fails", "unsure", "holds"))


@pytest.mark.slow
def test_a_box_that_was_only_claimed_is_dashed_and_where_all_ended_alike_there_is_no_map():
    assert 'class="box claimed"' in border_map(asked(told(181, 40)))
    assert "All 128 exploratory trials succeeded" in border_map(asked(works=np.ones(128, dtype=bool)))


@pytest.mark.slow
def test_the_page_tells_claim_counts_breaking_point_and_what_it_does_not_say():
    page = certificate_page(Chapter(name="Peg", content=asked(told(181, 9), found={"break": BREAK})))
    for text in (
        "9 of 181 fresh trials failed", "was claimed to succeed in at least 95 %", "0.80 of the half ranges",
        "skillframe campaign replay out/confirm/1 0", "no claim about the safety of people", "Signed:", "undecided",
    ):  # fmt: skip
        assert text in page


def test_a_folder_with_a_question_gives_the_chapter_of_its_evidence(tmp_path):
    question = {"format": "skillframe.question", "version": 1, "rate": 0.95, "confidence": 0.95, "ranges": RANGES}
    (tmp_path / "question.json").write_text(json.dumps(question))
    (tmp_path / "look").mkdir()
    lines = [f"{t},a.skill.json,7,{0.001 * t},{0.0},0.2,{t % 2},," for t in range(4)]
    head = "trial,skill,seed,fixture.offset_x,fixture.tilt_y,world.friction,success,failure,duration_s"
    (tmp_path / "look" / "results.csv").write_text("\n".join([head, *lines]) + "\n")
    (chapter,) = read_chapters([tmp_path])
    assert chapter.kind.name == "claim"
    assert chapter.folder == f"{tmp_path.name}/look"
    found = read_asked(tmp_path)
    assert found.works.tolist() == [False, True, False, True]
    assert found.points[:, 0] == pytest.approx([0.0, 0.05, 0.1, 0.15])
    assert stand(found).word == "undecided"


@pytest.mark.slow
def test_theorys_border_lies_where_it_says_and_even_trials_are_not_said_to_be_picked():
    """0.2 rad of 0.4 to either side: a quarter of the frame from its ends."""
    drawn = border_map(asked(), regions({"analytic": {"largest_tilt_rad": 0.2}}, list(RANGES)))
    lines = re.findall(r'<line x1="([\d.]+)" x2="([\d.]+)" y1="[\d.]+" y2="[\d.]+" class="theory"', drawn)
    across = pytest.approx([52.0 + 99.0, 448.0 - 99.0], abs=0.2)
    assert sorted(float(a) for a, b in lines if a == b) == across
    assert "direction succeeds within |fixture tilt about y| &lt; 11.5 °" in drawn
    assert "spread evenly" in drawn and "picked near" not in drawn
    searched = border_map(asked(found={"border": {"smallest_island": 0.02}}))
    assert "picked near the border" in searched and "theory" not in searched


@pytest.mark.slow
def test_a_report_opens_with_its_certificate_and_names_it_first():
    """Whatever the order in which the folders were given: who asked for a certificate wants to read it."""
    plain, asking = Chapter(name="Valley"), Chapter(name="Valley", content=asked(told(181, 4, certified=True)))
    asking.kind = registry().record("folder", "claim")
    text = render([plain, asking])
    links = text[text.index("<nav") : text.index("</nav>")]
    assert re.findall(r'href="(#[^"]*)">([^<]*)<', links)[0] == ("#certificate", "Certificate")
    assert text.index("<main") < text.index('id="certificate"') < text.index('class="hero"')
    assert 'id="certificate' not in render([plain])
    assert render([asking, plain]) == text
    both = render([asking, plain, asking])
    assert re.findall(r'id="(certificate[^"]*)"', both) == ["certificate", "certificate-2"]
