"""`skillframe skill`: what a skill file holds, in words and in pictures."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli.endings import PAGE
from skillframe.cli.output import emit_json
from skillframe.cli.words import tell


@click.group()
def command() -> None:
    """Show and explain a learned skill.

    \b
    Example:
      skillframe skill show slide.skill.json
    """


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="The checked document and its words as JSON on stdout.")
def show(file: Path, as_json: bool) -> None:
    """Say what a skill does: "push along -z at 20 mm/s; free along x; turns freely about y".

    \b
    Example:
      skillframe skill show peg.skill.json
    """
    from skillframe.api.learning import LearnedSkill

    skill = LearnedSkill.load(file)
    document, words = skill.document, skill.words
    if as_json:
        emit_json({**document, "words": words})
        return
    tell(words)
    sources = ", ".join(source["file"] for source in document["learned_from"])
    made = _maker(document["created_by"])
    click.echo(f"learned from {sources or 'nothing'}; made by {made}")


def _maker(created_by: dict[str, str]) -> str:
    """In words: skillframe-lmc 0.2.0 with skillframe 0.2.0."""
    core, plugin = f"skillframe {created_by.get('skillframe', '')}".strip(), created_by.get("plugin")
    if plugin in (None, "skillframe"):
        return core
    return f"{plugin} {created_by.get('plugin_version', '')} with {core}"


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=PAGE, help="HTML file to write.")
def explain(file: Path, out: Path) -> None:
    """Draw why a skill is as it is: one self-contained HTML page.

    \b
    Example:
      skillframe skill explain peg.skill.json --out peg.html
    """
    from skillframe.api.learning import LearnedSkill

    count = LearnedSkill.load(file).explain(out)
    click.echo(f"{out}: {count} picture{'s' * (count != 1)}")
