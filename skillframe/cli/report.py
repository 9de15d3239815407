"""`skillframe report`: one self-contained HTML file from campaign folders and traces."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli.endings import PAGE
from skillframe.cli.output import quiet_option


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR|TRACE...")
@click.option("--out", required=True, type=PAGE, help="The HTML file to write.")
@click.option("--json", "as_json", is_flag=True, help="What was written, and of what, as JSON on stdout.")
@quiet_option
def command(inputs: tuple[Path, ...], out: Path, as_json: bool) -> None:
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
    from skillframe.cli.output import emit_json
    from skillframe.reports.page import write_chapters
    from skillframe.reports.sources import read_chapters, scenes

    chapters = read_chapters(inputs)
    size, seen = write_chapters(chapters, out), [scenes(chapter) for chapter in chapters]
    if as_json:
        told = [
            {"name": chapter.name, "scenes": [{"robot": robot, "world": world} for robot, world in where]}
            for chapter, where in zip(chapters, seen, strict=True)
        ]
        emit_json({"file": str(out), "bytes": size, "chapters": told})
        return
    places = dict.fromkeys(f"{robot} in {world}" for where in seen for robot, world in where)
    click.echo(f"{out} ({size / 1e6:.1f} MB)" + (f": {', '.join(places)}" if places else ""))
