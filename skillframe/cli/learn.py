"""`skillframe learn`: a skill file from demonstrations of one phase."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli import names
from skillframe.cli.endings import SKILL
from skillframe.cli.output import emit_json, warned
from skillframe.cli.words import tell


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
@click.option("--json", "as_json", is_flag=True, help="Print the skill document as JSON on stdout as well.")
def command(
    files: tuple[Path, ...], out: Path, skill: str, at: str | None, hand: str | None, axes: str,
    settings: tuple[str, ...], as_json: bool,
) -> int:  # fmt: skip
    """Learn a skill from FILES, demonstrations of one phase, and say in words what was learned.

    Two demonstrations from different sides tell more than one: if they leave the direction open, this says so.

    \b
    Examples:
      skillframe learn demo1.npz demo2.npz --out slide.skill.json
      skillframe learn left.csv right.csv --at wrist --out peg.skill.json
      skillframe learn demo.npz --axes phase_start --set moving_m=0.002 --out snap.skill.json
    """
    from skillframe.api.learning import learn_with
    from skillframe.config import parse_setting
    from skillframe.extend.records import LearnOptions

    options = LearnOptions(at=at, hand=hand, axes=axes, settings=dict(parse_setting(text) for text in settings))
    with warned():
        learned = learn_with(files, skill, options)
    learned.save(out)
    made = f"{out}: {learned.type} from {len(files)} demonstration{'s' * (len(files) != 1)}"
    tell([made, *learned.words], err=as_json)
    if as_json:
        emit_json(learned.document)
    return 0
