"""Commands of plug-ins: listed, used and refused by what their distributions' metadata say."""

import importlib
import json
import sys
from importlib.metadata import distributions, entry_points
from zipfile import ZipFile

import pytest

from skillframe.cli.main import run
from skillframe.extend import commands, metadata

GOOD = """
import click
print("noise while it is imported")

@click.command(short_help="Greets somebody.")
@click.argument("name")
def command(name):
    click.echo(f"hello {name}")
    return 1
"""


@pytest.fixture
def install(tmp_path, monkeypatch, fresh_registry):
    """Puts a distribution on the path: its name, its module's text, what it calls its commands, and its plug-ins."""
    monkeypatch.delenv("SKILLFRAME_PLUGINS", raising=False)
    monkeypatch.setattr(metadata, "search_path", lambda: [str(tmp_path)])
    monkeypatch.syspath_prepend(str(tmp_path))

    def put(name, text, *names, plugins=(), place="command"):
        module = name.replace("-", "_")
        monkeypatch.delitem(sys.modules, module, raising=False)
        (tmp_path / f"{module}.py").write_text(text)
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = ["[skillframe]", *(f"{plugin} = {module}" for plugin in plugins)] if plugins else []
        lines += ["[skillframe.commands]", *(f"{each} = {module}:{place}" for each in names)]
        (info / "entry_points.txt").write_text("\n".join(lines) + "\n")

    return put


def test_a_command_of_a_plugin_is_listed_with_its_summary_and_used(install, capsys):
    install("toy-hello", GOOD, "hello")
    assert run(["--help"]) == 0
    assert "Commands of plug-ins:\n  hello  Greets somebody." in capsys.readouterr().out
    assert run(["hello", "you"]) == 1  # its own exit code
    assert capsys.readouterr().out == "hello you\n"
    assert run(["hello"]) == 2
    assert capsys.readouterr().err.startswith("error: missing argument 'NAME' (help: skillframe hello --help)")


LAZY = """
from skillframe.extend.commands import LazyCommand
hello = LazyCommand("Greets somebody.", "toy_inner:command")
"""


def test_a_lazy_command_is_listed_without_its_module_and_used_from_it(install, capsys, tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "toy_inner", raising=False)
    install("toy-hello", LAZY, "hello", place="hello")
    (tmp_path / "toy_inner.py").write_text(GOOD)
    assert run(["--help"]) == 0
    assert "\n  hello  Greets somebody." in capsys.readouterr().out and "toy_inner" not in sys.modules
    assert run(["hello", "you"]) == 1 and capsys.readouterr().out == "hello you\n"


def test_a_lazy_command_that_names_no_command_is_refused_with_its_place(install, capsys, tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "toy_inner", raising=False)
    install("toy-hello", LAZY, "hello", place="hello")
    assert run(["hello", "you"]) == 2
    assert "the command hello of toy-hello 1.0 cannot be loaded (ModuleNotFoundError" in capsys.readouterr().err
    (tmp_path / "toy_inner.py").write_text("command = 5")
    importlib.invalidate_caches()
    assert run(["hello", "you"]) == 2
    assert "is 5 at toy_inner:command, which is no click command" in capsys.readouterr().err


def test_what_is_read_here_is_what_the_standard_library_reads():
    for group in ("console_scripts", "skillframe", commands.GROUP):
        points = [point for *_, each in metadata.declaring(group) for point in each]
        ours = {(name, value) for of, name, value in points if of == group}
        assert ours == {(point.name, point.value) for point in entry_points(group=group)}


def test_a_command_in_a_zip_file_is_found_too(install, tmp_path, monkeypatch):
    install("toy-hello", GOOD, "hello")
    with ZipFile(tmp_path / "more.zip", "w") as packed:
        packed.writestr("toy_zip-2.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: toy-zip\nVersion: 2.0\n")
        packed.writestr("toy_zip-2.0.dist-info/entry_points.txt", "[skillframe.commands]\nbye = toy_zip:command\n")
    monkeypatch.setattr(metadata, "search_path", lambda: [str(tmp_path), str(tmp_path / "more.zip")])
    found = commands.plugin_commands()
    assert {name: (each.distributions, each.version) for name, each in found.items()} == {
        "bye": (("toy-zip",), "2.0"), "hello": (("toy-hello",), "1.0"),
    }  # fmt: skip


def test_a_command_that_only_a_finder_of_its_own_knows_is_found_too(install, tmp_path, monkeypatch):
    install("toy-far", GOOD, "far")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "toy_far-1.0.dist-info").rename(tmp_path / "elsewhere" / "toy_far-1.0.dist-info")

    found = list(distributions(path=[str(tmp_path / "elsewhere")]))

    class Finder:
        find_spec = staticmethod(lambda *arguments: None)
        find_distributions = staticmethod(lambda context: iter(found))

    assert not commands.plugin_commands()
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, Finder])
    assert list(commands.plugin_commands()) == ["far"]


