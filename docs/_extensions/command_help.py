"""The directive `command-help`: every command with the help it prints, taken from click when the docs are built."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from skillframe.cli.main import cli

WIDTH = 90
SETTINGS: dict[str, Any] = {**cli.context_settings, "max_content_width": WIDTH, "terminal_width": WIDTH}


def contexts(command: click.Command, context: click.Context) -> Iterator[click.Context]:
    """The context of a command and of everything below it."""
    yield context
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from contexts(below, click.Context(below, info_name=name, parent=context, **SETTINGS))


class CommandHelp(SphinxDirective):
    """A section per command, with its help as it is printed."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        top = click.Context(cli, info_name="skillframe", **SETTINGS)
        return [self._section(context) for context in contexts(cli, top)]

    def _section(self, context: click.Context) -> nodes.Node:
        name, text = context.command_path, context.get_help()
        section = nodes.section(ids=[nodes.make_id(name)], names=[name])
        section += nodes.title(text=name)
        section += nodes.literal_block(text, text, language="text")
        return section


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
