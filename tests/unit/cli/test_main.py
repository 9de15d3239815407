import os
import subprocess
import sys

import click
import pytest

from skillframe.cli import main
from skillframe.errors import InputError


@pytest.fixture
def command(monkeypatch):
    """Makes `skillframe doctor` do something else for a test."""

    def use(action):
        @click.command()
        @click.option("--number", type=int)
        def doctor(number):
            return action()

        monkeypatch.setattr(main.LazyGroup, "get_command", lambda self, ctx, name: doctor)

    return use


def raises(error):
    def action():
        raise error

    return action


def test_a_command_s_own_number_is_the_exit_code(command):
    command(lambda: 1)
    assert main.run(["doctor"]) == 1


def test_a_command_that_returns_nothing_is_fine(command):
    command(lambda: None)
    assert main.run(["doctor"]) == 0


def test_bad_input_is_one_sentence_and_exit_code_2(command, capsys):
    command(raises(InputError("a.csv", "row 3 holds NaN", "fix it")))
    assert main.run(["doctor"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "error: a.csv: row 3 holds NaN; fix it\n"


def test_a_mistake_of_ours_is_exit_code_3_without_traceback(command, capsys):
    command(raises(ZeroDivisionError("oh")))
    assert main.run(["doctor"]) == 3
    assert "Traceback" not in (text := capsys.readouterr().err)
    assert "internal error: ZeroDivisionError: oh" in text and "--debug" in text


def test_a_file_that_cannot_be_opened_is_bad_input(command, capsys):
    command(lambda: open("/no/such/file"))  # noqa: SIM115 - it does not open
    assert main.run(["doctor"]) == 2
    assert capsys.readouterr().err == "error: /no/such/file: No such file or directory\n"


@pytest.mark.parametrize("error", [ZeroDivisionError("oh"), InputError("a", "b")])
def test_debug_shows_the_traceback(command, error):
    command(raises(error))
    with pytest.raises(type(error)):
        main.run(["doctor"], debug=True)


def test_an_interrupt_is_told_and_leaves_with_the_shell_s_code(command, capsys):
    command(raises(KeyboardInterrupt()))
    assert main.run(["doctor"]) == 130
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["doctor", "--bogus"], ["doctor", "--number", "x"], ["--bogus"]])
def test_wrong_usage_is_exit_code_2(command, arguments, capsys):
    command(lambda: None)
    assert main.run(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.endswith(" --help)\n") and said.count("\n") == 1


def test_an_unknown_command_is_refused_with_the_nearest_one(capsys):
    assert main.run(["plugns"]) == 2
    assert "did you mean 'plugins'?" in capsys.readouterr().err


def test_help_lists_only_commands_that_exist(capsys):
    assert main.run(["--help"]) == 0
    text = capsys.readouterr().out
    for name in main.COMMANDS:
        assert (f"\n  {name} " in text) == (name in main.cli.list_commands(click.Context(main.cli)))


def test_debug_is_understood_anywhere_on_the_line(monkeypatch):
    seen = []
    monkeypatch.setattr(main, "run", lambda arguments, debug: seen.append((arguments, debug)) or 0)
    with pytest.raises(SystemExit):
        main.main(["plugins", "--debug"])
    assert seen == [(["plugins"], True)]


@pytest.mark.parametrize(("given", "threads"), [(None, "1"), ("3", "3")])
def test_a_command_has_one_thread_of_openblas_unless_the_user_sets_more(monkeypatch, given, threads):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", given or "")
    if given is None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setattr(main, "run", lambda arguments, debug: 0)
    with pytest.raises(SystemExit):
        main.main(["plugins"])
    assert os.environ["OPENBLAS_NUM_THREADS"] == threads


@pytest.mark.parametrize("words", [["worlds"], ["--help"], ["run", "--help"], ["--version"]])
@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error(words):
    """As `head` does. What is printed is less than a buffer holds, so that it is written at the end."""
    read, write = os.pipe()
    os.close(read)
    code = f"from skillframe.cli.main import main; main({words!r})"
    done = subprocess.run([sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")
