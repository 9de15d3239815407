"""`skillframe report`: one self-contained HTML file from campaign folders and traces."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli.endings import PAGE


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR|TRACE...")
@click.option("--out", required=True, type=PAGE, help="The HTML file to write.")
def command(inputs: tuple[Path, ...], out: Path) -> None:
    """Make a report from campaign folders, trace files, or both: one HTML file that needs nothing else.

    \b
    It shows what was learned, the runs (with a 3-D replay to scrub), where the
    skill works, what went wrong, and how to repeat it. What a folder does not
    hold is said on the page.

    \b
    Example:
      skillframe report results/peg --out peg.html
      skillframe report run1.npz run2.npz --out runs.html
    """
    from skillframe.report.page import write_report

    size = write_report(inputs, out)
    click.echo(f"{out} ({size / 1e6:.1f} MB)")
