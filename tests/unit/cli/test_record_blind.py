"""`record --teacher blind`: what cannot be searched or would be ignored is refused in one sentence."""

import pytest
from click.testing import CliRunner

from skillframe.cli.record import command
from skillframe.errors import InputError

pytestmark = pytest.mark.needs_plugins


def run(*arguments):
    return CliRunner().invoke(command, ["--teacher", "blind", "--robot", "free_tool", "--out", "never.npz", *arguments])


@pytest.mark.parametrize("text", ["[4,4]", "[a,b,c]", "[4,4,nan]", ""])
def test_a_belief_that_is_not_three_numbers_is_refused(text):
    result = run("--world", "peg_in_hole", "--set", f"teacher.believed={text}")
    assert isinstance(result.exception, InputError)
    assert "teacher.believed" in str(result.exception) and "\n" not in str(result.exception)


def test_a_world_without_a_surface_is_refused():
    result = run("--world", "free")
    assert isinstance(result.exception, InputError)
    assert "no surface" in str(result.exception)


@pytest.mark.parametrize("setting", ["aim_noise", "delay_s", "scale", "kind"])
def test_what_a_blind_teacher_would_not_heed_is_refused(setting):
    result = run("--world", "peg_in_hole", "--set", f"teacher.{setting}=0.1")
    assert isinstance(result.exception, InputError)
    assert f"unknown key '{setting}'" in str(result.exception) or "name the teacher instead" in str(result.exception)


@pytest.mark.parametrize("setting", ["believed", "centre"])
def test_what_a_teacher_who_sees_would_not_heed_is_refused(setting):
    result = run("--world", "peg_in_hole", "--teacher", "kinesthetic", "--set", f"teacher.{setting}=[0.001,0.001,0]")
    assert isinstance(result.exception, InputError)
    assert f"unknown key '{setting}'" in str(result.exception)
