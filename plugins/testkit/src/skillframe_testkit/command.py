"""`skillframe plugins new` and `skillframe plugins check`."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli import emit_json, note
from skillframe.errors import UnknownName
from skillframe_testkit.template import EVERY, KINDS


@click.command()
@click.argument("name")
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), help="Folder to write (default: skillframe-NAME)."
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    default=("skill",),
    show_default=True,
    type=click.Choice([*KINDS, EVERY]),
    help="What it provides; repeat for several.",
)
def new(name: str, out: Path | None, kinds: tuple[str, ...]) -> None:
    """Write a working plug-in to start from, with its conformance tests.

    \b
    Example:
      skillframe plugins new my_skill --out my-skill
      skillframe plugins new my_lab --kind robot --kind world
      skillframe plugins new my_lab --kind all
    """
    from skillframe_testkit.template import plugin_name, write_template

    name = plugin_name(name)
    folder = out or Path(f"skillframe-{name.replace('_', '-')}")
    for path in write_template(name, folder, kinds):
        click.echo(path)
    note(f"next: pip install -e {folder} && skillframe plugins check {name}")


@click.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def check(names: tuple[str, ...], as_json: bool) -> int:
    """Run the conformance checks of the plug-ins named, or of all. Exits 1 if one fails.

    \b
    Example:
      skillframe plugins check
      skillframe plugins check my_skill --json
    """
    from skillframe.extend import registry
    from skillframe_testkit.checks import check_plugin

    known = registry()
    for name in names:
        if name not in {alias for plugin in known.plugins for alias in (plugin.name, plugin.distribution)}:
            raise UnknownName("plug-in", name, [plugin.name for plugin in known.plugins])
    chosen = [p for p in known.plugins if not names or p.name in names or p.distribution in names]
    results = [(plugin, check_plugin(known, plugin)) for plugin in chosen]
    if as_json:
        emit_json([
            {
                "name": plugin.name, "distribution": plugin.distribution, "version": plugin.version,
                "subject": finding.subject, "checked": finding.problems is not None,
                "problems": finding.problems or [], "warnings": finding.warnings,
            }
            for plugin, findings in results for finding in findings
        ])  # fmt: skip
    for plugin, findings in results if not as_json else ():
        click.echo(f"{plugin.name} ({plugin.distribution} {plugin.version})")
        for finding in findings:
            if finding.problems is not None:
                click.echo(f"  {finding.subject}: {'FAILS' if finding.problems else 'passes'}")
            for problem in finding.problems or []:
                click.echo(f"    - {problem}")
            for warning in finding.warnings:
                click.echo(f"    - warning: {warning}")
        for finding in findings:
            if finding.problems is None:
                click.echo(f"  {finding.subject}: there are no checks for this kind")
    return int(any(finding.problems for _, findings in results for finding in findings))
