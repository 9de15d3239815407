"""Printed outcome and rates of `skillframe campaign`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.output import emit_json, note, table

if TYPE_CHECKING:
    from skillframe.campaign.spec import CampaignSpec


def conclude(folder: Path, spec: CampaignSpec, summary: dict[str, Any], as_json: bool) -> int:
    """Print the outcome of a campaign that has ended, and return its exit code."""
    from skillframe.campaign.folder import robot_notes
    from skillframe.campaign.summary import below_bar
    from skillframe.robot.audit import resistance_note
    from skillframe.robot.model import load_model
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
    from skillframe.campaign.race import told

    click.echo(f"{spec.robot_name} in {spec.world_name}, {summary['planned_trials']} trials planned")
    show_rates(summary["skills"])
    for pair in summary["comparisons"]:
        click.echo(f"{pair['first']} against {pair['second']} on the same {pair['trials']} draws:")
        click.echo(f"  only the first succeeds in {pair['only_first']}, only the second in {pair['only_second']}")
        click.echo(f"  {_p_value(pair)}{pair['method']}")
    if "race" in summary:
        race = summary["race"]
        for label, found in race["left_out"].items():
            click.echo(told(label, found, summary["planned_trials"], race["correction"]))
        if race["best"] is not None:
            click.echo(f"race: {race['best']} is the best, known after {race['looked_after']} trials")
        else:
            more = f"; about {race['more']} trials more would do, if the rates stay as they are" if race["more"] else ""
            click.echo(f"race: {', '.join(race['not_told_apart'])} do not differ significantly{more}")
    elif summary["stopped_after_trial"] is not None:
        click.echo(f"stopped early after trial {summary['stopped_after_trial']}: the intervals are narrow enough")
    if (found := summary.get("verdict")) is not None:
        asked = f"{found['skill']} to succeed in at least {100.0 * found['required_rate']:g} % of trials"
        click.echo(f"required: {asked}; verdict: {found['verdict']} ({found['why']})")
    click.echo(f"results: {folder / 'results.csv'}")


def _p_value(pair: dict[str, Any]) -> str:
    if pair["p_value"] is None:
        return ""
    corrected = f" ({pair['correction']})" if pair["correction"].startswith("Holm") else ""
    return f"p = {pair['p_value']:.2g}{corrected}, "


def show_rates(skills: dict[str, dict[str, Any]]) -> None:
    """Print rates with their intervals, and the most frequent causes of failure."""
    from skillframe.campaign.rows import cause_of
    from skillframe.campaign.summary import refused_text

    rows = [
        [
            label, f"{s['trials']}{', left out' * ('left_out_after' in s)}", s["successes"],
            "-" if s["rate"] is None else f"{s['rate']:.3f}",
            "none" if s["interval_95"] is None else f"{s['interval_95'][0]:.3f} .. {s['interval_95'][1]:.3f}",
        ]
        for label, s in skills.items()
    ]  # fmt: skip
    table(["skill", "trials", "successes", "rate", "95 % interval"], rows)
    for method in dict.fromkeys(s["method"] for s in skills.values()):
        each = "intervals, each 95 % by itself" if len(skills) > 1 else "interval"
        click.echo(f"  {method}" if method.startswith("no interval") else f"  {each}: {method}")
    for label, s in skills.items():
        if refused := refused_text(s):
            click.echo(f"  {label}: {refused}")
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
