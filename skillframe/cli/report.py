"""`skillframe report`: one self-contained HTML file from campaign folders and traces."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli.endings import PAGE
from skillframe.cli.output import quiet_option


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR|TRACE...")
@click.option("--out", required=True, type=PAGE, help="The HTML file to write.")
@click.option("--watch", is_flag=True, help="Make the page anew while a campaign runs, until it has ended.")
@click.option("--json", "as_json", is_flag=True, help="What was written, and of what, as JSON on stdout.")
@quiet_option
def command(inputs: tuple[Path, ...], out: Path, watch: bool, as_json: bool) -> int:
    """Make a report from campaign folders, trace files, or both: one HTML file that needs nothing else.

    \b
    It shows what was learned, the runs (with a 3-D replay to scrub), where the
    skill works, what went wrong, and how to repeat it. What a folder does not
    hold is said on the page.

    \b
    Example:
      skillframe report results/peg --out peg.html
      skillframe report run1.npz run2.npz --out runs.html
      skillframe report results/peg --out peg.html --watch
    """
    from skillframe.cli.output import emit_json
    from skillframe.reports.page import write_chapters
    from skillframe.reports.sources import read_chapters, scenes

    code = _watched(inputs, out) if watch else 0
    chapters = read_chapters(inputs)
    size, seen = write_chapters(chapters, out), [scenes(chapter) for chapter in chapters]
    if as_json:
        told = [
            {"name": chapter.name, "scenes": [{"robot": robot, "world": world} for robot, world in where]}
            for chapter, where in zip(chapters, seen, strict=True)
        ]
        emit_json({"file": str(out), "bytes": size, "chapters": told})
        return code
    places = dict.fromkeys(f"{robot} in {world}" for where in seen for robot, world in where)
    click.echo(f"{out} ({size / 1e6:.1f} MB)" + (f": {', '.join(places)}" if places else ""))
    return code


def _watched(inputs: tuple[Path, ...], out: Path) -> int:
    """Keep the page up to date until every campaign has ended. Returns the exit code that is due if it was stopped."""
    from skillframe.cli.interrupts import terminable
    from skillframe.cli.output import note
    from skillframe.reports.watch import watch_report

    with terminable() as code:
        try:
            watch_report(inputs, out, note)
        except KeyboardInterrupt:
            click.echo(f"stopped watching; {out} keeps what is there now, and the campaign goes on by itself", err=True)
            return code()
    return 0
