"""The kit compiles and runs a world, and names the defects that an author can plant without noticing."""

import pytest
from skillframe_testkit.checks import check_world

from plugins.testkit.tests.planted_worlds import PLANTED, world
from skillframe.extend.registry import load_registry

pytestmark = pytest.mark.slow  # each runs a check of seconds


@pytest.mark.parametrize("what", PLANTED)
def test_a_world_with_a_defect_is_named_for_it(what, capsys):
    record, said = PLANTED[what]
    problems = check_world(record)
    assert any(said in problem for problem in problems), problems
    assert capsys.readouterr() == ("", "")


def test_a_world_without_a_defect_has_no_finding():
    assert check_world(world()) == []


@pytest.mark.parametrize("name", load_registry().names("world"))
def test_no_world_that_ships_has_a_finding(name):
    assert check_world(load_registry().world(name)) == []
