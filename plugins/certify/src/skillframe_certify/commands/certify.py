"""`skillframe certify run` and `check`: certify a box of a campaign's ranges, and verify it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import COUNT, NATURAL, emit_json, note, terminable

if TYPE_CHECKING:
    from skillframe_certify.certificate import Outcome
    from skillframe_certify.engine import Engine

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("source", type=_PATH)
@click.option("--out", type=_PATH, help="Folder for everything; absent or empty. Not given to go on with a folder.")
@click.option("--rate", type=float, help="Success probability to certify, at least [0.95].")
@click.option("--confidence", type=float, help="With which the certificate is to hold [0.95].")
@click.option("--skill", help="Skill as in the campaign file, or its beginning [the first].")
@click.option("--look", type=COUNT, help="Exploratory trials [64 to 512, by the number of ranges].")
@click.option("--again", is_flag=True, help="Claim once more, with fresh trials, after a claim that failed.")
@click.option("--workers", type=COUNT, help="Worker processes on this machine [in-process].")
@click.option("--json", "as_json", is_flag=True, help="The certificate as JSON alone on stdout.")
def run(source: Path, out: Path | None, workers: int | None, **settings: Any) -> int:
    """Certify the box of declared quantities in which a skill works. SOURCE is a campaign or a task, in TOML.

    For a campaign, a few hundred exploratory trials over the ranges under [vary] propose a box. The claim is written
    first, then tested with fresh independent trials, which alone support it. If SOURCE is a folder of this command, it
    continues after an interruption.

    A task does more: it records or takes demonstrations, learns a skill, finds the border of success, the smallest
    disturbance that breaks the skill and the quantity that matters, certifies a box, and writes a report. Type the same
    line again to continue after an interruption.

    Exit code 0 if a box was certified, 1 if not.

    \b
    Examples:
      skillframe certify run peg.toml --rate 0.95 --out certified --workers 2
      skillframe certify run certified
      skillframe certify run valley.task.toml --out valley --workers 2
    """
    from skillframe.errors import InputError
    from skillframe.files.documents import kind_of
    from skillframe_certify.commands.task import certify_task

    if kind_of(source) != "task":
        return _campaign(source, out, workers, **settings)
    said = next((name for name, value in settings.items() if value), None)
    if said is not None:
        said = f"--{said.removeprefix('as_')}"
        raise InputError(said, "is for a campaign, and a task's file says what is certified", f"leave out {said}")
    if out is None:
        raise InputError("--out", "is missing", "name a folder for everything that the task makes")
    return certify_task(source, out, workers)


def _campaign(
    source: Path, out: Path | None, workers: int | None, *, rate: float | None, confidence: float | None,
    skill: str | None, look: int | None, again: bool, as_json: bool,
) -> int:  # fmt: skip
    from skillframe.errors import InputError
    from skillframe_certify.certificate import CERTIFICATE, write_certificate
    from skillframe_certify.real_trials import is_real

    folder = source if out is None else out
    if is_real(source):
        raise InputError(
            source, "holds real trials, and a claim has to be written before the trials that test it",
            f"see their interval, valid at every look: skillframe report {source} --out page.html",
        )  # fmt: skip
    with terminable() as code:
        try:
            if out is not None:
                start(source, out, rate, confidence, skill, look)
            else:
                _ask(folder, rate, confidence)
            with engine_of(folder, workers) as engine:
                found = _judged(folder, engine, again)
        except KeyboardInterrupt:
            go_on = f"to go on: skillframe certify run {folder}"
            click.echo(f"interrupted; what is done is kept, {go_on}", err=True)
            return code()
    content = write_certificate(folder, found, engine.params)
    if as_json:
        emit_json(content)
    else:
        _show(found, content["predicate"])
        click.echo(f"certificate  {folder / CERTIFICATE}; to check it: skillframe certify check {folder}")
    return 0 if content["predicate"]["certified"] else 1


def start(
    source: Path, out: Path, rate: float | None = None, confidence: float | None = None, skill: str | None = None,
    look: int | None = None, most: int | None = None,
) -> None:  # fmt: skip
    """Begin a folder from a campaign file with at most `most` ranges (default: `MOST_MAPPED`)."""
    from skillframe.campaign import CampaignSpec, evaluate
    from skillframe.extend import registry
    from skillframe_certify.question import MOST_MAPPED, USUAL, begin

    spec = CampaignSpec.from_toml(source)
    begin(
        spec, out, evaluate.describe, registry().world(spec.world_place).params,
        rate=USUAL if rate is None else rate, confidence=USUAL if confidence is None else confidence, skill=skill,
        look=look, most=most or MOST_MAPPED,
    )  # fmt: skip


def _ask(folder: Path, rate: float | None, confidence: float | None) -> None:
    from skillframe.errors import InputError
    from skillframe_certify import procedure
    from skillframe_certify.question import ask_again, read_question

    asked = read_question(folder)
    rate = asked.rate if rate is None else rate
    confidence = asked.confidence if confidence is None else confidence
    if (rate, confidence) == (asked.rate, asked.confidence):
        return
    if procedure.claims(folder):
        raise InputError(folder, f"has claimed a rate of {asked.rate:g} with confidence {asked.confidence:g} already",
                         "leave out --rate and --confidence: a claim stays as it was written")  # fmt: skip
    ask_again(folder, rate, confidence)


@contextmanager
def engine_of(folder: Path, workers: int | None) -> Iterator[Engine]:
    """Provide the engine of a folder's trials and stop its workers at the end."""
    from skillframe.campaign import WATCH, FolderLock, Keeper, Options, evaluate, load
    from skillframe.extend import registry
    from skillframe_certify.engine import Engine
    from skillframe_certify.question import LOOK, read_question

    read_question(folder)
    params = registry().world(load(folder / LOOK).world_place).params
    with FolderLock(folder), Keeper(folder.resolve() / WATCH) as keeper:
        options = Options(workers=workers, traces=2, keeper=keeper)
        yield Engine(evaluate.evaluate, evaluate.describe, params, options, evaluate.starts)


