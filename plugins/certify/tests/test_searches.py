"""Borders, breaking points and ranks: against closed forms, and as a folder that may be killed at any moment."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm, qmc
from search_fakes import content, everything
from skillframe_certify import border, breaking_point, plan, procedure, sensitivity, surrogate
from skillframe_certify.commands.searches import _tell_border, _tell_matter
from skillframe_certify.engine import Looked
from skillframe_certify.plan import PLAN, RoundPlan
from skillframe_certify.question import ask_again, begin, read_question
from skillframe_certify.rounds import looked
from skillframe_certify.searches import check_plan, find_break, map_border, nominal, other_methods, rank
from skillframe_certify.surrogate import Surrogate
from skillframe_worlds.valley import ValleyParams
from test_certify import ENGINE, TEXT, asked, inside, written

from skillframe.errors import InputError

SOBOL = 2.0 * qmc.Sobol(2, scramble=True, rng=np.random.default_rng(3)).random(512) - 1.0
RNG = np.random.default_rng(4)


def answered(search, truth):
    """A search to its end over a truth. Its outcome, and all trials."""
    batches = [next(search)]
    try:
        while True:
            batches.append(search.send(Looked(batches[-1].points, truth(batches[-1].points))))
    except StopIteration as end:
        return end.value, np.concatenate([batch.points for batch in batches])


@pytest.mark.slow
def test_the_border_of_an_ellipse_is_found_and_the_ends_of_the_ranges_that_it_passes():
    """x^2/0.8^2 + y^2/1.3^2 < 1 leaves the range at both ends of y; its area over the range's is from quadrature."""

    def truth(points):
        return np.sum((points / [0.8, 1.3]) ** 2, axis=1) < 1.0

    found, points = answered(
        border.search(Looked(SOBOL[:64], truth(SOBOL[:64])), 64, lambda a, b: SOBOL[a:b], 192), truth
    )
    assert found.edges == ((False, False), (True, True))
    even = RNG.uniform(-1.0, 1.0, (40_000, 2))
    assert found.share == pytest.approx(truth(even).mean(), rel=0.06)
    away = np.abs(np.sqrt(np.sum((points / [0.8, 1.3]) ** 2, axis=1)) - 1.0)
    evenly = np.abs(np.sqrt(np.sum((even / [0.8, 1.3]) ** 2, axis=1)) - 1.0)
    assert np.median(away) < 0.6 * np.median(evenly)  # a quarter of the trials is even, three quarters seek the border
    assert found.explored == 64 + sum(batch_share(found.trials - 64))


@pytest.mark.slow
def test_a_search_does_not_settle_where_what_was_seen_to_work_is_predicted_to_fail(monkeypatch):
    """A surrogate that takes the trials that work for noise, and says that nothing works."""
    monkeypatch.setattr(Surrogate, "above", lambda self, points: np.full(len(points), 1e-6))
    seen = Looked(SOBOL[:64], SOBOL[:64, 0] > 0.9)
    found, _ = answered(border.search(seen, 64, lambda a, b: SOBOL[a:b], 160), lambda p: p[:, 0] > 0.9)
    assert seen.works.any()
    assert (found.settled, found.trials, found.share, found.doubt) == (False, 160, 0.0, 1.0)


def test_a_search_does_not_settle_by_a_surrogate_that_was_not_found_to_its_end(monkeypatch):
    monkeypatch.setattr(surrogate, "MOST_SWEEPS", 8)
    seen = Looked(SOBOL[:64], np.full(64, True))
    found, _ = answered(border.search(seen, 64, lambda a, b: SOBOL[a:b], 160), lambda p: np.full(len(p), True))
    assert (found.settled, found.trials) == (False, 160) and found.doubt < border.CLOSE


@pytest.mark.parametrize("works", [True, False])
@pytest.mark.slow
def test_where_all_trials_end_alike_the_search_settles_at_once(works):
    seen = Looked(SOBOL[:128], np.full(128, works))
    found, _ = answered(border.search(seen, 128, lambda a, b: SOBOL[a:b], 256), lambda p: np.full(len(p), works))
    assert (found.settled, found.trials, found.share) == (True, 128 + 2 * 32, float(works))


