"""`skillframe campaign certify` and `check`: from a campaign's ranges to a box that is certified, and back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.interrupts import terminable
from skillframe.cli.numbers import COUNT, NATURAL
from skillframe.cli.output import emit_json, note, quiet_option

if TYPE_CHECKING:
    from skillframe.campaign.claims.certificate import Outcome
    from skillframe.campaign.claims.engine import Engine

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("source", type=_PATH)
@click.option("--out", type=_PATH, help="Folder for everything; absent or empty. Not given to go on with a folder.")
@click.option("--rate", type=float, help="Success probability to certify, at least [0.95].")
@click.option("--confidence", type=float, help="With which the certificate is to hold [0.95].")
@click.option("--skill", help="Skill as in the campaign file, or its beginning [the first].")
@click.option("--look", type=COUNT, help="Trials to look at first [64 to 512, by the number of ranges].")
@click.option("--again", is_flag=True, help="Claim once more, with fresh trials, after a claim that failed.")
@click.option("--workers", type=COUNT, help="Worker processes on this machine [in-process].")
@click.option("--json", "as_json", is_flag=True, help="The certificate as JSON alone on stdout.")
@quiet_option
def certify(
    source: Path, out: Path | None, rate: float | None, confidence: float | None, skill: str | None, look: int | None,
    again: bool, workers: int | None, as_json: bool,
) -> int:  # fmt: skip
    """Certify the box of declared quantities in which a skill works. SOURCE is a campaign.toml.

    The ranges under [vary] are looked at with a few hundred trials, a box is proposed, the claim is written down, and
    then tested with fresh independent trials, which alone carry it. A SOURCE that is a folder of this command goes on
    where it was interrupted.

    Exit code 0 if a box was certified, 1 if not.

    \b
    Examples:
      skillframe campaign certify peg.toml --rate 0.95 --out certified --workers 2
      skillframe campaign certify certified
      skillframe campaign check certified
    """
    from skillframe.campaign.claims.certificate import CERTIFICATE, write_certificate

    folder = source if out is None else out
    _refuse_real(source)
    with terminable() as code:
        try:
            if out is not None:
                start(source, out, rate, confidence, skill, look)
            else:
                _ask(folder, rate, confidence)
            with engine_of(folder, workers) as engine:
                found = _judged(folder, engine, again)
        except KeyboardInterrupt:
            go_on = f"to go on: skillframe campaign certify {folder}"
            click.echo(f"interrupted; what is done is kept, {go_on}", err=True)
            return code()
    content = write_certificate(folder, found, engine.params)
    if as_json:
        emit_json(content)
    else:
        _show(found, content["predicate"])
        click.echo(f"certificate  {folder / CERTIFICATE}; to check it: skillframe campaign check {folder}")
    return 0 if content["predicate"]["certified"] else 1


def _refuse_real(source: Path) -> None:
    """Real trials that are there already carry no claim: which ones there are was known when it would be written."""
    from skillframe.campaign.claims.real import is_real
    from skillframe.errors import InputError

    if is_real(source):
        raise InputError(
            source, "holds real trials, and a claim has to be written before the trials that test it",
            f"look at their interval, valid at every look: skillframe report {source} --out page.html",
        )  # fmt: skip


def start(
    source: Path, out: Path, rate: float | None = None, confidence: float | None = None, skill: str | None = None,
    look: int | None = None, most: int | None = None,
) -> None:  # fmt: skip
    """Begin a folder from a campaign file of `most` ranges, or, of None, as many as a box may have."""
    from skillframe.campaign import evaluate
    from skillframe.campaign.claims.question import MOST_MAPPED, USUAL, begin
    from skillframe.campaign.spec import CampaignSpec
    from skillframe.extend.registry import registry

    spec = CampaignSpec.from_toml(source)
    begin(
        spec, out, evaluate.describe, registry().world(spec.world_place).params,
        rate=USUAL if rate is None else rate, confidence=USUAL if confidence is None else confidence, skill=skill,
        look=look, most=most or MOST_MAPPED,
    )  # fmt: skip


def _ask(folder: Path, rate: float | None, confidence: float | None) -> None:
    """Another rate than the folder was begun with, as long as nothing is claimed."""
    from skillframe.campaign.claims import procedure
    from skillframe.campaign.claims.question import ask_again, read_question
    from skillframe.errors import InputError

    asked = read_question(folder)
    rate = asked.rate if rate is None else rate
    confidence = asked.confidence if confidence is None else confidence
    if (rate, confidence) == (asked.rate, asked.confidence):
        return
    if procedure.claims(folder):
        raise InputError(folder, f"has claimed a rate of {asked.rate:g} with confidence {asked.confidence:g} already",
                         "leave out --rate and --confidence, or claim another in a new folder")  # fmt: skip
    ask_again(folder, rate, confidence)


@contextmanager
def engine_of(folder: Path, workers: int | None) -> Iterator[Engine]:
    """How a folder's trials run. Workers that were started end with it."""
    from skillframe.campaign import evaluate
    from skillframe.campaign.claims.engine import Engine
    from skillframe.campaign.claims.question import LOOK, read_question
    from skillframe.campaign.folder import load
    from skillframe.campaign.kept import Keeper
    from skillframe.campaign.lock import FolderLock
    from skillframe.campaign.runner import WATCH, Options
    from skillframe.extend.registry import registry

    read_question(folder)
    params = registry().world(load(folder / LOOK).world_place).params
    with FolderLock(folder), Keeper(folder.resolve() / WATCH) as keeper:
        options = Options(workers=workers, traces=2, keeper=keeper)
        yield Engine(evaluate.evaluate, evaluate.describe, params, options)


