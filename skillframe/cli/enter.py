"""`skillframe campaign enter`: trials of a real robot, typed one by one or read from a CSV."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli.numbers import NATURAL
from skillframe.cli.output import note, quiet_option

if TYPE_CHECKING:
    from skillframe.campaign.claims.real import Real, RealTable

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("table", type=_PATH)
@click.option("--skill", help="What ran: a skill file's name, or any other [in TABLE, if it has one alone].")
@click.option("--success/--failure", default=None, help="How the trial ended.")
@click.option("--why", default="", help="Why it failed, in a few words.")
@click.option("--draws", multiple=True, metavar="NAME=VALUE", help="What was set or measured; any number of times.")
@click.option("--trial", type=NATURAL, help="Its number [the skill's next]. The same number means the same draws.")
@click.option("--from", "given", type=_PATH, metavar="FILE.csv", help="Enter the trials of a CSV, all or none.")
@quiet_option
def enter(
    table: Path, skill: str | None, success: bool | None, why: str, draws: tuple[str, ...], trial: int | None,
    given: Path | None,
) -> None:  # fmt: skip
    """Enter trials of a real robot into TABLE: a folder, or a .csv file. They are marked as real.

    Without --success, --failure or --from each trial is asked for on the terminal, until an empty line. A trial is on
    the disk before the next is asked for. Trials are numbered per skill; a gap or a repeated trial is refused.

    \b
    Examples:
      skillframe campaign enter bench --skill peg --success --draws offset_mm=2.5
      skillframe campaign enter bench --skill peg --failure --why jammed --draws offset_mm=-1
      skillframe campaign enter bench --from trials.csv
      skillframe compare bench
    """
    from skillframe.campaign.claims.real import Real, open_real, read_given
    from skillframe.errors import InputError

    found = open_real(table)
    if given is not None:
        if success is not None or draws or trial is not None or why:
            raise click.UsageError("give --from or a trial, not both")
        rows = read_given(given, skill)
        _told(found, found.add([row for _, row in rows], [where for where, _ in rows]))
        return
    name = skill or _only(found)
    if success is None and not sys.stdin.isatty():
        raise InputError("campaign enter", "was not told how the trial ended",
                         "give --success or --failure, or --from FILE.csv")  # fmt: skip
    if success is None:
        if draws or trial is not None or why:
            raise click.UsageError("say how the trial ended: --success or --failure")
        _ask(found, name)
        return
    drawn = _numbers(draws)
    _told(found, found.add([Real(name, success, why.strip(), drawn, trial)], [f"{found.path}: new trial"]))


def _only(found: RealTable) -> str:
    """The table's skill, where it has one alone."""
    from skillframe.errors import InputError

    skills = list(dict.fromkeys(row.skill for row in found.rows))
    if len(skills) != 1:
        said = f"there are {', '.join(skills)}" if skills else "the table holds no trial yet"
        raise InputError("--skill", f"is missing, and {said}", "say which skill ran")
    return skills[0]


def _numbers(draws: tuple[str, ...]) -> dict[str, float]:
    from skillframe.campaign.claims.real import number_of
    from skillframe.errors import InputError

    drawn: dict[str, float] = {}
    for text in draws:
        name, parted, value = text.partition("=")
        if not parted or name in drawn:
            fix = "give each draw once, as NAME=VALUE"
            raise InputError("--draws", f"{text!r} is no new NAME=VALUE", fix)
        drawn[name] = number_of("--draws", name, value)
    return drawn


def _ask(found: RealTable, skill: str) -> None:
    """Ask for trial after trial, until an empty answer, Ctrl-D or Ctrl-C."""
    from skillframe.campaign.claims.real import Real, number_of
    from skillframe.errors import InputError

    while True:
        number = found.next_trial(skill)
        try:
            answer = click.prompt(f"trial {number} of {skill}: success? y, n, or nothing to end", default="",
                                  show_default=False)  # fmt: skip
            if answer.strip().lower() not in ("y", "yes", "1", "n", "no", "0"):
                if not answer.strip():
                    return
                click.echo("type y or n")
                continue
            won = answer.strip().lower() in ("y", "yes", "1")
            why = "" if won else click.prompt("  why", default="", show_default=False).strip()
            drawn = {name: number_of("draws", name, click.prompt(f"  {name}")) for name in found.names or ()}
            _told(found, found.add([Real(skill, won, why, drawn, number)], [f"{found.path}: new trial"]))
        except InputError as error:
            click.echo(f"{error}; type this trial again", err=True)
        except click.Abort:
            click.echo("", err=True)
            return


def _told(found: RealTable, fresh: list[Real]) -> None:
    for skill in dict.fromkeys(row.skill for row in fresh):
        own = [row for row in found.rows if row.skill == skill]
        last = max(int(row.trial or 0) for row in own)
        note(f"{found.path}: {skill} has {len(own)} real trials up to number {last}, "
             f"{sum(row.success for row in own)} succeeded")  # fmt: skip