def test_doubt_is_the_volume_that_may_be_wrong_over_that_of_the_set():
    """A quarter works for sure, a quarter by 0.9; of the half that fails a tenth may work."""
    sure = np.repeat([1.0, 0.9, 0.1], [25, 25, 50])
    assert border.doubt_of(sure, np.array([True, False])) == pytest.approx(7.5 / 52.5)
    assert border.doubt_of(sure, np.array([False])) == pytest.approx(0.525)
    assert border.doubt_of(np.full(4, 0.4), np.array([True, False])) == 1.0


def batch_share(left):
    """A quarter of each round, rounded up, of batches of an eighth of the budget of 192."""
    sizes = [min(24, left - first) for first in range(0, left, 24)]
    return [-(-size // 4) for size in sizes]


def test_batches_stay_below_an_eighth_of_the_budget():
    assert [border.batch_size(d, border.BUDGET[d]) for d in (1, 2, 3, 4)] == [16, 32, 64, 128]
    assert border.batch_size(3, 192) == 24


def test_trials_to_go_never_pass_the_budget_and_end_with_the_search():
    assert border.to_go(0.5, 0, 64, 32, 416) == 416 - 64
    assert border.to_go(0.01, 2, 200, 32, 416) == 0
    assert border.to_go(0.01, 1, 160, 64, 1024) == 64


def test_the_smallest_disturbance_of_two_planes_is_the_nearer_one():
    """Fails beyond x + y = 0.6 sqrt 2 (distance 0.6 from the middle), and beyond x = -0.9."""

    def truth(points):
        return (points.sum(axis=1) < 0.6 * np.sqrt(2.0)) & (points[:, 0] > -0.9)

    seen = Looked(SOBOL[:32], truth(SOBOL[:32]))
    found, _ = answered(breaking_point.search(seen, np.zeros(2), 200), truth)
    assert found.trials <= 200 + 32  # rays are bisected to their end
    sizes = np.linalg.norm(found.points, axis=1)
    assert 0.6 <= sizes[0] < 0.63  # radii are bisected to 5 %, then shortened by 2 % at least a hit
    assert np.all(np.diff(sizes) >= -1e-12)  # two rays end equally far, and their points are rounded
    assert not truth(found.points).any()


def test_what_fails_undisturbed_needs_no_search():
    found, points = answered(
        breaking_point.search(Looked(SOBOL[:8], SOBOL[:8, 0] > 2.0), np.zeros(2), 200), lambda p: p[:, 0] > 2.0
    )
    assert (found.trials, found.undisturbed, len(points)) == (8, 8, 8)


def test_where_nothing_fails_there_is_no_breaking_point():
    found, points = answered(
        breaking_point.search(Looked(SOBOL[:8], SOBOL[:8, 0] < 2.0), np.zeros(2), 200), lambda p: p[:, 0] < 2.0
    )
    assert found.points.shape == (0, 2)
    assert len(points) == 8 + 5 * 32  # directions, all but the last few of the 200


def test_indices_of_a_linear_truth_are_the_shares_of_its_variance():
    class Linear:
        def success(self, points):
            return points @ np.array([0.4, 0.2, 0.0])

    assert sensitivity.indices(Linear(), 3) == pytest.approx([0.8, 0.2, 0.0], abs=0.01)  # 4096 even points


def test_two_quantities_that_act_only_together_both_matter():
    points = SOBOL[:128]
    found = sensitivity.indices(Surrogate(points, points[:, 0] * points[:, 1] > 0.0), 2)
    assert np.all(found > 0.7)


def test_the_change_over_pairs_has_the_interval_of_agresti_and_min():
    """30 of 100 pairs gain, 10 lose: (30 - 10) / 102 with the variance of their counts, one half added to each cell."""
    low, high = sensitivity.paired_change(30, 10, 100)
    won, lost, n = 30.5, 10.5, 102.0
    half = norm.ppf(0.975) * np.sqrt(won + lost - (won - lost) ** 2 / n) / n
    assert (low, high) == pytest.approx((20.0 / n - half, 20.0 / n + half))


def test_a_quantity_without_effect_is_not_tested_and_the_others_on_the_same_trials():
    def truth(points):
        return points[:, 0] < 0.2

    search = sensitivity.search({"a": 0.9, "b": 0.01}, ["a", "b"], np.array([0.0, 0.0]), 5)
    (held,), points = answered(search, truth)
    assert points[:128, 1] == pytest.approx(points[128:, 1])
    assert np.all(points[128:, 0] == 0.0)
    assert (held.name, held.after, held.only_before) == ("a", 128, 0)
    assert held.only_after == 128 - held.before
    with pytest.raises(StopIteration):
        next(sensitivity.search({"a": 0.0, "b": 0.0}, ["a", "b"], np.zeros(2), 5))


class TestPlan:
    def planned(self, folder):
        plan = RoundPlan(folder, ["a", "b"])
        plan.append("border", np.array([[0.1, 0.2], [0.3, 0.4]]), 1, "x")
        plan.append("break", np.array([[0.5, 0.6]]), 0, "y")
        return plan

    def test_what_was_planned_is_read_back_to_the_last_bit_and_a_torn_line_is_not_there(self, tmp_path):
        head = self.planned(tmp_path).head
        with (tmp_path / PLAN).open("ab") as file:
            file.write(b'{"stream": "bor')
        again = RoundPlan(tmp_path, ["a", "b"])
        assert again.head == head
        assert [(e.stream, e.round, e.points.tolist()) for e in again.entries] == [
            ("border", 1, [[0.1, 0.2], [0.3, 0.4]]), ("break", 1, [[0.5, 0.6]]),
        ]  # fmt: skip
        again.append("border", np.zeros((1, 2)), 0, "z")
        assert [e.round for e in RoundPlan(tmp_path, ["a", "b"]).of("border")] == [1, 2]

    @pytest.mark.parametrize("edit", [lambda t: t.replace("0.1", "0.11", 1), lambda t: t.split("\n", 1)[1]])
    def test_a_plan_that_was_edited_is_refused(self, tmp_path, edit):
        self.planned(tmp_path)
        (tmp_path / PLAN).write_text(edit((tmp_path / PLAN).read_text()))
        with pytest.raises(InputError, match=r"the plan was changed|is damaged"):
            RoundPlan(tmp_path, ["a", "b"])


def quiet(text):
    """Nothing to say."""


def test_a_nominal_value_outside_its_range_is_refused_in_words(tmp_path):
    text = TEXT.replace("[-0.4, 0.4]", "[0.1, 0.4]")
    spec, out = written(tmp_path / "in", text), tmp_path / "out"
    begin(spec, out, ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    assert nominal(out, read_question(out))["fixture.tilt_y"] == 0.0
    with pytest.raises(InputError, match=r"vary\.fixture.tilt_y: does not contain its nominal value"):
        find_break(out, ENGINE, quiet)


@pytest.mark.slow
def test_a_breaking_point_that_another_version_began_to_look_for_is_not_gone_on_with(tmp_path, monkeypatch):
    out = asked(tmp_path)
    procedure.look(out, ENGINE)
    with monkeypatch.context() as otherwise:
        otherwise.setattr(breaking_point, "POOL", 6)
        otherwise.setattr(plan, "METHOD", 2)
        before = find_break(out, ENGINE, quiet)
    with pytest.raises(InputError, match="begun by another version of skillframe"):
        find_break(out, ENGINE, quiet)
    with monkeypatch.context() as same:  # what follows from the trials all the same is gone on with
        same.setattr(breaking_point, "POOL", 6)
        assert find_break(out, ENGINE, quiet) == before


@pytest.mark.slow
def test_claims_are_neither_older_than_their_trials_nor_without_end(tmp_path):
    out = asked(tmp_path)
    procedure.look(out, ENGINE)
    question = read_question(out)
    box = procedure.propose(question, looked(out, ValleyParams))
    (out / "claim1" / "fresh").mkdir(parents=True)
    with pytest.raises(InputError, match="holds trials that are older than their claim"):
        procedure.write_claim(out, question, box, ValleyParams)
    (out / "claim1" / "fresh").rmdir()
    for _ in range(procedure.MOST_CLAIMS):
        procedure.write_claim(out, question, box, ValleyParams)
    with pytest.raises(InputError, match="has spent its level on 4 claims"):
        procedure.write_claim(out, question, box, ValleyParams)


def test_another_rate_may_be_asked_of_the_same_trials(tmp_path):
    out = asked(tmp_path)
    ask_again(out, 0.9, 0.99)
    assert (read_question(out).rate, read_question(out).confidence) == (0.9, 0.99)
    with pytest.raises(InputError, match="--rate: is 2"):
        ask_again(out, 2.0, 0.95)


@pytest.mark.slow
def test_the_four_commands_in_one_folder_agree_with_the_truth_and_with_the_plan(tmp_path, monkeypatch):
    """Works in (tilt / 0.32)^2 + (offset / 0.018)^2 < 1, in half ranges 0.8 and 0.9."""
    out = asked(tmp_path)
    procedure.look(out, ENGINE)
    everything(out)
    found = {name: json.loads((out / f"{name}.json").read_text()) for name in ("border", "breaking", "matter")}
    assert found["border"]["share_that_works"] == pytest.approx(np.pi * 0.8 * 0.9 / 4.0, rel=0.06)
    assert found["breaking"]["size"] == pytest.approx(0.8, rel=0.05)
    assert found["breaking"]["confirmed"]
    assert {each["name"] for each in found["matter"]["held"]} == {"fixture.tilt_y", "fixture.offset_x"}
    assert all(each["change"][0] > 0.0 for each in found["matter"]["held"])
    predicate = json.loads((out / "certificate.json").read_text())["predicate"]
    assert predicate["certified"]
    assert predicate["looked_at"]["border_rounds"] > 1
    assert predicate["break"] == found["breaking"]
    assert check_plan(out, ValleyParams) == []
    assert other_methods(out) is None
    with monkeypatch.context() as otherwise:  # a version that picks otherwise
        otherwise.setattr(border, "CANDIDATES", 1024)
        assert any("is not what follows" in text for text in check_plan(out, ValleyParams))
        otherwise.setattr("skillframe_certify.searches.METHOD", 99)
        assert check_plan(out, ValleyParams) == []
        assert "picked by another version of skillframe" in str(other_methods(out))
    (out / "look" / "results.csv").write_bytes((out / "look" / "results.csv").read_bytes() + b"\n")
    assert any("computed from other tables" in text for text in check_plan(out, ValleyParams))


def killed(folder: Path, *moment: float) -> int:
    command = [sys.executable, str(Path(__file__).with_name("search_fakes.py")), str(folder), *map(str, moment)]
    return subprocess.run(command, capture_output=True, check=False).returncode


def killed_at(tmp_path, moments, text=TEXT):
    """Folders of the same question: one undisturbed, and those whose processes were killed at each moment in turn.

    Each goes on until it is done; the moments that are left then come in a folder of its own.
    """
    folders, left = [begun(tmp_path / "whole", text)], list(moments)
    assert killed(folders[0], np.inf) == 0
    while left:
        folders.append(begun(tmp_path / f"killed{len(folders)}", text))
        assert killed(folders[-1], *left.pop(0)) == -9  # a moment that a whole run never comes to is none
        while left and killed(folders[-1], *left[0]) == -9:
            del left[0]
        assert killed(folders[-1], np.inf) == 0
    return folders


def begun(folder, text):
    begin(written(folder / "in", text), folder / "out", ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    return folder / "out"


@pytest.mark.slow
def test_a_folder_whose_process_was_killed_while_it_wrote_ends_as_one_that_was_not(tmp_path):
    """Killed in its 60th, then in its 9th write, in one range, which is searched in a second."""
    text = TEXT.replace("{ normal = [0.0, 0.01] }", "{ choice = [0.0, 0.002] }")
    whole, stopped = killed_at(tmp_path, [(np.inf, 60), (np.inf, 9)], text)
    assert content(stopped) == content(whole)


@pytest.mark.slow
def test_a_folder_ends_alike_on_two_threads_of_blas_and_after_a_kill_with_other_workers(tmp_path, monkeypatch):
    """Whole on one thread of BLAS without workers; killed in its 12th write with two workers, then on two threads."""
    text = TEXT.replace("{ normal = [0.0, 0.01] }", "{ choice = [0.0, 0.002] }")
    for name in ("whole", "other"):
        begun(tmp_path / name, text)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    assert killed(tmp_path / "whole" / "out", np.inf) == 0
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert killed(tmp_path / "other" / "out", np.inf, 12, 2) == -9
    assert killed(tmp_path / "other" / "out", np.inf) == 0
    assert (tmp_path / "whole" / "out" / PLAN).read_bytes() == (tmp_path / "other" / "out" / PLAN).read_bytes()
    assert content(tmp_path / "other" / "out") == content(tmp_path / "whole" / "out")


@pytest.mark.figures
def test_twenty_kills_at_random_moments_leave_the_folder_as_it_would_be(tmp_path):
    """Ten in a random write, ten at a random time: seed 2026_11_23."""
    rng = np.random.default_rng(2026_11_23)
    moments = [(np.inf, int(rng.integers(1, 80))) if i % 2 else (rng.uniform(1.5, 5.0),) for i in range(20)]
    whole, *stopped = killed_at(tmp_path, moments)
    print(f"20 processes killed before their end, in {len(stopped)} folders")
    assert all(content(each) == content(whole) for each in stopped)


def all_end(works):
    """Whatever is drawn, trials end alike."""
    failure = "" if works else "stuck"
    return ENGINE._replace(evaluate=lambda job: [row | {"success": works, "failure": failure} for row in inside(job)])


@pytest.mark.parametrize(
    ("works", "said"), [(True, "all 128 trials succeed; widen"), (False, "all 128 trials fail; narrow")]
)
def test_where_all_trials_end_alike_there_is_nothing_to_rank_and_no_border(tmp_path, capsys, works, said):
    out = asked(tmp_path)
    alike = all_end(works)
    procedure.look(out, alike)
    found = rank(out, alike, quiet)
    assert (set(found["index"].values()), found["held"]) == ({0.0}, [])
    assert not (out / PLAN).exists()
    _tell_matter(out, found)
    border = {
        "trials": 128,
        "successes": 128 * works,
        "doubt": 0.0,
        "settled": True,
        "share_that_works": float(works),
    }
    _tell_border(out, {**border, "reaches": {}, "index": found["index"], "smallest_island": 0.1, "explored": 128})
    told = capsys.readouterr().out
    assert f"nothing to rank: {said}" in told and f"none was met: {said}" in told
    assert "no effect" not in told and "0.0" not in told.splitlines()[0]


@pytest.mark.parametrize("search", [rank, map_border, find_break])
def test_where_every_start_is_inside_something_no_search_says_that_all_trials_end_alike(tmp_path, search):
    none = {"success": False, "failure": "begins inside something: x", "ended_by": "start"}
    inside_all = ENGINE._replace(evaluate=lambda job: [row | none for row in inside(job)])
    out = asked(tmp_path)
    procedure.look(out, inside_all)
    with pytest.raises(InputError, match="all 128 explored starts are inside something; narrow the ranges"):
        search(out, inside_all, quiet)


def test_a_quantity_that_does_nothing_is_named(tmp_path, capsys):
    index = {"fixture.tilt_y": 0.9, "fixture.offset_x": 0.01}
    _tell_matter(tmp_path, {"looked_at": {"trials": 128, "successes": 60}, "index": index, "held": []})
    found = {"trials": 160, "successes": 80, "doubt": 0.02, "settled": True, "share_that_works": 0.5, "index": index}
    reaches = {"fixture.tilt_y": (False, True), "fixture.offset_x": (True, True)}
    _tell_border(tmp_path, {**found, "reaches": reaches, "smallest_island": 0.02})
    told = capsys.readouterr().out
    assert "fixture.offset_x         0.0  does nothing that shows" in told
    assert "no effect   of fixture.offset_x shows" in told
    assert "reaches     the high end of fixture.tilt_y: widen it to see the border there" in told


def test_a_plan_whose_rounds_do_not_follow_is_said_where_no_search_would_have_begun(tmp_path):
    out = asked(tmp_path)
    alike = all_end(works=True)
    procedure.look(out, alike)
    RoundPlan(out, list(read_question(out).ranges)).append("matter", np.zeros((1, 2)), 0, "x")
    assert check_plan(out, ValleyParams) == [
        f"{PLAN}: rounds of matter do not follow from the trials before them, from which none does"
    ]
