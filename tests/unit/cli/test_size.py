"""The command line stays small: these numbers may only fall."""

import click
import pytest

from skillframe.cli.main import cli

OF_PLUGINS = {"benchmark", "drive", "fmu export", "plugins new", "plugins check", "practise", "reproduce", "worlds new"}
"""Commands for what the core and the way from a recording to a certificate do not need."""


def below(words, command):
    """(words, number of options) of every command that does something."""
    if not isinstance(command, click.Group) or command.invoke_without_command:
        yield " ".join(words), sum(isinstance(each, click.Option) for each in command.params)
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from below([*words, name], command.get_command(context, name))


@pytest.mark.needs_plugins
def test_commands_and_options_are_few():
    every = dict(below([], cli))
    main = {name: options for name, options in every.items() if not {name, name.partition(" ")[0]} & OF_PLUGINS}
    assert len(main) <= 32 and sum(main.values()) <= 151, main
    assert len(every) <= 45 and sum(every.values()) <= 213, every
