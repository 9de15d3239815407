"""`skillframe skills`: which kinds of skill there are, to learn and to run."""

from __future__ import annotations

from textwrap import fill

import click

from skillframe.cli.output import LIST_WIDTH, emit_json, table


@click.group()
def command() -> None:
    """List kinds of skills. `skillframe skill` shows one that was learned.

    \b
    Example:
      skillframe skills list
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def list_(as_json: bool) -> None:
    """Kinds of skill that --skill takes and a skill file holds.

    \b
    Example:
      skillframe skills list --json
    """
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
