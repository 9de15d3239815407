"""`skillframe learn`: a skill file from demonstrations of one phase."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli.options import SKILL, layout_option, skills
from skillframe.cli.output import note, warned
from skillframe.cli.words import tell

if TYPE_CHECKING:
    from skillframe.demonstration.record import Demonstration

OF_ONE_PHASE = "lmc"
"""Kind of skill that is one motion; others can replay a whole task."""
CUT = "next: cut the demonstrations into phases, as the note says"


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=SKILL, help="Skill file to write (.json).")
@click.option("--skill", default="lmc", show_default=True, shell_complete=skills, help="Kind of skill to learn.")
@click.option(
    "--at", help='Where it is learned: a frame\'s name or "x,y,z" [m] in the tool frame; default: tool point.'
)
@click.option("--hand", help="Where the hand held, for the work of torques; default: the recording's own, else --at.")
@click.option(
    "--axes", type=click.Choice(["base", "phase_start"]), default="base", show_default=True,
    help="Axes of what is learned: base, or the tool's orientation at the start of the phase.",
)  # fmt: skip
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A setting of the learner (skillframe plugins lmc lists them; repeatable).",
)
@layout_option
@click.option("--leave-one-out", is_flag=True, help="Say what each demonstration contributes, and which contradicts.")
def command(
    files: tuple[Path, ...], out: Path, skill: str, at: str | None, hand: str | None, axes: str,
    settings: tuple[str, ...], layout: Path | None, leave_one_out: bool,
) -> int:  # fmt: skip
    """Learn a skill from FILES, demonstrations of one phase, and say what was learned, how sure, and what to do next.

    Demonstrations from different sides determine the direction; if it remains open, this says so. `skillframe show`
    adds the evidence.

    \b
    Examples:
      skillframe learn demo1.npz demo2.npz --out slide.skill.json
      skillframe learn left.csv right.csv --at wrist --out peg.skill.json
      skillframe learn log1.csv log2.csv --layout layout.toml --out slide.skill.json
      skillframe learn demo.npz --axes phase_start --set moving_m=0.002 --out snap.skill.json
      skillframe learn demo1.npz demo2.npz --skill seat --set shift=0.001 --out seat.skill.json
    """
    from skillframe.api.inputs import demonstrations_of
    from skillframe.api.learning import learn_with
    from skillframe.config import parse_setting
    from skillframe.extend.records import LearnOptions
    from skillframe.extend.registry import registry

    options = LearnOptions(at=at, hand=hand, axes=axes, settings=dict(parse_setting(text) for text in settings))
    registry().behaviour(skill)  # refuse an unknown one before reading files
    demonstrations = demonstrations_of(files, layout)
    if missing := registry().absence("audit", "recordings"):
        note(f"note: demonstrations are not checked for errors; {missing}")
    told: list[str] = []
    with warned():
        learned = learn_with(demonstrations, skill, options)
    if leave_one_out:
        from skillframe.api.leave_one_out import left_out

        told = left_out(learned, demonstrations, registry().behaviour(skill), options)
    learned.save(out)
    what, *more = learned.summary
    if skill == OF_ONE_PHASE and _point_to_segment(demonstrations):
        more = [CUT if line.startswith("next: ") else line for line in more]
    tell([f"{out}: {what}", *more, *told])
    return 0


def _point_to_segment(demonstrations: Sequence[Demonstration]) -> bool:
    """Print a note if most demonstrations look like several phases. Returns whether it did."""
    from skillframe.demonstration.contact import contact_evidence
    from skillframe.demonstration.phases import several_phases

    said = [several_phases(d, contact_evidence(d).contacts) for d in demonstrations]
    odd = [(d.source, text) for d, text in zip(demonstrations, said, strict=True) if text]
    several = 2 * len(odd) > len(said)
    if several:
        files = shlex.join(d.source for d in demonstrations)
        others = f" (and {len(odd) - 1} more)" if len(odd) > 1 else ""
        click.echo(
            f"note: {odd[0][0]}{others} has probably several phases: {odd[0][1]}; to learn each by itself, type: "
            f"skillframe segment {files} --out NAME.policy.json",
            err=True,
        )
    return several