def _judged(folder: Path, engine: Engine, again: bool) -> Outcome | None:
    """Run what is missing and return the outcome, or None if no box is worth claiming."""
    from skillframe.cli import campaign_progress
    from skillframe.errors import InputError
    from skillframe_certify import procedure
    from skillframe_certify.certificate import outcome
    from skillframe_certify.question import LOOK, mapped_question
    from skillframe_certify.rounds import is_complete, looked

    question = mapped_question(folder)
    places = procedure.claims(folder)
    if not places and not is_complete(folder / LOOK, engine.params):
        note("exploring where the skill works; these trials support no claim")
        with campaign_progress() as notify:
            procedure.look(folder, engine, notify)
    if not places or again:
        if again and (not places or outcome(folder, engine.params).best is not None):
            raise InputError("--again", "no claim of this folder has failed", "leave it out")
        box = procedure.propose(question, looked(folder, engine.params))
        if box is None:
            return outcome(folder, engine.params) if places else None
        box = procedure.cleared(folder, question, box, engine)
        places = [*places, procedure.write_claim(folder, question, box, engine.params)]
    claim = procedure.read_claim(places[-1])
    note(f"claim {claim['number']} is written; {claim['trials']} fresh trials test it")
    with campaign_progress() as notify:
        procedure.run_fresh(folder, places[-1], engine, notify)
    return outcome(folder, engine.params)


def _show(found: Outcome | None, said: dict[str, Any]) -> None:
    from skillframe.campaign import said_again
    from skillframe_certify.binding import SYSTEM
    from skillframe_certify.certificate import CHOSEN

    seen = said["looked_at"]
    click.echo(f"explored     {seen['trials']} trials, {seen['successes']} succeed")
    if seen["refused"]:
        share = f"{seen['refused'] / (seen['refused'] + seen['trials']):.1%}"
        click.echo(
            f"refused      {seen['refused']} more starts inside something, {share}: no trials, and the box has none"
        )
    if found is None:
        click.echo("not certified: there is no box in which nearly all trials are likely to succeed")
        return
    for each in said["tested"]:
        verdict = "passed" if each["passed"] else "failed"
        inside = f", and {each['refused']} starts are inside something" if each["refused"] else ""
        click.echo(f"tested       {each['trials']} fresh trials, {each['failures']} fail{inside}: {verdict}")
    box = said["box"] or said["tested"][0]["box"]
    where = f"{said['skill']}, {said['robot']} in {said['world']}"
    if said["certified"]:
        click.echo(f"certified    {where}: succeeds in at least {100 * said['rate']:g} % of trials")
        click.echo(f"             with {100 * said['confidence']:g} % confidence, in the mean over this box, where")
    else:
        click.echo(f"not certified: {where} at {100 * said['rate']:g} % in the smallest box, where")
    for name, (low, high) in box.items():
        ends = f"{said_value(name, low)} to {said_value(name, high)}"
        click.echo(f"               {name} is {ends}{_edge(low, high, said['declared'][name])}")
    if said["certified"]:
        click.echo(f"             {100 * said['share_of_declared']:.3g} % of the declared volume")
    if found.again is not None:
        click.echo(f"note         {said_again(found.again)}")
    if said["seed_drawn_by"] != SYSTEM:
        click.echo(f"note         {CHOSEN}")
    if said["failed_trials"]:
        some = ", ".join(str(trial) for trial in said["failed_trials"][:8])
        click.echo(f"failed       trials {some}; to see one: skillframe campaign replay {found.place}/fresh TRIAL")


