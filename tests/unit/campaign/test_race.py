import csv
from itertools import permutations

import numpy as np
import pytest
from campaign_fakes import FakeParams, run, start, table, write_campaign
from skillframe_reports.sources import read_folder

from skillframe.campaign.partial_results import status_of
from skillframe.campaign.race import Race, told
from skillframe.campaign.rows import rows_of
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec, RaceKeys
from skillframe.campaign.statistics import confidence_sequence
from skillframe.campaign.store import read_content
from skillframe.campaign.summary import read_summary
from skillframe.errors import InputError

LABELS = ("good", "middle", "bad")
RACE = "[race]\nevery = 16"


def rows_from(won, labels=LABELS):
    """Rows from a table (trials, skills) of successes."""
    return [{"trial": t, "skill": s, "success": bool(won[t, i])} for t in range(len(won)) for i, s in enumerate(labels)]


def raced(won, labels=LABELS, **keys):
    race = Race(labels, len(won), RaceKeys(**keys))
    race.add(rows_from(won, labels))
    return race


def lucky(seed, trials, rates):
    return np.random.default_rng(seed).random((trials, len(rates))) < rates


def reach(job):
    """Success below a tilt that only the skill sets: all tilts, four of five, one of four."""
    spec = CampaignSpec.from_plain(job.spec)
    success = np.abs(draws(spec, job.trials)["start.tilt_y"]) < (0.21, 0.168, 0.0525)[job.skill]
    zeros = np.zeros(len(success))
    return rows_of(spec, job.skill, job.trials, {
        "success": success, "failure": np.where(success, "", "stuck"), "duration_s": 2.0 + zeros,
        "peak_force_n": zeros, "final_error_m": zeros, "final_error_rad": zeros,
    })  # fmt: skip


@pytest.fixture
def folder_of(tmp_path):
    """Makes folders of one race of three skills."""
    path = write_campaign(tmp_path, trials=400, extra=RACE)
    path.write_text(path.read_text().replace('"replay:demo.npz"', '"replay:demo.npz", "replay:late.npz"'))
    (tmp_path / "late.npz").write_bytes(b"\x00")
    return lambda name: start(path, tmp_path / name)


@pytest.fixture
def race_folder(folder_of):
    return folder_of("out")


def test_a_skill_is_left_out_at_the_first_look_at_which_a_paired_test_of_ones_own_decides():
    won = lucky(3, 400, (0.9, 0.55))
    race = raced(won, ("a", "b"), every=10)
    from scipy.special import beta

    def p_value(n):  # 1 / M_n(1/2), by the beta function itself
        w, lost = int(np.sum(won[:n, 0] & ~won[:n, 1])), int(np.sum(won[:n, 1] & ~won[:n, 0]))
        return min(1.0, 0.5 ** (w + lost) * beta(0.5, 0.5) / beta(w + 0.5, lost + 0.5))

    first = next(n for n in range(10, 400, 10) if p_value(n) <= 0.05)
    assert (race.left["b"].after, race.left["b"].better, race.after) == (first, "a", first - 1)
    assert race.left["b"].p_value == pytest.approx(p_value(first), rel=1e-9)  # the same figure by another formula


