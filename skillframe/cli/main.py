"""`skillframe`: lazily loaded commands, one module each, and the exit codes of the contract.

0 success; 1 the work ran and its result is negative; 2 usage or input error; 3 internal error. A command's module is
imported on use, so that `skillframe --help` loads no scientific library. Plug-ins add commands (`extend.commands`).
"""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import click

from skillframe import __version__
from skillframe.cli.output import quiet_option
from skillframe.errors import SkillframeError, extras_named

if TYPE_CHECKING:
    from skillframe.extend.commands import PluginCommand

COMMANDS = {
    "demo": "The whole way in minutes: demonstrate, learn, run, prove, report.",
    "record": "Record demonstrations by a simulated teacher.",
    "segment": "Cut whole demonstrations into phases and learn a policy.",
    "learn": "Learn a skill from demonstrations.",
    "show": "Show what a learned skill does, in words and pictures.",
    "run": "Run a skill in a simulated world.",
    "campaign": "Run a skill many times over declared uncertainty.",
    "export": "Write a skill as settings of another controller.",
    "robots": "List robots, show and check one.",
    "worlds": "List worlds, show one, and what --set takes there.",
    "skills": "List kinds of skills, and show one.",
    "fmu": "List, check, build and simulate FMUs.",
    "plugins": "List plug-ins, and show what they bring.",
    "doctor": "What is installed, what is missing, what to type.",
}


NO_ARGUMENTS: Any = getattr(click.exceptions, "NoArgsIsHelpError", ())
"""Error of a call without arguments, which prints help; older click has none."""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class LazyGroup(click.Group):
    """Commands in `skillframe.cli.<name>` and in plug-ins, imported on use. Absent modules are not listed.

    A plug-in cannot replace a command of the core.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the core's present commands, then of the plug-ins'."""
        return [*_own(), *_added()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command of that name."""
        if cmd_name in _own():
            command: click.Command = import_module(f"skillframe.cli.{cmd_name}").command
            return command
        found = _added().get(cmd_name)
        return None if found is None else found.load()

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of `--help` without importing a command of the core."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name]) for name in _own()])
        added = [(name, command.summary()) for name, command in _added().items()]
        if added:
            with formatter.section("Commands of plug-ins"):
                formatter.write_dl(added)

    def make_context(self, *arguments: Any, **settings: Any) -> click.Context:
        """As click does, which prints `--help` and `--version` here. See `invoke`."""
        with _readers_may_leave():
            return super().make_context(*arguments, **settings)

    def invoke(self, ctx: click.Context) -> Any:
        """As click does, but a closed output, as of `head`, is no error."""
        with _readers_may_leave():
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does, but for an unknown name suggest its plug-in, or the nearest name."""
        if args and not args[0].startswith("-"):
            require_command(args[0])
        return super().resolve_command(ctx, args)


def _own() -> list[str]:
    return [name for name in COMMANDS if find_spec(f"skillframe.cli.{name}") is not None]


def _added(*, selected: bool = True) -> dict[str, PluginCommand]:
    from skillframe.extend.commands import plugin_commands

    found = plugin_commands().items()
    return {n: each for n, each in found if n not in COMMANDS and "." not in n and each.selected == selected}


def require_command(name: str) -> None:
    """Refuse an absent command, with the line that installs it if known.

    Raises:
        SkillframeError: it is absent.
    """
    if name in _own() or name in _added():
        return
    from skillframe.errors import UnknownName
    from skillframe.extend.homes import where_to_get

    left_out = _added(selected=False).get(name)
    if left_out is not None:
        where = " and ".join(left_out.distributions)
        raise SkillframeError(f"{name} is a command of {where}, which SKILLFRAME_PLUGINS leaves out")
    known = [*_own(), *_added()]
    missing = where_to_get("command", name, known, ())
    raise SkillframeError(missing) if missing else UnknownName("command", name, known)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="skillframe")
@quiet_option
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Teach robots compliant assembly from human demonstration, and prove the skill.

    -q and --debug may also stand behind a command.

    \b
    Example:
      skillframe demo --out demo
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: run a command and exit with the contract's code."""
    # Before numpy is loaded: on matrices as small as ours, threads of OpenBLAS cost up to ten times what they do.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in arguments
    arguments = [a for a in arguments if a != "--debug"]
    sys.exit(run(arguments, debug))


def run(arguments: Sequence[str], debug: bool = False) -> int:
    """Run a command line and return its exit code. Messages go to stderr. -q may stand anywhere."""
    for stream in (sys.stdout, sys.stderr):  # print anything, whatever the terminal's encoding
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    quiet = [word for word in arguments if word in ("-q", "--quiet")]
    arguments = [*quiet[:1], *(word for word in arguments if word not in quiet)]
    try:
        with extras_named():
            result = cli.main(list(arguments), prog_name="skillframe", standalone_mode=False)
    except NO_ARGUMENTS as error:
        error.show()
        return 2
    except click.ClickException as error:
        click.echo(f"error: {_of_usage(error, arguments)}", err=True)
        return 2
    except SkillframeError as error:
        if debug:
            raise
        click.echo(f"error: {error}", err=True)
        return 2
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted; what was finished is kept", err=True)
        return 130
    except (OSError, MemoryError) as error:
        if debug:
            raise
        click.echo(f"error: {_of_the_system(error)}", err=True)
        return 2
    except Exception as error:
        if debug:
            raise
        text = f"{type(error).__name__}: {error} (run again with --debug for the traceback)"
        click.echo(f"internal error: {text}", err=True)
        return 3
    return result if isinstance(result, int) else 0


def _of_usage(error: click.ClickException, arguments: Sequence[str]) -> str:
    said = " ".join(error.format_message().split()).removesuffix(".").replace(". Did you", "; did you")
    context = getattr(error, "ctx", None)
    typed = next((word for word in arguments[:2] if word in COMMANDS), "")
    command = f"skillframe {typed}".strip() if context is None else context.command_path
    return f"{said[:1].lower()}{said[1:]} (help: {command} --help)"


def _of_the_system(error: OSError | MemoryError) -> str:
    if isinstance(error, MemoryError):
        return "memory ran out; give smaller files or fewer trials at a time, or free memory"
    said = error.strerror or str(error) or type(error).__name__
    if error.errno not in FULL:
        return f"{error.filename or 'the system'}: {said}"
    _discard_output()
    return f"{error.filename or 'what is printed (standard output) cannot be written'}: {said}; make room there"


@contextmanager
def _readers_may_leave() -> Iterator[None]:
    """Exit with 0 if the output is closed, where click would exit with 1."""
    try:
        yield
    except BrokenPipeError:
        _discard_output()
        raise click.exceptions.Exit(0) from None


def _discard_output() -> None:
    """Discard further output, as Python would fail once more on exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
