"""`skillframe compare`: which of several policies is better, from any table of trials."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import emit_json, note, table

if TYPE_CHECKING:
    from skillframe_certify.compare import Judgement, Pair, Ranked


@click.command(name="compare")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--alpha", default=0.05, show_default=True, type=click.FloatRange(0.0, 0.5, min_open=True),
    help="Chance of any false decision, over all pairs and however often you look.",
)  # fmt: skip
@click.option(
    "--samples", metavar="COLUMN,...", help="Columns of sampled values, to check that a trial is the same for all."
)
@click.option("--score", metavar="COLUMN", help="Compare this figure instead of successes; the higher the better.")
@click.option("--lower", is_flag=True, help="The lower the score, the better.")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(file: Path, alpha: float, samples: str | None, score: str | None, lower: bool, as_json: bool) -> None:
    """Say which policies in FILE are better than others, and which show no difference.

    FILE is a table with the columns trial, policy (or skill) and success, in the order in which the trials were run:
    from real trials, a campaign's results.csv, or its folder. The same trial number means the same sampled parameters.
    You may look after every trial and stop as soon as there is an answer.

    \b
    Examples:
      skillframe compare results/results.csv
      skillframe compare trials.csv --samples friction,tilt --json
      skillframe compare results/results.csv --score peak_force_n --lower
    """
    from skillframe.errors import InputError
    from skillframe_certify.compare import compare
    from skillframe_certify.trials import read_trials

    if lower and score is None:
        raise InputError("--lower", "says how a score is better, and there is none", "give --score COLUMN, too")
    drawn = [name.strip() for name in samples.split(",")] if samples else []
    from skillframe_certify.real_trials import table_path

    trials = read_trials(table_path(file) if file.is_dir() else file, drawn, score)
    found = compare(trials, alpha, 0 if score is None else -1 if lower else 1)
    if as_json:
        emit_json({
            "alpha": found.alpha, "doubts": list(found.doubts),
            "policies": [each._asdict() for each in found.standings],
            "comparisons": [{name: getattr(pair, name) for name in pair.__slots__} for pair in found.pairs],
            "real": trials.real, "left_out_after": dict(trials.left_out),
        })  # fmt: skip
        return
    if trials.real:
        click.echo("real trials")
    _tell(found, score, trials.left_out)


def _tell(found: Judgement, score: str | None, left: Mapping[str, int]) -> None:
    for text in found.doubts:
        note(f"note: {text}")
    head = ("rate", "95 % interval") if score is None else (score, "middle half")
    lines = [
        (r.policy, f"{r.trials}, left out" if r.policy in left else r.trials, r.successes, *_figures(r), r.letters)
        for r in found.standings
    ]
    table(("policy", "trials", "successes", *head, "alike"), lines)
    click.echo(
        f"those that share a letter do not differ significantly (any false decision: at most {100 * found.alpha:g} %)"
    )
    for policy, after in left.items():
        click.echo(f"{policy} was left out of the race after {after} trials; its rate is of these alone")
    for pair in found.pairs:
        click.echo(f"{pair.first} against {pair.second}: {_counts(pair, score)}")
        click.echo(f"  p = {pair.p_value:.2g}: {_decision(pair)}")
    several = f", Holm over {len(found.pairs)} pairs" if len(found.pairs) > 1 else ""
    test = "McNemar's test" if score is None else "the test of signed ranks"
    click.echo(f"p: {test} in the form that holds at every look, its smallest value so far{several}")


def _figures(ranked: Ranked) -> tuple[str, str]:
    if ranked.quartiles:
        low, middle, high = ranked.quartiles
        return f"{middle:.4g}", f"{low:.4g} .. {high:.4g}"
    return f"{ranked.successes / ranked.trials:.3f}", f"{ranked.low:.3f} .. {ranked.high:.3f}"


def _counts(pair: Pair, score: str | None) -> str:
    other = pair.pairs - pair.by_number
    paired = f"{pair.pairs} pairs of trials" + (f", {other} of them in order of arrival" if other else "")
    if score is not None:
        return f"{paired}; the first is better in {pair.only_first}, the second in {pair.only_second}"
    return f"{paired}; only the first succeeds in {pair.only_first}, only the second in {pair.only_second}"


def _decision(pair: Pair) -> str:
    if pair.better:
        return f"{pair.better} is better; known after row {pair.known_after}"
    if pair.more is None:
        return "no significant difference"
    return f"no significant difference; about {pair.more} pairs more would do, if the rates stay as they are"
