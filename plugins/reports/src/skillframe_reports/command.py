"""`skillframe report`: one self-contained HTML file from campaign folders and traces."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.cli import PAGE


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR|TRACE...")
@click.option("--out", required=True, type=PAGE, help="The HTML file to write.")
@click.option("--watch", is_flag=True, help="Make the page anew while a campaign runs, until it has ended.")
@click.option("--json", "as_json", is_flag=True, help="What was written, and of what, as JSON on stdout.")
def command(inputs: tuple[Path, ...], out: Path, watch: bool, as_json: bool) -> int:
    """Make a report from campaign folders, trace files, or both: one HTML file that needs nothing else.

    \b
    It shows what was learned, the runs (with a 3-D replay to scrub), where the
    skill works, what went wrong, and how to repeat it. The page says what a
    folder lacks. A certificate is recomputed from its trials.

    \b
    Exit code 0, or 1 if a certificate does not follow from its trials.

    \b
    Example:
      skillframe report results/peg --out peg.html
      skillframe report run1.npz run2.npz --out runs.html
      skillframe report results/peg --out peg.html --watch
    """
    from skillframe.cli import emit_json, note, terminable
    from skillframe_reports.page import anchor_of, write_chapters
    from skillframe_reports.sources import read_chapters, scenes

    code = 0
    if watch:
        from skillframe_reports.watch import watch_report

        with terminable() as interrupted:
            try:
                watch_report(inputs, out, note)
            except KeyboardInterrupt:
                kept = f"stopped watching; {out} keeps what is there now, and the campaign goes on by itself"
                click.echo(kept, err=True)
                code = interrupted()
    chapters = read_chapters(inputs)
    size, seen = write_chapters(chapters, out), [scenes(chapter) for chapter in chapters]
    first = [(each.kind.title.lower(), each.content) for each in chapters if each.kind is not None]
    wrong = [(name, asked.folder, text) for name, asked in first for text in asked.wrong]
    for name, folder, text in wrong:
        click.echo(f"{folder}: the {name} does not follow from its trials: {text}", err=True)
    code = code or int(bool(wrong))
    if as_json:
        told = [
            {"name": chapter.name, "scenes": [{"robot": robot, "world": world} for robot, world in where]}
            for chapter, where in zip(chapters, seen, strict=True)
        ]
        emit_json({"file": str(out), "bytes": size, "chapters": told})
        return code
    places = dict.fromkeys(f"{robot} in {world}" for where in seen for robot, world in where)
    click.echo(f"{out} ({size / 1e6:.1f} MB)" + (f": {', '.join(places)}" if places else ""))
    for name, _ in first[:1]:
        click.echo(f"{name}: {out}#{anchor_of(name, 1)}")
    return code