def _judged(folder: Path, engine: Engine, again: bool) -> Outcome | None:
    """Run what is missing, and judge. None if no box was worth claiming."""
    from skillframe.campaign.claims import procedure
    from skillframe.campaign.claims.certificate import outcome
    from skillframe.campaign.claims.question import LOOK, mapped_question
    from skillframe.campaign.claims.rounds import is_complete, looked
    from skillframe.cli.campaign_words import progress
    from skillframe.errors import InputError

    question = mapped_question(folder)
    places = procedure.claims(folder)
    if not places and not is_complete(folder / LOOK, engine.params):
        note("looking where it works; these trials carry no claim")
        with progress() as notify:
            procedure.look(folder, engine, notify)
    if not places or again:
        if again and (not places or outcome(folder, engine.params).best is not None):
            raise InputError("--again", "no claim of this folder has failed", "leave it out")
        box = procedure.propose(question, looked(folder, engine.params))
        if box is None:
            return None
        places = [*places, procedure.write_claim(folder, question, box, engine.params)]
    claim = procedure.read_claim(places[-1])
    note(f"claim {claim['number']} is written; {claim['trials']} fresh trials test it")
    with progress() as notify:
        procedure.run_fresh(folder, places[-1], engine, notify)
    return outcome(folder, engine.params)


def _show(found: Outcome | None, said: dict[str, Any]) -> None:
    seen = said["looked_at"]
    click.echo(f"looked at    {seen['trials']} trials, {seen['successes']} succeed")
    if found is None:
        click.echo("not certified: there is no box in which nearly all trials are likely to succeed")
        return
    for each in said["tested"]:
        verdict = "passed" if each["passed"] else "failed"
        click.echo(f"tested       {each['trials']} fresh trials, {each['failures']} fail: {verdict}")
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
    if said["failed_trials"]:
        some = ", ".join(str(trial) for trial in said["failed_trials"][:8])
        click.echo(f"failed       trials {some}; to see one: skillframe campaign replay {found.place}/fresh TRIAL")


def said_value(name: str, value: float) -> str:
    """A value of a quantity as it could be typed, to four digits."""
    import re

    from skillframe.config.ranges import shown
    from skillframe.world.quantities import UNITS

    return re.sub(r"^-?[\d.]+(e-?\d+)?", lambda found: f"{float(found[0]):.4g}", shown(value, UNITS.get(name, "")))


def _edge(low: float, high: float, declared: list[float]) -> str:
    """That a box ends where the declared range does: the border lies beyond."""
    near = 1e-9 * (declared[1] - declared[0])
    ends = [word for word, gap in (("low", low - declared[0]), ("high", declared[1] - high)) if gap <= near]
    return f" (reaches the {' and the '.join(ends)} end of what was declared)" if ends else ""


@click.command()
@click.argument("folder", type=_PATH)
@click.option("--replays", default=3, show_default=True, type=NATURAL, help="Fresh trials to run again, bit by bit.")
def check(folder: Path, replays: int) -> int:
    """Check the certificate in FOLDER: hashes, figures, and some of its trials run again.

    Exit code 0 if everything fits, 1 if not.

    \b
    Example:
      skillframe campaign check certified --replays 5
    """
    from skillframe.campaign import evaluate
    from skillframe.campaign.claims import procedure
    from skillframe.campaign.claims.certificate import CERTIFICATE, check_certificate
    from skillframe.campaign.claims.plan import PLAN
    from skillframe.campaign.claims.searches import check_plan, other_methods
    from skillframe.campaign.replay import replay_trial

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
