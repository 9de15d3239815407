"""`demonstration record --teacher blind`: what cannot be searched is refused in one sentence."""

import pytest
from click.testing import CliRunner

from skillframe.cli.record import command
from skillframe.errors import InputError


def run(*arguments):
    return CliRunner().invoke(command, ["--teacher", "blind", "--out", "never.npz", *arguments])


@pytest.mark.parametrize("text", ["4,4", "a,b,c", "4,4,nan", ""])
def test_a_belief_that_is_not_three_numbers_is_refused(text):
    result = run("--world", "peg_in_hole", "--belief", text)
    assert isinstance(result.exception, InputError)
    assert "--belief" in str(result.exception) and "\n" not in str(result.exception)


def test_a_world_without_a_surface_is_refused():
    result = run("--world", "free")
    assert isinstance(result.exception, InputError)
    assert "no surface" in str(result.exception)
