"""The kit names the defects that an author can plant without noticing, and has nothing to say of what is sound."""

import pytest
from skillframe_testkit.checks import check_skill

from plugins.testkit.tests.planted_skills import PLANTED, Glide, NeverEnds, Restarting, kind
from skillframe.skill import per_trial

pytestmark = pytest.mark.slow  # each runs a check of seconds


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Some of them write files."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("make", PLANTED, ids=lambda make: make.__name__)
def test_a_skill_with_a_defect_is_named_for_it(make, capsys):
    problems = check_skill(kind(make))
    assert any(PLANTED[make] in problem for problem in problems), problems
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("make", [Glide, Restarting, lambda: per_trial(Glide)], ids=["glide", "restarting", "each"])
def test_a_skill_without_a_defect_has_no_finding(make):
    from skillframe_testkit.checks import skill_warnings

    sound = kind(Glide, build=lambda document: make())
    assert check_skill(sound) == []
    assert skill_warnings(sound) == []


@pytest.mark.parametrize(
    "chatty",
    [
        {"example": lambda: print("an example") or {"phases": [{}]}},
        {"describe": lambda document: print("an example") or ["glides down"]},
        {"explain": lambda document: print("an example") or []},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_prints_outside_of_a_run_is_named_too_and_stays_off_the_terminal(chatty, capsys):
    from skillframe_testkit.checks import skill_warnings

    said = ["prints 'an example', which gets into what a command prints; leave it out"]
    assert check_skill(kind(Glide, **chatty)) == said
    assert skill_warnings(kind(Glide, **chatty)) == []
    assert capsys.readouterr() == ("", "")


def test_a_skill_that_never_ends_is_a_warning_unless_it_says_so():
    from skillframe_testkit.checks import skill_warnings

    assert check_skill(kind(NeverEnds)) == []
    said = "is still under way after 120 s; give it a time limit, or say in a line of `describe` that it never ends"
    assert skill_warnings(kind(NeverEnds)) == [said]
    assert skill_warnings(kind(NeverEnds, describe=lambda document: ["holds, and never ends"])) == []
