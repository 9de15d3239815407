"""`skillframe trials`: trials of a real robot, typed one by one or read from a CSV, and their rate."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import NATURAL, emit_json, note

if TYPE_CHECKING:
    from skillframe_certify.real_trials import Real, RealTable

_PATH = click.Path(path_type=Path)


@click.group(name="trials")
def trials() -> None:
    """Enter trials of a real robot, and compute their success rate.

    \b
    Example:
      skillframe trials enter bench --skill peg --success
    """


@trials.command()
@click.argument("table", type=_PATH)
@click.option("--skill", help="What ran: a skill file's name, or any other [in TABLE, if it has one alone].")
@click.option("--success/--failure", default=None, help="How the trial ended.")
@click.option("--why", default="", help="Why it failed, in a few words.")
@click.option("--samples", multiple=True, metavar="NAME=VALUE", help="What was set or measured; any number of times.")
@click.option("--trial", type=NATURAL, help="Its number [the skill's next]. The same number means the same samples.")
@click.option("--from", "given", type=_PATH, metavar="FILE.csv", help="Enter the trials of a CSV, all or none.")
def enter(
    table: Path, skill: str | None, success: bool | None, why: str, samples: tuple[str, ...], trial: int | None,
    given: Path | None,
) -> None:  # fmt: skip
    """Enter trials of a real robot into TABLE: a folder, or a .csv file. They are marked as real.

    Without --success, --failure or --from, the terminal asks for each trial until an empty line, and saves each before
    the next. Trials are numbered per skill; a gap or a repeated trial is refused.

    \b
    Examples:
      skillframe trials enter bench --skill peg --success --samples offset_mm=2.5
      skillframe trials enter bench --skill peg --failure --why jammed --samples offset_mm=-1
      skillframe trials enter bench --from trials.csv
      skillframe compare bench
    """
    from skillframe.errors import InputError
    from skillframe_certify.real_trials import Real, open_real, read_given

    found = open_real(table)
    if given is not None:
        if success is not None or samples or trial is not None or why:
            raise click.UsageError("give --from or a trial, not both")
        rows = read_given(given, skill)
        _told(found, found.add([row for _, row in rows], [where for where, _ in rows]))
        return
    name = skill or _only(found)
    if success is None and not sys.stdin.isatty():
        raise InputError("trials enter", "needs the outcome of the trial",
                         "give --success or --failure, or --from FILE.csv")  # fmt: skip
    if success is None:
        if samples or trial is not None or why:
            raise click.UsageError("say how the trial ended: --success or --failure")
        _ask(found, name)
        return
    drawn = _numbers(samples)
    _told(found, found.add([Real(name, success, why.strip(), drawn, trial)], [f"{found.path}: new trial"]))


@trials.command()
@click.argument("table", type=_PATH)
@click.option("--campaign", required=True, type=_PATH, help="Folder of a finished campaign of the same skill.")
@click.option("--skill", help="What ran [in TABLE, if it has one alone].")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def rate(table: Path, campaign: Path, skill: str | None, as_json: bool) -> None:
    """Success rate of the real robot, from the real trials of TABLE and simulated ones.

    The samples of the real trials have to be drawn as the campaign's [vary] says. Each real trial is simulated once
    with its samples. Where simulation and robot fail at the same samples, the interval is narrower than that of the
    real trials alone; where they do not, it is little wider. It is valid at every look.

    \b
    Example:
      skillframe trials rate bench --campaign results
    """
    from skillframe_certify.joined import join
    from skillframe_certify.real_trials import open_real

    real = open_real(table)
    name = skill or _only(real)
    own = [row for row in real.rows if row.skill == name]
    if not own:
        raise click.UsageError(f"{real.path} holds no trial of {name}")
    found = join(campaign, own)
    both, robot, only, _ = found.counts
    if as_json:
        emit_json({**found._asdict(), "worth": found.worth})
        return
    click.echo(f"real trials     {both + robot} of {len(own)} succeeded; in simulation {both + only}, of these "
               f"{both} of the same trials")  # fmt: skip
    click.echo(f"campaign        {found.simulated[0]} of {found.simulated[1]} succeeded")
    click.echo(f"real rate       {100 * found.interval.low:.1f} to {100 * found.interval.high:.1f} % (95 %, valid at "
               "every look)")  # fmt: skip
    click.echo(f"without simulation  {100 * found.alone.low:.1f} to {100 * found.alone.high:.1f} %; as narrow as the "
               f"first with about {found.worth:.0f} trials")  # fmt: skip


def _only(found: RealTable) -> str:
    from skillframe.errors import InputError

    skills = list(dict.fromkeys(row.skill for row in found.rows))
    if len(skills) != 1:
        said = f"there are {', '.join(skills)}" if skills else "the table holds no trial yet"
        raise InputError("--skill", f"is missing, and {said}", "say which skill ran")
    return skills[0]


def _numbers(samples: tuple[str, ...]) -> dict[str, float]:
    from skillframe.errors import InputError
    from skillframe_certify.real_trials import number_of

    drawn: dict[str, float] = {}
    for text in samples:
        name, parted, value = text.partition("=")
        if not parted or name in drawn:
            fix = "give each sampled value once, as NAME=VALUE"
            raise InputError("--samples", f"{text!r} is no new NAME=VALUE", fix)
        drawn[name] = number_of("--samples", name, value)
    return drawn


def _ask(found: RealTable, skill: str) -> None:
    from skillframe.errors import InputError
    from skillframe_certify.real_trials import Real, number_of

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
            drawn = {name: number_of("samples", name, click.prompt(f"  {name}")) for name in found.names or ()}
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
