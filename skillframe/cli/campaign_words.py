"""What `skillframe campaign` says: how far it is while it runs, and its outcome."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.output import emit_json, is_quiet, note, table

if TYPE_CHECKING:
    from skillframe.campaign.runner import Progress
    from skillframe.campaign.spec import CampaignSpec


def conclude(folder: Path, spec: CampaignSpec, summary: dict[str, Any], as_json: bool) -> int:
    """Tell the outcome of a campaign that has ended. Returns its exit code."""
    from skillframe.campaign.folder import robot_notes
    from skillframe.campaign.summary import below_bar
    from skillframe.robot.model import load_model
    from skillframe.robot.resistance import resistance_note
    from skillframe.robot.spec import load_robot

    if as_json:
        where = {"robot": spec.robot_name, "world": spec.world_name, "results": str(folder / "results.csv")}
        emit_json({**summary, **where})
    else:
        _tell(folder, spec, summary)
    if text := summary.get("unwatched"):
        note(f"note: {text}")
    failed = any(skill["failures"] for skill in summary["skills"].values())
    robot = load_model(load_robot(str(spec.folder / spec.robot))) if failed else None
    doubts = [] if robot is None else [summary.get("guessed_masses"), resistance_note(robot)]
    for text in filter(None, [*doubts, *robot_notes(folder)]):
        note(f"note: {text}")
    short = below_bar(spec, summary)
    if short:
        click.echo(short, err=True)
    return 1 if short else 0


def _tell(folder: Path, spec: CampaignSpec, summary: dict[str, Any]) -> None:
    click.echo(f"{spec.robot_name} in {spec.world_name}, {summary['planned_trials']} trials planned")
    show_rates(summary["skills"])
    for pair in summary["comparisons"]:
        click.echo(f"{pair['first']} against {pair['second']} on the same {pair['trials']} draws:")
        click.echo(f"  only the first succeeds in {pair['only_first']}, only the second in {pair['only_second']}")
        click.echo(f"  {_p_value(pair)}{pair['method']}")
    if "race" in summary:
        _tell_race(summary["race"], summary["planned_trials"])
    elif summary["stopped_after_trial"] is not None:
        click.echo(f"stopped early after trial {summary['stopped_after_trial']}: the intervals are narrow enough")
    if (found := summary.get("verdict")) is not None:
        asked = f"{found['skill']} to succeed in at least {100.0 * found['required_rate']:g} % of trials"
        click.echo(f"required: {asked}; verdict: {found['verdict']} ({found['why']})")
    click.echo(f"results: {folder / 'results.csv'}")


def _tell_race(race: dict[str, Any], trials: int) -> None:
    from skillframe.campaign.race import told

    for label, found in race["left_out"].items():
        click.echo(told(label, found, trials, race["correction"]))
    if race["best"] is not None:
        click.echo(f"race: {race['best']} is the best, known after {race['looked_after']} trials")
        return
    more = f"; about {race['more']} trials more would do, if the rates stay as they are" if race["more"] else ""
    click.echo(f"race: {', '.join(race['not_told_apart'])} are not told apart{more}")


def _p_value(pair: dict[str, Any]) -> str:
    if pair["p_value"] is None:
        return ""
    corrected = f" ({pair['correction']})" if pair["correction"].startswith("Holm") else ""
    return f"p = {pair['p_value']:.2g}{corrected}, "


def show_rates(skills: dict[str, dict[str, Any]]) -> None:
    """Rates with their intervals, and the commonest causes of failure."""
    from skillframe.reports.results import cause_of

    rows = [
        [
            label, _trials(s), s["successes"], "-" if s["rate"] is None else f"{s['rate']:.3f}",
            "none" if s["interval_95"] is None else f"{s['interval_95'][0]:.3f} .. {s['interval_95'][1]:.3f}",
        ]
        for label, s in skills.items()
    ]  # fmt: skip
    table(["skill", "trials", "successes", "rate", "95 % interval"], rows)
    for method in dict.fromkeys(s["method"] for s in skills.values()):
        each = "intervals, each 95 % by itself" if len(skills) > 1 else "interval"
        click.echo(f"  {method}" if method.startswith("no interval") else f"  {each}: {method}")
    for label, s in skills.items():
        if s["unended"]:
            click.echo(f"  {label}: {s['unended']} of its successes had reached the goal, but not ended by themselves")
        if s["uncounted"]:
            more = f"{s['uncounted']} finished runs after trial {s['trials']} are not counted until that trial has run"
            click.echo(f"  {label}: {more}")
        causes: Counter[str] = Counter()
        for text, count in s["failures"].items():
            causes[cause_of(text)] += count
        for cause, count in causes.most_common(3):
            click.echo(f"  {label}: {count} x {cause}")


def _trials(s: dict[str, Any]) -> str:
    """How many trials count, with the mark of a skill that a race left out."""
    return f"{s['trials']}, left out" if "left_out_after" in s else str(s["trials"])


@contextmanager
def progress() -> Iterator[Callable[[Progress], None]]:
    """A bar on a terminal, a line per tenth of the work in a pipe, both on stderr. With -q only what is unusual."""
    import sys

    if is_quiet():
        yield lambda progress: click.echo(progress.note, err=True) if progress.note and not progress.usual else None
        return
    if not sys.stderr.isatty():
        yield _lines()
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    with Bar(console=console, transient=True) as bar:
        task = bar.add_task("runs", total=None)

        def show(progress: Progress) -> None:
            bar.update(task, completed=progress.done + progress.under_way, total=progress.total)
            if progress.note:
                console.print(progress.note, markup=False)

        yield show


def _lines() -> Callable[[Progress], None]:
    """Lines with the share that is done, the runs that have ended, and a guess of what is left from the pace so far."""
    import time

    shown, began, first = -1, time.monotonic(), -1.0

    def show(progress: Progress) -> None:
        nonlocal shown, first
        share = (progress.done + progress.under_way) / progress.total
        first = share if first < 0.0 else first
        if int(10 * share) > shown:
            shown = int(10 * share)
            spent = time.monotonic() - began
            left = spent * (1.0 - share) / (share - first) if share > first else 0.0
            guess = f", about {_span(left)} left" if left >= 1.0 else ""
            click.echo(f"{share:.0%} simulated, {progress.done} of {progress.total} runs complete{guess}", err=True)
        if progress.note:
            click.echo(progress.note, err=True)

    return show


def _span(seconds: float) -> str:
    """A length of time for people."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
