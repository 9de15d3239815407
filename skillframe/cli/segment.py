"""`skillframe segment`: a policy of several phases from whole demonstrations."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from skillframe.cli.options import PAGE, SKILL, WHOLE, layout_option, segmenters, skills
from skillframe.cli.words import tell

ONE_FOUND = (
    "next: one phase was found, and no push in it; if the task has more phases, say how many (--phases 2), or draw the "
    "boundaries on the page that --page writes"
)


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=SKILL, help="Policy file to write (.json).")
@click.option("--page", type=PAGE, help="HTML file to write: drag a boundary there, and it gives the line.")
@click.option("--phases", type=WHOLE, help="Number of phases; default: it is found.")
@click.option(
    "--segmenter", default="wrench_hmm", show_default=True, shell_complete=segmenters,
    help="The plug-in that finds the phases.",
)  # fmt: skip
@click.option(
    "--skill", default="lmc", show_default=True, shell_complete=skills,
    help="Kind of skill that each phase is learned as.",
)  # fmt: skip
@click.option(
    "--set-boundary", "boundaries", multiple=True, metavar="DEMO:NUMBER=SECONDS",
    help="Move a boundary of a demonstration (both counted from 1, or a file's name) and refit (repeatable).",
)  # fmt: skip
@click.option(
    "--at", help='Where it is learned: a frame\'s name or "x,y,z" [m] in the tool frame; default: tool point.'
)
@click.option("--hand", help="Where the hand held, for the work of torques; default: the recording's own, else --at.")
@click.option(
    "--axes", type=click.Choice(["base", "phase_start"]), default="base", show_default=True,
    help="Axes of what is learned: base, or the tool's orientation at the start.",
)  # fmt: skip
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="A setting of segmenter or learner.")
@layout_option
def command(
    files: tuple[Path, ...], out: Path, page: Path | None, phases: int | None, segmenter: str, skill: str,
    boundaries: tuple[str, ...], at: str | None, hand: str | None, axes: str, settings: tuple[str, ...],
    layout: Path | None,
) -> int:  # fmt: skip
    """Cut FILES, demonstrations of a whole task, into phases, learn each phase, and write a policy.

    Phases that one motion explains get one label, so that sliding down either side of a valley is one phase. Where a
    boundary is not where it should be, move it: on the page that --page writes, or by --set-boundary.

    \b
    Examples:
      skillframe segment left.npz right.npz --out valley.policy.json
      skillframe segment a.csv b.csv c.csv --phases 3 --at tip --out box.policy.json
      skillframe segment left.npz right.npz --page cuts.html --out valley.policy.json
      skillframe segment left.npz right.npz --set-boundary 2:1=3.45 --out valley.policy.json
    """
    from skillframe.api.inputs import demonstrations_of
    from skillframe.api.learning import segment_with
    from skillframe.config import parse_setting
    from skillframe.extend.records import LearnOptions
    from skillframe.extend.registry import registry

    registry().segmenter(segmenter)  # refuse an unknown one before reading recordings
    if page is not None:
        registry().output("boundaries")
    values: dict[str, Any] = dict(parse_setting(text) for text in settings)
    values |= {"segmenter": segmenter, "skill": skill, "phases": phases, "set_boundary": list(boundaries)}
    demonstrations = demonstrations_of(files, layout)
    policy = segment_with(demonstrations, LearnOptions(at=at, hand=hand, axes=axes, settings=values))
    policy.save(out)
    count = len(policy.phases)
    made = f"{out}: {count} phase{'s' * (count != 1)} from {len(files)} demonstration{'s' * (len(files) != 1)}"
    parts = (part for phase in policy.phases for part in phase.values() if isinstance(part, dict))
    pushes = any(part.get("desired_direction") for part in parts)
    one = [ONE_FOUND] if count == 1 and phases is None and not pushes else []
    tell([made, *policy.words, *one])
    if page is not None:
        from skillframe.extend.outputs import Segmentation, no_progress

        cut = Segmentation(policy.document, policy.words, demonstrations, _line())
        registry().output("boundaries").write(cut, page, no_progress)
        click.echo(f"{page}: open it in a browser, drag a boundary, and run the line that it says")
    return 0


def _line() -> str:
    context = click.get_current_context()
    words = ["skillframe", "segment", *(str(file) for file in context.params["files"])]
    for option in context.command.params:
        typed = option.name and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE
        if not typed or not isinstance(option, click.Option) or option.name == "boundaries":
            continue
        value, name = context.params[option.name], max(option.opts, key=len)
        words += [word for each in (value if option.multiple else [value]) for word in (name, str(each))]
    return shlex.join(words)
