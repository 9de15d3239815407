"""`skillframe learn`: a skill file from demonstrations of one phase."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import names
from skillframe.cli.endings import SKILL
from skillframe.cli.output import emit_json, warned
from skillframe.cli.words import tell

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration

OF_ONE_PHASE = "lmc"
"""The kind of skill that is one motion; those that play a motion back can hold a whole task."""
CUT = "next: cut the demonstrations into phases, as the note says"


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=SKILL, help="Skill file to write (.json).")
@click.option("--skill", default="lmc", show_default=True, shell_complete=names.skills, help="Kind of skill to learn.")
@click.option(
    "--at", help='Where it is learned: a frame\'s name or "x,y,z" [m] in the tool frame; default: tool point.'
)
@click.option("--hand", help="Where the hand held, for the work of torques; default: the recording's own, else --at.")
@click.option(
    "--axes", type=click.Choice(["base", "phase_start"]), default="base", show_default=True,
    help="Axes of what is learned: base, or the tool's attitude at the start of the phase.",
)  # fmt: skip
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A setting of the learner (skillframe plugins show lmc lists them; repeatable).",
)
@click.option(
    "--exception", shell_complete=names.skills,
    help="Kind of skill that searches where the learned one stalls: search, spiral, or a plug-in's.",
)  # fmt: skip
@click.option(
    "--blind", multiple=True, type=click.Path(path_type=Path),
    help="A recorded blind search, to learn that of --exception from (repeatable).",
)  # fmt: skip
@click.option("--leave-one-out", is_flag=True, help="Say what each demonstration contributes, and which contradicts.")
@click.option("--verbose", is_flag=True, help="Tell the evidence as well, as skill show does.")
@click.option("--json", "as_json", is_flag=True, help="Print the skill document as JSON on stdout as well.")
def command(
    files: tuple[Path, ...], out: Path, skill: str, at: str | None, hand: str | None, axes: str,
    settings: tuple[str, ...], exception: str | None, blind: tuple[Path, ...], leave_one_out: bool,
    verbose: bool, as_json: bool,
) -> int:  # fmt: skip
    """Learn a skill from FILES, demonstrations of one phase, and say what was learned, how sure, and what to do next.

    Two demonstrations from different sides tell more than one: if they leave the direction open, this says so.

    \b
    Examples:
      skillframe learn demo1.npz demo2.npz --out slide.skill.json
      skillframe learn left.csv right.csv --at wrist --out peg.skill.json
      skillframe learn demo.npz --axes phase_start --set moving_m=0.002 --out snap.skill.json
      skillframe learn demo1.npz demo2.npz --exception search --set shift=0.001 --out seat.skill.json
    """
    from skillframe.api.inputs import demonstrations_of
    from skillframe.api.learning import learn_with, seating
    from skillframe.config import parse_setting
    from skillframe.errors import InputError
    from skillframe.extend.records import LearnOptions
    from skillframe.extend.registry import registry

    options = LearnOptions(at=at, hand=hand, axes=axes, settings=dict(parse_setting(text) for text in settings))
    registry().behaviour(skill)  # an unknown one is told before any file is read
    kind = skill
    if exception is not None:
        kind, options = seating(skill, exception, blind, options)
    elif blind:
        raise InputError("--blind", "is for the search of --exception", "give --exception search as well")
    demonstrations = demonstrations_of(files)
    told: list[str] = []
    with warned():
        learned = learn_with(demonstrations, kind, options)
    if leave_one_out:
        from skillframe.api.left_out import left_out

        told = left_out(learned, demonstrations, registry().behaviour(kind), options)
    learned.save(out)
    what, *more = learned.summary
    if kind == OF_ONE_PHASE and _point_to_segment(demonstrations):
        more = [CUT if line.startswith("next: ") else line for line in more]
    evidence = learned.words[1:] if verbose and learned.words != learned.summary else []
    tell([f"{out}: {what}", *more, *evidence, *told], err=as_json)
    if as_json:
        emit_json(learned.document)
    return 0


def _point_to_segment(demonstrations: Sequence[Demonstration]) -> bool:
    """One note where most demonstrations look like several phases: one motion would have to explain all of them.

    Gives whether there is one.
    """
    from skillframe.conditioning.audit import audit
    from skillframe.conditioning.contact import Contact
    from skillframe.conditioning.phases import several_phases

    said = [several_phases(d, [Contact(*c) for c in audit(d).contacts]) for d in demonstrations]
    odd = [(d.source, text) for d, text in zip(demonstrations, said, strict=True) if text]
    several = 2 * len(odd) > len(said)
    if several:
        files = shlex.join(d.source for d in demonstrations)
        others = f" (and {len(odd) - 1} more)" if len(odd) > 1 else ""
        click.echo(
            f"note: {odd[0][0]}{others} looks like several phases: {odd[0][1]}; to learn each by itself, type: "
            f"skillframe segment {files} --out NAME.policy.json",
            err=True,
        )
    return several
