"""`skillframe skills`: kinds of skill, to learn and to run."""

from __future__ import annotations

from textwrap import fill

import click

from skillframe.cli.options import skills
from skillframe.cli.output import LIST_WIDTH, emit_json, table


@click.command()
@click.argument("name", required=False, shell_complete=skills)
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(name: str | None, as_json: bool) -> None:
    """List the kinds of skill that --skill takes and a skill file holds, or show one with its origin and settings.

    `skillframe show` shows a skill that was learned.

    \b
    Examples:
      skillframe skills
      skillframe skills lmc
    """
    if name is None:
        _list(as_json)
        return
    from skillframe.cli.plugins import tell_record
    from skillframe.extend.records import CoordinatorType
    from skillframe.extend.registry import registry

    kind = "coordinator" if isinstance(registry().behaviour(name), CoordinatorType) else "skill"
    tell_record(f"{kind}:{name}", as_json)


def _list(as_json: bool) -> None:
    from skillframe.cli.catalog import rows_of
    from skillframe.extend.homes import install_all
    from skillframe.extend.registry import registry

    known = registry()
    rows = [*rows_of(known, "skill"), *rows_of(known, "coordinator")]
    for row in rows:
        row["learns"] = known.behaviour(row["name"]).learn is not None
    if as_json:
        emit_json(rows)
    elif not rows:
        left_out = f"SKILLFRAME_PLUGINS leaves out {', '.join(known.unselected)}" if known.unselected else ""
        click.echo(fill(left_out, LIST_WIDTH) or f"no kind of skill is installed; type: {install_all()}")
    else:
        lines = [(r["name"], "yes" if r["learns"] else "no", r["summary"], r["distribution"]) for r in rows]
        table(("skill", "learns", "what it is", "from"), lines, LIST_WIDTH)
