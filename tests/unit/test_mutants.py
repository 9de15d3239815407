"""The list of `make mutants` still fits the code, and its runner tells caught from survived from broken."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.mutants import run
from tests.mutants.run import MARK, Mutant, Outcome, WrongList, mutants, problems, table, written

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "evidence" / "mutants.md"
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


def test_every_change_has_its_row_on_the_page_and_none_is_said_to_have_survived():
    rows = [line for line in PAGE.read_text(encoding="utf-8").partition(MARK)[2].splitlines() if line.startswith("| `")]
    assert [row.split(" | ")[1].removesuffix(" (s)") for row in rows] == [m.what for m in LISTED]
    assert sum("**nothing**" in row for row in rows) <= 0.05 * len(rows)


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


def test_the_table_is_written_below_the_mark_and_the_rest_stays(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n\n{MARK}\n\nan earlier table", encoding="utf-8")
    written(page, table(LISTED, FOUND))
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"before\n\n{MARK}\n") and "an earlier table" not in text and "**nothing**" in text
    page.write_text("nothing", encoding="utf-8")
    with pytest.raises(WrongList, match="holds no line"):
        written(page, "")
