"""`skillframe certify map`, `find-failure` and `sensitivity`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import COUNT, emit_json, note, terminable
from skillframe_certify.commands.certify import engine_of, said_value, start

if TYPE_CHECKING:
    from skillframe_certify.engine import Engine, Say

_PATH = click.Path(path_type=Path)
Search = Callable[[Path, "Engine", "Say"], dict[str, Any]]


def _asking(function: Callable[..., int]) -> Callable[..., int]:
    options = [
        click.argument("source", type=_PATH),
        click.option("--out", type=_PATH, help="Folder for everything; absent or empty. Not given to go on."),
        click.option("--skill", help="Skill as in the campaign file, or its beginning [the first]."),
        click.option("--workers", type=COUNT, help="Worker processes on this machine [in-process]."),
        click.option("--json", "as_json", is_flag=True, help="The outcome as JSON alone on stdout."),
    ]
    for option in reversed(options):
        function = option(function)
    return function


@click.command(name="map")
@_asking
def map_(source: Path, out: Path | None, skill: str | None, workers: int | None, as_json: bool) -> int:
    """Find the border between success and failure in one to four ranges.

    SOURCE is a campaign.toml, whose ranges under [vary] are searched, or a folder of any certify command, which
    continues. Most trials are picked near the border, so no rate may be computed from them.

    \b
    Examples:
      skillframe certify map peg.toml --out border --workers 2
      skillframe certify run border --rate 0.95
    """
    from skillframe_certify.searches import map_border

    return _answer(source, out, skill, workers, as_json, "map", map_border, _tell_border)


@click.command(name="find-failure")
@_asking
def find_failure(source: Path, out: Path | None, skill: str | None, workers: int | None, as_json: bool) -> int:
    """Find a small disturbance that breaks a skill, and try it again with fresh noise.

    A disturbance is a point of the ranges under [vary]. Its size is its distance from the nominal point, with each
    quantity in half widths of its range. SOURCE is as for certify map, with up to six ranges.

    Exit code 0 if a disturbance was found and confirmed, 1 if none was.

    \b
    Example:
      skillframe certify find-failure peg.toml --out broken --workers 2
    """
    from skillframe_certify.searches import find_break

    return _answer(source, out, skill, workers, as_json, "find-failure", find_break, _tell_break)


@click.command()
@_asking
def sensitivity(source: Path, out: Path | None, skill: str | None, workers: int | None, as_json: bool) -> int:
    """Say which range matters, and the success rate with it fixed at its nominal value.

    Exploratory trials rank all quantities. The first two are tested with fresh trials, and the same trials with that
    quantity fixed. SOURCE is as for certify map.

    \b
    Example:
      skillframe certify sensitivity peg.toml --out matters --workers 2
    """
    from skillframe_certify.searches import rank

    return _answer(source, out, skill, workers, as_json, "sensitivity", rank, _tell_matter)


def _answer(
    source: Path, out: Path | None, skill: str | None, workers: int | None, as_json: bool, verb: str, search: Search,
    tell: Callable[[Path, dict[str, Any]], int],
) -> int:  # fmt: skip
    from skillframe_certify.question import LOOKS, mapped_question

    folder = source if out is None else out
    with terminable() as code:
        try:
            if out is not None:
                start(source, out, skill=skill, most=max(LOOKS) if verb == "find-failure" else None)
            elif verb != "find-failure":
                mapped_question(folder)
            with engine_of(folder, workers) as engine:
                _look(folder, engine)
                found = search(folder, engine, note)
        except KeyboardInterrupt:
            go_on = f"to go on: skillframe certify {verb} {folder}"
            click.echo(f"interrupted; what is done is kept, {go_on}", err=True)
            return code()
    if as_json:
        emit_json(found)
        return 0
    return tell(folder, found)


def _look(folder: Path, engine: Engine) -> None:
    from skillframe.cli import campaign_progress
    from skillframe_certify.procedure import look
    from skillframe_certify.question import LOOK
    from skillframe_certify.rounds import is_complete

    if is_complete(folder / LOOK, engine.params):
        return
    note("exploring where the skill works")
    with campaign_progress() as notify:
        look(folder, engine, notify)


def _tell_border(folder: Path, found: dict[str, Any]) -> int:
    alike = _alike(found["trials"], found["successes"])
    if alike:
        click.echo(f"border      none was met: {alike}")
    else:
        wrong = f"about {100.0 * found['doubt']:.2g} % of what works may be predicted wrong"
        click.echo(
            f"border      {'found' if found['settled'] else 'not settled'} after {found['trials']} trials; {wrong}"
        )
    click.echo(f"works       in {100.0 * found['share_that_works']:.3g} % of the declared ranges, as predicted")
    for name, (low, high) in found["reaches"].items():
        ends = [word for word, there in (("low", low), ("high", high)) if there]
        if ends:
            click.echo(f"reaches     the {' and the '.join(ends)} end of {name}: widen it to see the border there")
    idle = [name for name, index in found["index"].items() if index < 0.05]
    if idle and not alike:
        click.echo(f"no effect   of {', '.join(idle)} shows")
    click.echo(f"islands     smaller than {100.0 * found['smallest_island']:.2g} % of the ranges may have been missed")
    click.echo("no claim    these trials were picked; what may be claimed: skillframe certify run " + str(folder))
    return 0


def _tell_break(folder: Path, found: dict[str, Any]) -> int:
    fresh = found["fresh_trials"]
    if not found["confirmed"]:
        none = "no trial failed" if not found["confirmations"] else "no failure came again with fresh noise"
        click.echo(f"unbroken    in {found['trials']} trials over the declared ranges: {none}")
        return 1
    if found["undisturbed_failures"] > fresh // 2:
        click.echo(f"broken      without any disturbance: {found['undisturbed_failures']} of {fresh} trials fail there")
        return 0
    again = found["confirmations"][-1]
    click.echo(f"smallest disturbance found in {found['trials']} trials: {found['size']:.2f} of the half ranges, where")
    for name, value in found["point"].items():
        click.echo(f"              {name} is {said_value(name, value)}")
    click.echo(f"confirmed   {again} of {fresh} trials with fresh noise fail there")
    click.echo(f"to see one  skillframe campaign replay {folder}/confirm/{found['round']} 0")
    return 0


def _alike(trials: int, successes: int) -> str:
    if successes == trials:
        return f"all {trials} trials succeed; widen the ranges until some fail"
    if not successes:
        return f"all {trials} trials fail; narrow the ranges until some succeed"
    return ""


def _tell_matter(folder: Path, found: dict[str, Any]) -> int:
    seen = found["looked_at"]
    alike = _alike(seen["trials"], seen["successes"])
    if alike:
        click.echo(f"nothing to rank: {alike}")
        return 0
    for name, index in sorted(found["index"].items(), key=lambda pair: -pair[1]):
        click.echo(f"{name:24} {index:.1f}" + ("  does nothing that shows" if index < 0.05 else ""))
    for each in found["held"]:
        before, after = (100.0 * each[key] / each["trials"] for key in ("before", "after"))
        low, high = (100.0 * end for end in each["change"])
        click.echo(
            f"with {each['name']} held at {said_value(each['name'], each['at'])}, success goes from {before:.0f} % to "
            f"{after:.0f} % ({low:+.0f} to {high:+.0f} points, 95 %; p = {each['p_value']:.2g})"
        )
    if not found["held"]:
        click.echo("no quantity changes what is predicted; there is nothing to hold")
    return 0