def one_sided(trials, better, worse):
    """Successes of which the better skills have so many that the last one has not, and it has none alone."""
    won = np.zeros((20, better + 1), dtype=bool)
    won[:worse, :better] = True
    return np.vstack([won] * (trials // 20))


def test_three_pairs_need_a_third_of_the_level():
    # p = 4^w / C(2w, w) / 2^w where only one of two succeeds in w trials: 0.037 at 7, 0.0105 at 9
    assert raced(one_sided(20, 1, 7), ("a", "b"), every=20).left["b"].p_value == pytest.approx(2.0**7 / 3432)
    assert not raced(one_sided(20, 2, 7), every=20).left
    assert raced(one_sided(20, 2, 9), every=20).left["bad"].p_value == pytest.approx(3 * 2.0**9 / 48620)


def test_the_race_goes_on_without_the_worst_until_the_best_is_left():
    race = raced(lucky(5, 800, (0.9, 0.75, 0.4)), every=8)
    assert list(race.left) == ["bad", "middle"]
    assert race.left["bad"].after < race.left["middle"].after == race.after + 1
    assert race.outcome()["best"] == "good"
    assert race.kept == race.left["bad"].after + 2 * (race.after + 1)


def test_equal_skills_all_run_to_the_end_and_are_not_told_apart():
    won = np.repeat(lucky(1, 200, (0.7,)), 3, axis=1)
    race = raced(won)
    assert (race.left, race.after) == ({}, None)
    assert race.outcome()["not_told_apart"] == list(LABELS)
    assert race.outcome()["more"] is None  # the same outcomes: nobody can say


def test_how_many_trials_more_is_what_brings_the_p_value_to_the_level():
    from scipy.special import beta

    won = np.zeros((20, 2), dtype=bool)
    won[:4, 0] = True  # only the first succeeds, in one of five
    more = next(m for m in range(1000) if 0.5 ** (4 + m / 5) * beta(0.5, 0.5) / beta(4.5 + m / 5, 0.5) <= 0.05)
    assert raced(won, ("a", "b"), every=20).outcome()["more"] == more


def test_the_race_does_not_depend_on_the_order_of_the_rows():
    won = lucky(5, 300, (0.9, 0.75, 0.4))
    expected = raced(won).outcome()
    rng = np.random.default_rng(0)
    for _ in range(5):
        rows = rows_from(won)
        rng.shuffle(rows)
        race = Race(LABELS, len(won), RaceKeys())
        for row in rows:
            race.add([row])
        assert race.outcome() == expected


def test_the_best_is_left_out_in_fewer_than_one_in_twenty_races():
    lost = 0
    for seed in range(60):  # the two better ones are equal, the worst case for a dismissal
        rates = list(permutations((0.8, 0.8, 0.6)))[seed % 6]
        race = raced(lucky(seed, 120, rates), every=4)
        lost += any(rates[LABELS.index(label)] == 0.8 for label in race.left)
    # 60 races at 5 %: more than 8 come with probability 0.5 %; the seeds are 0 to 59
    assert lost <= 8


@pytest.mark.parametrize("chunk", [3, 64])
def test_a_race_ends_in_the_same_table_whatever_the_chunks(race_folder, folder_of, chunk):
    other = folder_of("other")
    run(race_folder, reach, chunk=chunk, traces=0)
    run(other, reach, chunk=7, traces=0)
    assert table(race_folder) == table(other)
    summary = read_summary(race_folder)
    assert summary["complete"]
    assert summary["race"]["best"] == "a.skill.json"
    assert summary["skills"]["replay:late.npz"]["left_out_after"] == 16
    late = sum(label == "replay:late.npz" for _, label in read_content(race_folder).done)
    assert 16 <= late <= 16 + chunk  # nothing of it starts after the look, though the race goes on
    rows = list(csv.DictReader(table(race_folder).decode().splitlines()))
    assert sum(row["skill"] == "replay:late.npz" for row in rows) == 16


def test_an_interrupted_race_goes_on_as_if_nothing_had_happened(race_folder, folder_of):
    other = folder_of("other")
    run(other, reach, traces=0)

    def stop(progress):
        if progress.done >= 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(race_folder, reach, stop, chunk=5, traces=0)
    assert not status_of(race_folder, FakeParams)["complete"]
    with (race_folder / "rows.jsonl").open("ab") as file:
        file.write(b'{"trial": 9')  # what a kill in the middle of a write leaves
    run(race_folder, reach, traces=0)
    assert table(race_folder) == table(other)
    assert status_of(race_folder, FakeParams)["complete"]


def test_a_skill_that_was_left_out_is_marked_wherever_its_rate_is_shown(race_folder):
    summary = run(race_folder, reach, traces=0)
    worse = summary["skills"]["replay:demo.npz"]
    n = worse["left_out_after"]
    assert worse["trials"] == n == summary["race"]["left_out"]["replay:demo.npz"]["after"]
    assert worse["interval_95"] == list(confidence_sequence(worse["successes"], n))
    rows = list(csv.DictReader((race_folder / "results.csv").read_text().splitlines()))
    marks = {("a.skill.json", ""), ("replay:demo.npz", str(n)), ("replay:late.npz", "16")}
    assert {(r["skill"], r["left_out_after"]) for r in rows} == marks
    chapter = read_folder(race_folder)
    assert chapter.results.mark("replay:demo.npz") == f", left out after {n} trials"
    assert chapter.results.interval_name == "95 % confidence interval (valid at every look)"
    assert any("left out after" in text for text in chapter.notes)
    from skillframe_reports.headline import _tile

    assert f"left out after {n} trials" in str(_tile(chapter.results, "replay:demo.npz", 0))


def test_the_page_of_a_race_that_was_killed_has_the_marks_that_its_table_will_have(race_folder):
    run(race_folder, reach, chunk=3, traces=0)
    whole = read_folder(race_folder).results
    (race_folder / "results.csv").unlink()
    (race_folder / "summary.json").unlink()
    killed = read_folder(race_folder).results
    assert killed.left_out == whole.left_out
    assert killed.rate("replay:late.npz") == whole.rate("replay:late.npz")


def test_the_sentence_on_a_skill_that_was_left_out():
    found = {"after": 64, "better": "good", "only_better": 20, "only_it": 2, "p_value": 0.00213}
    assert told("flat", found, 400, "Holm over 3 pairs") == (
        "flat was left out after 64 of 400 trials, because good is better: only it succeeded in 20 of them, only flat "
        "in 2 (p = 0.0021, Holm over 3 pairs)"
    )


WRONG = {
    "[race]\nevery = 0": "race.every: is 0; give the trials between two tests",
    "[race]\nalpha = 0.7": "race.alpha: is 0.7; give a number between 0 and 0.5",
    "[race]\nevry = 3": "did you mean 'every'?",
    "[race]\n[stop]\ninterval_width = 0.1": "would both say when the campaign ends; keep one of the two",
    '"start.tilt_x" = { grid = [0, 1] }\n[race]': "make these axes uniform or sobol, or leave out [race]",
}


@pytest.mark.parametrize("extra", WRONG)
def test_a_race_that_cannot_be_is_refused(tmp_path, extra):
    with pytest.raises(InputError) as error:
        CampaignSpec.from_toml(write_campaign(tmp_path, trials=128, extra=extra), FakeParams)
    assert WRONG[extra] in str(error.value)


def test_a_race_of_one_is_refused_and_a_campaign_without_a_race_keeps_its_hash(tmp_path):
    path = write_campaign(tmp_path, trials=128)
    assert "race" not in CampaignSpec.from_toml(path, FakeParams).plain()
    path.write_text(path.read_text().replace(', "replay:demo.npz"', "") + RACE)
    with pytest.raises(InputError, match="has one skill, which nothing can beat"):
        CampaignSpec.from_toml(path, FakeParams)