def said_value(name: str, value: float) -> str:
    """Return a quantity's value as it could be typed, to four digits."""
    import re

    from skillframe.config.units import shown
    from skillframe.extend import quantities

    unit = quantities()[name].unit if name in quantities() else ""
    return re.sub(r"^-?[\d.]+(e-?\d+)?", lambda found: f"{float(found[0]):.4g}", shown(value, unit))


def _edge(low: float, high: float, declared: list[float]) -> str:
    """A remark if the box reaches an end of the declared range, since the border lies beyond."""
    near = 1e-9 * (declared[1] - declared[0])
    ends = [word for word, gap in (("low", low - declared[0]), ("high", declared[1] - high)) if gap <= near]
    return f" (reaches the {' and the '.join(ends)} end of what was declared)" if ends else ""


@click.command()
@click.argument("folder", type=_PATH)
@click.option("--replays", default=3, show_default=True, type=NATURAL, help="Fresh trials to run again, bit by bit.")
def check(folder: Path, replays: int) -> int:
    """Check the certificate in FOLDER: hashes, figures, and some of its trials run again.

    It guards against mistakes, not against plug-ins that are written to deceive.

    Exit code 0 if everything fits, 1 if not.

    \b
    Example:
      skillframe certify check certified --replays 5
    """
    from skillframe.campaign import evaluate, replay_trial
    from skillframe_certify import procedure
    from skillframe_certify.certificate import CERTIFICATE, check_certificate
    from skillframe_certify.plan import PLAN
    from skillframe_certify.searches import check_plan, other_methods

    planned = (folder / PLAN).is_file()
    wrong = check_plan(folder) if planned else []
    if planned and (other := other_methods(folder)) is not None:
        click.echo(other, err=True)
    if planned and not (folder / CERTIFICATE).is_file():
        for text in wrong:
            click.echo(f"does not fit: {text}", err=True)
        click.echo("the plan does not hold" if wrong else "the plan follows from the trials; there is no certificate")
        return 1 if wrong else 0
    wrong += check_certificate(folder)
    for text in wrong:
        click.echo(f"does not fit: {text}", err=True)
    places = procedure.claims(folder)
    if wrong or not places:
        click.echo(
            "the certificate does not hold" if wrong else "the certificate fits its files; there is no trial in it"
        )
        return 1 if wrong else 0
    for text in procedure.other_software(places[-1]):
        click.echo(f"note: checked with other code than it was made with: {text}", err=True)
    total = int(procedure.read_claim(places[-1])["trials"])
    picked = sorted({round(i * (total - 1) / max(replays - 1, 1)) for i in range(min(replays, total))})
    changed = 0
    for trial in picked:
        found = replay_trial(places[-1] / procedure.FRESH, trial, evaluate.evaluate)
        changed += bool(found.changed)
        differs = f"differs in {', '.join(found.changed)}" if found.changed else "identical to the last bit"
        click.echo(f"trial {trial}: {differs}")
        for line in found.environment if found.changed else ():
            click.echo(f"  not as in the campaign: {line}", err=True)
    ran = f", {len(picked) - changed} of {len(picked)} replays are identical" if picked else ""
    click.echo(f"all hashes and figures fit{ran}")
    return 1 if changed else 0
