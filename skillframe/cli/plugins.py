"""`skillframe plugins`: list what is installed, check it against the contract, and start a new one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.output import emit_json, table
from skillframe.errors import UnknownName

if TYPE_CHECKING:
    from skillframe.conformance import Finding
    from skillframe.registry import Plugin, Registry


@click.group()
def command() -> None:
    """List, check and start plug-ins.

    \b
    Example:
      skillframe plugins list
      skillframe plugins new my_skill
      skillframe plugins check my_skill
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def list_(as_json: bool) -> None:
    """List installed plug-ins: what each provides, and its error if it has one.

    \b
    Example:
      skillframe plugins list --json
    """
    from skillframe.registry import registry

    known = registry()
    rows = distribution_rows(known)
    if as_json:
        emit_json(rows)
    else:
        columns = ("name", "distribution", "version", "provides", "error")
        table(
            columns,
            [[r["name"], r["distribution"], r["version"], " ".join(r["provides"]), r["error"] or ""] for r in rows],
        )
    for name in known.not_installed:
        click.echo(f"SKILLFRAME_PLUGINS asks for {name!r}, which is not installed", err=True)
    if known.unselected:
        click.echo(f"SKILLFRAME_PLUGINS leaves out {', '.join(known.unselected)}", err=True)


def distribution_rows(registry: Registry) -> list[dict[str, Any]]:
    """A row per distribution; a distribution with several plug-ins lists them together."""
    rows: dict[str, dict[str, Any]] = {}
    for plugin in registry.plugins:
        row = rows.setdefault(
            plugin.distribution,
            {"name": "", "distribution": plugin.distribution, "version": plugin.version, "provides": [], "error": None},
        )
        row["name"] = f"{row['name']},{plugin.name}" if row["name"] else plugin.name
        row["provides"] += plugin.provides
        row["error"] = "; ".join(error for error in (row["error"], plugin.error) if error) or None
    return list(rows.values())


@command.command()
@click.argument("name")
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), help="Folder to write (default: skillframe-NAME)."
)
def new(name: str, out: Path | None) -> None:
    """Write a working plug-in to start from: one skill, with its conformance tests.

    \b
    Example:
      skillframe plugins new my_skill --out my-skill
    """
    from skillframe.cli.template import plugin_name, write_template

    name = plugin_name(name)
    folder = out or Path(f"skillframe-{name.replace('_', '-')}")
    for path in write_template(name, folder):
        click.echo(path)
    click.echo(f"next: pip install -e {folder} && skillframe plugins check {name}", err=True)


@command.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def check(names: tuple[str, ...], as_json: bool) -> int:
    """Run the conformance checks of installed plug-ins; all of them unless named. Exits 1 if one fails.

    \b
    Example:
      skillframe plugins check
      skillframe plugins check my_skill --json
    """
    from skillframe.conformance import check_plugin
    from skillframe.registry import registry

    known = registry()
    results = [(plugin, check_plugin(known, plugin)) for plugin in _chosen(known, names)]
    if as_json:
        emit_json([_check_row(plugin, finding) for plugin, findings in results for finding in findings])
    else:
        for plugin, findings in results:
            _say(plugin, findings)
    return int(any(finding.problems for _, findings in results for finding in findings))


def _chosen(registry: Registry, names: tuple[str, ...]) -> list[Plugin]:
    """Plug-ins by their own name or their distribution's, in the order of loading."""
    known = {alias for plugin in registry.plugins for alias in (plugin.name, plugin.distribution)}
    for name in names:
        if name not in known:
            raise UnknownName("plug-in", name, [plugin.name for plugin in registry.plugins])
    return [p for p in registry.plugins if not names or p.name in names or p.distribution in names]


def _check_row(plugin: Plugin, finding: Finding) -> dict[str, Any]:
    return {
        "name": plugin.name,
        "distribution": plugin.distribution,
        "version": plugin.version,
        "subject": finding.subject,
        "checked": finding.problems is not None,
        "problems": finding.problems or [],
    }


def _say(plugin: Plugin, findings: list[Finding]) -> None:
    click.echo(f"{plugin.name} ({plugin.distribution} {plugin.version})")
    for finding in findings:
        verdict = "no checks for this kind" if finding.problems is None else "FAILS" if finding.problems else "passes"
        click.echo(f"  {finding.subject}: {verdict}")
        for problem in finding.problems or []:
            click.echo(f"    - {problem}")