def test_a_line_behind_a_hash_declares_nothing(install, tmp_path):
    install("toy-hello", GOOD, "hello", "# old")
    assert list(commands.plugin_commands()) == ["hello"]


def test_the_first_distribution_of_a_name_on_the_path_is_the_one_whose_command_counts(install, tmp_path, monkeypatch):
    install("toy-hello", GOOD, "hello")
    other = tmp_path / "later" / "Toy_Hello-9.0.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: Toy-Hello\nVersion: 9.0\n")
    (other / "entry_points.txt").write_text("[skillframe.commands]\nhello = nothing:command\n")
    monkeypatch.setattr(metadata, "search_path", lambda: [str(tmp_path), str(tmp_path / "later")])
    (found,) = commands.plugin_commands().values()
    assert found.version == "1.0" and found.place == "toy_hello:command"


def test_finding_a_command_imports_nothing_and_what_it_prints_while_loading_is_no_output(install, capsys):
    install("toy-hello", GOOD, "hello")
    (found,) = commands.plugin_commands().values()
    assert "toy_hello" not in sys.modules and (found.name, found.distributions) == ("hello", ("toy-hello",))
    found.load()
    said = capsys.readouterr()
    assert "noise" in said.err and not said.out


@pytest.mark.parametrize(
    ("text", "place", "problem"),
    [("import nothing_of_that_name", "command", "cannot be loaded (ModuleNotFoundError: No module named"),
     ("raise SystemExit(7)", "command", "cannot be loaded (SystemExit: 7)"),
     ("raise KeyboardInterrupt", "command", "cannot be loaded (KeyboardInterrupt: )"),
     ("command = 5", "command", "is 5 at toy_bad:command, which is no click command"),
     (GOOD, "comand", "cannot be loaded (AttributeError")],
)  # fmt: skip
def test_a_command_that_cannot_be_used_is_refused_in_a_sentence_and_takes_no_other_down(
    install, capsys, text, place, problem
):
    install("toy-bad", text, "bad", place=place)
    install("toy-hello", GOOD, "hello")
    assert run(["bad"]) == 2
    assert f"error: the command bad of toy-bad 1.0 {problem}" in capsys.readouterr().err
    assert run(["--help"]) == 0
    listed = capsys.readouterr().out
    assert "hello  Greets somebody." in listed and "bad    the command bad of toy-bad" in listed
    assert run(["hello", "you"]) == 1


def test_a_command_that_two_distributions_bring_is_refused_with_both_names(install, capsys):
    install("toy-one", GOOD, "hello")
    install("toy-two", GOOD, "hello")
    assert run(["hello", "you"]) == 2
    said = capsys.readouterr().err
    assert "toy-one" in said and "toy-two" in said and "uninstall all but one" in said


def test_no_plugin_takes_the_place_of_a_command_of_the_core(install, capsys):
    install("toy-doctor", GOOD, "doctor")
    assert run(["doctor", "you"]) == 2  # the core's takes no argument
    assert "hello" not in capsys.readouterr().out
    assert run(["--help"]) == 0 and capsys.readouterr().out.count("\n  doctor ") == 1


def test_plugins_that_are_left_out_take_their_commands_along(install, capsys, monkeypatch):
    install("toy-hello", GOOD, "hello", plugins=["toy"])
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "other")
    assert run(["hello", "you"]) == 2
    assert capsys.readouterr().err == "error: hello is a command of toy-hello, which SKILLFRAME_PLUGINS leaves out\n"
    assert run(["--help"]) == 0 and "hello" not in capsys.readouterr().out
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "other, toy")
    assert run(["hello", "you"]) == 1


@pytest.mark.parametrize(
    ("words", "home"),
    [(["reproduce", "--quick"], "papers"), (["certify", "run", "peg.toml"], "certify"), (["compare", "x"], "certify")],
)
def test_the_command_of_a_plugin_that_is_not_installed_is_answered_with_what_to_type(install, capsys, words, home):
    assert run(words) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {words[0]} is in skillframe-{home}, which is not installed; type: pip install ")
    assert run(["--help"]) == 0 and f"  {words[0]}" not in capsys.readouterr().out


def test_a_listing_names_the_commands_of_a_plugin_and_a_name_that_the_core_has(install, capsys, monkeypatch):
    install("toy-hello", GOOD, "hello", "run", plugins=["toy"])
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "toy")
    assert run(["plugins", "--json"]) == 0
    (row,) = [row for row in json.loads(capsys.readouterr().out) if row["name"] == "toy"]
    assert row["provides"] == ["command:hello", "command:run"]
    assert row["error"] == "the command run is in skillframe, too"


def test_damaged_metadata_of_another_distribution_is_passed_over(install, tmp_path, capsys):
    install("toy-hello", GOOD, "hello")
    (tmp_path / "worse-1.0.dist-info").mkdir()
    (tmp_path / "worse-1.0.dist-info" / "entry_points.txt").write_text("[skillframe.commands]\n= = =\n")
    assert run(["hello", "you"]) == 1
