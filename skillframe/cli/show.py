"""`skillframe show`: the content of a skill file, in words and in pictures."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli.options import PAGE
from skillframe.cli.output import emit_json
from skillframe.cli.words import tell


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--page", type=PAGE, help="HTML file to write: why the skill is as it is, in pictures.")
@click.option("--json", "as_json", is_flag=True, help="The checked document and its words as JSON on stdout.")
def command(file: Path, page: Path | None, as_json: bool) -> None:
    """Show what a learned skill does: "push along -z at 20 mm/s; free along x; turns freely about y".

    \b
    Examples:
      skillframe show peg.skill.json
      skillframe show peg.skill.json --page peg.html
    """
    from skillframe.api.learning import LearnedSkill

    skill = LearnedSkill.load(file)
    document, words = skill.document, skill.words
    count = None if page is None else skill.explain(page)
    if as_json:
        emit_json({**document, "words": words})
    else:
        tell(words)
        sources = ", ".join(source["file"] for source in document["learned_from"])
        click.echo(f"learned from {sources or 'nothing'}; made by {_maker(document['created_by'])}")
    if count is not None:
        click.echo(f"{page}: {count} picture{'s' * (count != 1)}", err=as_json)


def _maker(created_by: dict[str, str]) -> str:
    core, plugin = f"skillframe {created_by.get('skillframe', '')}".strip(), created_by.get("plugin")
    if plugin in (None, "skillframe"):
        return core
    return f"{plugin} {created_by.get('plugin_version', '')} with {core}"
