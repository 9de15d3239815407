"""`demonstration record --teacher blind`: what cannot be searched or would be ignored is refused in one sentence."""

import pytest
from click.testing import CliRunner

from skillframe.cli.record import command
from skillframe.errors import InputError


def run(*arguments):
    return CliRunner().invoke(command, ["--teacher", "blind", "--robot", "free_tool", "--out", "never.npz", *arguments])


@pytest.mark.parametrize("text", ["4,4", "a,b,c", "4,4,nan", ""])
def test_a_belief_that_is_not_three_numbers_is_refused(text):
    result = run("--world", "peg_in_hole", "--belief", text)
    assert isinstance(result.exception, InputError)
    assert "--belief" in str(result.exception) and "\n" not in str(result.exception)


def test_a_world_without_a_surface_is_refused():
    result = run("--world", "free")
    assert isinstance(result.exception, InputError)
    assert "no surface" in str(result.exception)


@pytest.mark.parametrize("option", ["--noise", "--delay", "--scale"])
def test_what_a_blind_teacher_would_not_heed_is_refused(option):
    result = run("--world", "peg_in_hole", option, "0.1")
    assert isinstance(result.exception, InputError)
    assert f"{option}: is for teachers who see" in str(result.exception)


@pytest.mark.parametrize("option", ["--belief", "--centre"])
def test_what_a_teacher_who_sees_would_not_heed_is_refused(option):
    result = run("--world", "peg_in_hole", "--teacher", "kinesthetic", option, "1,1,0")
    assert isinstance(result.exception, InputError)
    assert f"{option}: is for --teacher blind" in str(result.exception)
