"""`skillframe certify`: all commands for certificates."""

from __future__ import annotations

import click

from skillframe_certify.commands.certify import check, run
from skillframe_certify.commands.searches import find_failure, map_, sensitivity


@click.group(name="certify")
def command() -> None:
    """Certify where a skill works, find its border, what breaks it and which quantity matters.

    \b
    Example:
      skillframe certify run peg.toml --rate 0.95 --out certified --workers 2
      skillframe certify check certified
    """


for each in (run, map_, sensitivity, find_failure, check):
    command.add_command(each)
