"""Commands that list things of a kind, show one, and have commands below them, which plug-ins can add to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from skillframe.errors import SkillframeError

if TYPE_CHECKING:
    from skillframe.extend.commands import PluginCommand


class Listing(click.Group):
    """A command that lists things of a kind, or shows the one named, and has commands below it.

    The first word is a command if there is one of that name: `worlds`, `worlds valley`, `worlds new`. Commands below it
    are those of the core and those of plug-ins, named "LISTING.COMMAND" in their metadata. A plug-in cannot replace a
    command of the core.
    """

    allow_interspersed_args = True

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{**settings, "invoke_without_command": True})

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the core's commands, then of the plug-ins'."""
        own = super().list_commands(ctx)
        return [*own, *(name for name in self._added() if name not in own)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name. One of a plug-in is imported."""
        own = super().get_command(ctx, cmd_name)
        found = None if own else self._added().get(cmd_name)
        return own if found is None else found.load()

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Those of the listing itself, and for the usage line of a command below it its options alone."""
        found = super().get_params(ctx)
        return found if ctx.command is self else [each for each in found if isinstance(each, click.Option)]

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Those of the listing itself."""
        return click.Command.collect_usage_pieces(self, ctx)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of `--help` without importing commands of plug-ins."""
        own = {name: super(Listing, self).get_command(ctx, name) for name in super().list_commands(ctx)}
        rows = [(name, each.get_short_help_str()) for name, each in own.items() if each is not None]
        rows += [(name, each.summary()) for name, each in self._added().items() if name not in own]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Leave everything behind a command's name to that command, and read other words as the listing's own.

        Raises:
            SkillframeError: the first word is a command of a plug-in that is absent.
        """
        if args and args[0] in self.list_commands(ctx):
            ctx.args = list(args)
            return ctx.args
        if args and not ctx.resilient_parsing:
            from skillframe.extend.homes import where_to_get

            name, left_out = args[0], self._added(selected=False).get(args[0])
            if left_out is not None:
                where = " and ".join(left_out.distributions)
                text = f"{self.name} {name} is a command of {where}, which SKILLFRAME_PLUGINS leaves out"
                raise SkillframeError(text)
            if missing := where_to_get("command", f"{self.name}.{name}", [str(self.name)], ()):
                raise SkillframeError(missing)
        return click.Command.parse_args(self, ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Invoke the command that was named, or list and show."""
        if not ctx.args:
            return click.Command.invoke(self, ctx)
        name, command, args = self.resolve_command(ctx, ctx.args)
        assert command is not None  # as its name is listed
        with command.make_context(name, args, parent=ctx) as below:
            return below.command.invoke(below)

    def _added(self, *, selected: bool = True) -> dict[str, PluginCommand]:
        from skillframe.extend.commands import plugin_commands

        ahead = f"{self.name}."
        found = plugin_commands().items()
        return {n.removeprefix(ahead): each for n, each in found if n.startswith(ahead) and each.selected == selected}
