"""`skillframe campaign`: run, resume, inspect and replay campaigns."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.options import COUNT, NATURAL, TRACE, WithUnit
from skillframe.cli.output import note, terminable
from skillframe.config.units import Range

if TYPE_CHECKING:
    from skillframe.campaign.runner import Options

_FOLDER = click.Path(path_type=Path)


@click.group(name="campaign")
def command() -> None:
    """Run skills many times over declared uncertainty, and keep every row.

    \b
    Example:
      skillframe campaign run peg.toml --out results --workers 2
      skillframe campaign status results
      skillframe campaign replay results 17 --out trial17.npz
    """


def _running(function: Callable[..., int]) -> Callable[..., int]:
    options = [
        click.option("--workers", type=COUNT, help="Worker processes on this machine [in-process]."),
        click.option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler, e.g. tcp://10.0.0.5:8786."),
        click.option("--chunk", type=COUNT, help="Largest number of trials per job [64]."),
        click.option(
            "--time-limit", "time_limit_s", metavar="SECONDS",
            type=WithUnit("s", Range(0.0, 1e9, "thirty years"), above=True),
            help="Wall time without progress after which a worker is taken for hung [120]; a slow one is not.",
        ),
        click.option("--traces", type=NATURAL, help="Trials per skill that leave a trace [8]."),
        click.option("--json", "as_json", is_flag=True, help="The summary as JSON alone on stdout."),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", type=_FOLDER, required=True, help="Folder for the results; absent or empty.")
@_running
def run(file: Path, out: Path, as_json: bool, **settings: Any) -> int:
    """Run the campaign that FILE (campaign.toml) declares.

    Exit code 0; 1 if a success rate is below `[expect] rate` (or its interval not above it, with `by = "interval"`); 2
    if an input cannot be used, or if files, memory, plug-ins or workers stop it; 130 after Ctrl-C and 143 after
    SIGTERM. Finished trials are kept, and `campaign resume` continues.

    \b
    Example:
      skillframe campaign run peg.toml --out results --workers 2
    """
    options = _options(settings)
    from skillframe.api.campaigns import Campaign

    campaign = Campaign(file)
    with terminable() as code:
        try:
            campaign.prepare(out)
        except KeyboardInterrupt:
            click.echo("interrupted before the first trial; nothing is left", err=True)
            return code()
    return _go_on(out, options, as_json)


@command.command()
@click.argument("folder", type=_FOLDER)
@_running
def resume(folder: Path, as_json: bool, **settings: Any) -> int:
    """Run what is missing of the campaign in FOLDER. The results equal those of an uninterrupted run.

    Exit codes as for `run`.

    \b
    Example:
      skillframe campaign resume results --workers 2
    """
    return _go_on(folder, _options(settings), as_json)


@command.command()
@click.argument("folder", type=_FOLDER)
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def status(folder: Path, as_json: bool) -> int:
    """Show the progress of the campaign in FOLDER and its rates so far, also while it runs.

    \b
    Example:
      skillframe campaign status results --json
    """
    from skillframe.campaign.partial_results import status_of
    from skillframe.cli.campaign_words import show_rates
    from skillframe.cli.output import emit_json

    now = status_of(folder)
    if as_json:
        emit_json(now)
        return 0
    state = "complete" if now["complete"] else "unfinished"
    if now["running"]:
        state = f"running, process {now['running']['pid']} on {now['running']['host']}"
    where = f"{now['robot']} in {now['world']}"
    click.echo(f"{now['name']} ({where}): {now['rows']} of {now['planned_rows']} runs, {state}")
    show_rates(now["skills"])
    for text in now["remarks"]:
        click.echo(f"note: {text}")
    if state == "unfinished":
        click.echo(f"to go on: skillframe campaign resume {folder}")
    return 0


@command.command()
@click.argument("folder", type=_FOLDER)
@click.argument("trial", type=NATURAL)
@click.option("--skill", help="Skill as in results.csv, or its beginning [the first].")
@click.option("--out", type=TRACE, help="Trace file (.npz).")
def replay(folder: Path, trial: int, skill: str | None, out: Path | None) -> int:
    """Run TRIAL of the campaign in FOLDER again, alone, and compare it with its row bit by bit.

    Exit code 0 if they are identical, 1 if not.

    \b
    Example:
      skillframe campaign replay results 17 --skill peg --out trial17.npz
    """
    from skillframe.campaign import evaluate
    from skillframe.campaign.runner import replay_trial
    from skillframe.cli.output import table
    from skillframe.files import write_whole

    found = replay_trial(folder, trial, evaluate.evaluate, skill)
    names = list(dict.fromkeys([*found.then, *found.now]))
    marks = {name: "differs" if name in found.changed else "" for name in names}
    table(
        ["column", "campaign", "replay", ""],
        [[n, found.then.get(n, ""), found.now.get(n, ""), marks[n]] for n in names],
    )
    if out is not None and found.trace is not None:
        write_whole(out, found.trace)
        click.echo(f"trace: {out}")
    for line in found.environment:
        click.echo(f"not as in the campaign: {line}", err=True)
    click.echo("identical to the last bit" if not found.changed else f"differs in {', '.join(found.changed)}")
    return 1 if found.changed else 0


def _options(settings: dict[str, Any]) -> Options:
    from skillframe.campaign.runner import Options

    if settings["workers"] and settings["scheduler"]:
        raise click.UsageError("give --workers or --scheduler, not both")
    return Options(**{name: value for name, value in settings.items() if value is not None})


def _go_on(folder: Path, options: Options, as_json: bool) -> int:
    from skillframe.campaign import evaluate
    from skillframe.campaign.folder import load
    from skillframe.campaign.runner import run_campaign
    from skillframe.cli.campaign_words import conclude
    from skillframe.cli.output import campaign_progress

    spec = load(folder)
    if spec.trials % spec.cells:
        from skillframe.campaign.statistics import validity_of

        note(f"there will be {validity_of(spec.plan, complete=True).interval_method}")
    with terminable() as code:
        try:
            with campaign_progress() as notify:
                summary = run_campaign(folder, evaluate.evaluate, options, notify)
        except KeyboardInterrupt:
            click.echo(f"interrupted; finished rows are kept, to go on: skillframe campaign resume {folder}", err=True)
            return code()
    return conclude(folder, spec, summary, as_json)
