"""The list of `make mutants` still fits the code, and its runner tells caught from survived from broken."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.mutants import run
from tests.mutants.run import Mutant, Outcome, WrongList, caught_by, mutants, problems, record

ROOT = Path(__file__).resolve().parents[2]
LISTED = mutants()
FOUND = [Outcome(what=m.what, caught=i > 0, by=m.tests[0] * (i > 0), seconds=1.0) for i, m in enumerate(LISTED)]


def test_every_change_still_applies_once_and_names_tests_that_are_there():
    assert not list(problems(LISTED))
    assert len(LISTED) >= 60


def test_the_changes_that_a_review_found_to_survive_are_among_them():
    assert sum(m.survived for m in LISTED) >= 16


def test_no_named_test_is_slow_or_repeats_figures_by_itself():
    for m in LISTED:
        for test in m.tests:
            text = (ROOT / test.partition("::")[0]).read_text(encoding="utf-8")
            head = text.partition(f"def {test.partition('::')[2]}(")[0].rpartition("\n\n\n")[2]
            assert "mark.slow" not in head and "mark.figures" not in head, test


def test_every_change_has_a_result_and_at_most_one_in_twenty_survived():
    found = caught_by()
    untried = [m.what for m in LISTED if m.what not in found]
    assert not untried, f"python -m tests.mutants.run --only {untried[0]!r} --results tests/mutants/caught.csv"
    assert list(found) == [m.what for m in LISTED]
    assert sum(by == "" for by in found.values()) <= 0.05 * len(found)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"before": "there is no such text"}, "stands 0 times"), ({"before": "import"}, "times in"),
        ({"file": "skillframe/nothing.py"}, "there is no skillframe/nothing.py"),
        ({"tests": ("tests/unit/test_frames.py::test_nothing",)}, "there is no test"),
        ({"after": LISTED[0].before}, "changes nothing"), ({"what": LISTED[1].what}, "stands twice"),
    ],
)  # fmt: skip
def test_a_wrong_list_is_told_in_a_sentence(change, said):
    assert any(said in problem for problem in problems([replace(LISTED[0], **change), *LISTED[1:]]))


@pytest.mark.parametrize(("code", "caught"), [(0, False), (1, True)])
def test_a_change_is_made_tried_and_taken_back(tmp_path, monkeypatch, code, caught):
    mutant = Mutant(what="x", file="a.py", before="1", after="2", tests=("t.py",))
    (tmp_path / "a.py").write_text("x = 1\n", encoding="utf-8")
    seen = []

    def ran(root, tests):
        seen.append((root / "a.py").read_text(encoding="utf-8"))
        return code, "FAILED t.py::test_that - assert\n" * code

    monkeypatch.setattr(run, "ran", ran)
    outcome = run.judged(tmp_path, mutant)
    assert (outcome.caught, outcome.by) == (caught, "t.py::test_that" * caught)
    assert seen == ["x = 2\n"] and (tmp_path / "a.py").read_text(encoding="utf-8") == "x = 1\n"


def test_tests_that_were_not_run_or_did_not_end_are_no_catch(tmp_path, monkeypatch):
    (tmp_path / "a.py").write_text("x = 1\n", encoding="utf-8")
    mutant = Mutant(what="x", file="a.py", before="1", after="2", tests=("t.py",))
    monkeypatch.setattr(run, "ran", lambda root, tests: (run.LATE, "not done within 1 s"))
    late = run.judged(tmp_path, mutant)
    assert (late.caught, late.by) == (False, "not done within 1 s")
    monkeypatch.setattr(run, "ran", lambda root, tests: (5, "no tests ran"))
    with pytest.raises(WrongList, match="pytest ended with 5"):
        run.judged(tmp_path, mutant)


def test_the_exit_code_says_whether_19_of_20_are_caught(monkeypatch, capsys):
    monkeypatch.setattr(run, "state_of_tree", lambda: "as it is")
    for missed, code in ((0, 0), (len(FOUND) // 20, 0), (len(FOUND) // 20 + 1, 1)):
        outcomes = [replace(o, caught=i >= missed) for i, o in enumerate(FOUND)]
        monkeypatch.setattr(run, "all_judged", lambda *_, found=outcomes: found)
        assert run.main([]) == code
        caught = len(LISTED) - missed
        assert f"{len(LISTED)} single changes: {caught} caught, {missed} survived" in capsys.readouterr().out


def test_results_take_the_place_of_older_ones_and_those_of_changes_that_are_gone_go(tmp_path):
    path = tmp_path / "caught.csv"
    record(path, LISTED, FOUND)
    assert caught_by(path) == {o.what: o.by for o in FOUND} and FOUND[0].by == ""
    record(path, LISTED[:2], [replace(FOUND[0], caught=True, by="t.py::test_it")])
    assert caught_by(path) == {LISTED[0].what: "t.py::test_it", LISTED[1].what: FOUND[1].by}


def test_the_page_of_the_docs_shows_every_change_with_the_test_that_caught_it(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_extensions"))
    from generated import caught

    rows = [line for line in caught().splitlines() if line.startswith("| `")]
    assert [row.split(" | ")[1].removesuffix(" (s)") for row in rows] == [m.what for m in LISTED]
    assert sum(row.split(" | ")[1].endswith(" (s)") for row in rows) == sum(m.survived for m in LISTED)
    assert f"{len(LISTED)} changes: {sum(by != '' for by in caught_by().values())} caught" in caught()
