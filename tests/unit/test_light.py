"""What stays light: importing, help, listing and completion load no scientific library, since hooks yield factories."""

import dataclasses
import inspect
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from skillframe.extend import ExporterType, Lazy
from skillframe.extend.homes import homes
from skillframe.extend.registry import KINDS, registry

PLUGINS = sorted(p for p in (Path(__file__).resolve().parents[2] / "plugins").iterdir() if (p / "src").is_dir())
HOOKED = [
    p for p in PLUGINS if "[project.entry-points.skillframe]" in (p / "pyproject.toml").read_text(encoding="utf-8")
]
ALL_PLUGINS = ",".join(plugin.name for plugin in HOOKED)
HEAVY = {"scipy", "casadi", "fmpy", "filterpy", "mujoco", "matplotlib", "pinocchio"}


def loaded_by(code, plugins="", **variables):
    """Modules at top level that a fresh interpreter has loaded after some code, with no plug-in but those named."""
    code += "\nimport sys; print(' '.join({m.partition('.')[0] for m in sys.modules}))"
    environment = {**os.environ, "SKILLFRAME_PLUGINS": plugins, "SKILLFRAME_STRICT_PLUGINS": "1", **variables}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    return set(run.stdout.splitlines()[-1].split())


def test_importing_skillframe_loads_no_scientific_library():
    assert not loaded_by("import skillframe") & (HEAVY | {"numpy", "pluggy", "click"})


def test_help_loads_no_scientific_library():
    assert not loaded_by("from skillframe.cli.main import run; assert run(['--help']) == 0") & HEAVY


@pytest.mark.needs_plugins
def test_help_names_the_commands_of_plugins_and_loads_no_parser_of_metadata():
    code = "from skillframe.cli.main import run; assert run(['--help']) == 0"
    loaded = loaded_by(code + "\nimport sys; assert 'skillframe_papers' in sys.modules", "papers")
    # what `skillframe --help` took twice its processor time for
    assert not loaded & {"email", "csv", "zipfile", "tomllib", "json", "dataclasses", "pluggy", "difflib"}


@pytest.mark.slow
def test_an_entry_module_of_a_plugin_loads_nothing_heavy():
    for plugin in PLUGINS:
        package = next((plugin / "src").iterdir()).name.removesuffix(".py")
        code = f"from importlib import import_module as i\ntry: i({package!r})\nexcept ModuleNotFoundError: pass"
        assert not loaded_by(code) & HEAVY, package


CALL_EVERY_HOOK = """
from skillframe.extend.registry import registry
found = [each for plugin in registry().plugins for each in plugin.provides]
assert not registry().not_installed and len(registry().plugins) == {count} and len(found) >= {least}, found
"""


def test_no_hook_of_the_core_loads_a_heavy_library():
    # 9 worlds, 4 readers, 3 exporters, 4 robots
    assert not loaded_by(CALL_EVERY_HOOK.format(count=1, least=20)) & HEAVY


@pytest.mark.needs_plugins
@pytest.mark.parametrize("plugin", HOOKED, ids=lambda p: p.name)
@pytest.mark.slow
def test_no_hook_of_a_plugin_loads_a_heavy_library(plugin):
    assert not loaded_by(CALL_EVERY_HOOK.format(count=2, least=14), plugin.name) & HEAVY


@pytest.mark.needs_plugins
@pytest.mark.parametrize("words", ["plugins", "plugins --json", "reproduce --list --json"])
@pytest.mark.slow
def test_a_listing_loads_no_heavy_library(words):
    code = f"from skillframe.cli.main import run; assert run({words.split()!r}) == 0"
    assert not loaded_by(code, ALL_PLUGINS) & HEAVY


HELP_OF_EVERY_COMMAND = """
import click
from skillframe.cli.main import cli, run
def ask(words, command):
    assert run([*words, "--help"]) == 0
    for name in command.list_commands(click.Context(command)) if isinstance(command, click.Group) else ():
        ask([*words, name], command.get_command(click.Context(command), name))
ask([], cli)
"""


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_the_help_of_no_command_loads_a_heavy_library():
    assert not loaded_by(HELP_OF_EVERY_COMMAND, ALL_PLUGINS) & HEAVY


@pytest.mark.needs_plugins
@pytest.mark.parametrize("typed", ["skillframe pl", "skillframe plugins s", "skillframe run --wo"])
@pytest.mark.slow
def test_completing_a_word_loads_no_heavy_library(typed):
    code = (
        "from skillframe.cli.main import cli\n"
        "try: cli(prog_name='skillframe')\n"
        "except SystemExit as end: assert end.code == 0, end.code"
    )
    words = {"_SKILLFRAME_COMPLETE": "bash_complete", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    assert not loaded_by(code, ALL_PLUGINS, **words) & HEAVY


ARGUMENTS = {
    "build": 1, "check": 1, "learn": 2, "describe": 1, "advice": 1, "explain": 1, "area": 1, "example": 0, "centers": 1,
    "fit": 3, "run": 1, "write": 2, "compute": 1, "speed": 1, "exception": 1,
    "make": 3, "SectionType.make": 1, "adapted": 2, "audit": 1, "derived": 1, "told": 1, "quantities": 0, "tables": 0,
    "write_out": 2, "lacks": 2, "noise": 1, "teach": 3, "teacher": 0, "aimed": 3, "plots": 1,
    "world": 1, "files": 1, "refuse": 1,
    "read": 2, "table": 2, "claims": 1, "write_set": 2, "check_set": 1, "warnings": 1,
    "OutputType.write": 3, "draw": 1, "find": 0, "fix": 0,
    "holds": 1, "live": 1, "FolderType.read": 1, "page": 1,
    "found": 2, "usual": 1, "record": 3, "open": 1, "fake": 2,
}  # fmt: skip
NAMED = {"teach": {"count": 1, "seed": 0}, "record": {"count": 1, "seed": 0}}


def factories():
    """(record, field, function, what is given to it in advance) of every factory that is imported when it is called."""
    for kind in KINDS:
        for record in registry().records(kind):
            for field in dataclasses.fields(record):
                value = getattr(record, field.name)
                factory = value.func if isinstance(value, partial) else value
                if isinstance(factory, Lazy):
                    given = (value.args, value.keywords) if isinstance(value, partial) else ((), {})
                    yield record, field.name, factory.load(), given


@pytest.mark.needs_plugins
def test_every_factory_that_is_imported_when_called_is_there_and_takes_what_it_is_given():
    found = list(factories())
    assert {name for _, name, *_ in found} == {name.rpartition(".")[2] for name in ARGUMENTS}
    for record, name, function, (first, named) in found:
        count = ARGUMENTS.get(f"{type(record).__name__}.{name}", ARGUMENTS.get(name))
        count += isinstance(record, ExporterType) and record.axes is None  # a program also gets the robot
        try:
            inspect.signature(function).bind(*first, *range(count), **named, **NAMED.get(name, {}))
        except TypeError as error:
            pytest.fail(f"{name} of {record.name}: {error}")


def test_the_settings_of_every_record_are_a_dataclass():
    given = [record.settings for kind in ("skill", "coordinator") for record in registry().records(kind)]
    assert all(dataclasses.is_dataclass(settings()) for settings in given if settings is not None)


@pytest.mark.needs_plugins
def test_a_row_is_computed_by_the_function_that_says_its_number():
    rows = [(record.name, function) for record, name, function, _ in factories() if name == "run"]
    assert len(rows) == sum(name.startswith("row:") for name in homes())
    assert all(run.__doc__.startswith(f"Row {number}: ") for number, run in rows)
