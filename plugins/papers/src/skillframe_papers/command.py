"""`skillframe reproduce`: published results, recomputed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from signal import Signals
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import COUNT, SEED, note, terminable

if TYPE_CHECKING:
    from skillframe_papers.runner import Outcome


@click.command(name="reproduce")
@click.argument("rows", nargs=-1, metavar="[ROW]...")
@click.option("--out", type=click.Path(path_type=Path), default=Path("reproduce"), show_default=True,
              help="Folder for rows, reproduce.json, reproduce.html and reproduce.md.")  # fmt: skip
@click.option("--quick", is_flag=True, help="Fewer trials: all rows in less than three minutes on two cores.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change a row's setting.")
@click.option("--seed", default=0, show_default=True, type=SEED, help="Seed of everything random.")
@click.option("--workers", type=COUNT, help="Rows at a time [number of cores].")
@click.option("--fresh", is_flag=True, help="Compute rows again that OUT holds already.")
@click.option("--list", "only_list", is_flag=True, help="List rows and their settings, compute nothing.")
@click.option("--json", "as_json", is_flag=True, help="The table as JSON on stdout.")
def command(
    rows: tuple[str, ...], out: Path, quick: bool, settings: tuple[str, ...], seed: int, workers: int | None,
    fresh: bool, only_list: bool, as_json: bool,
) -> int:  # fmt: skip
    """Compute published results (all of them, or each ROW) and show them beside the published figures.

    Rows that OUT holds already, computed with the same settings, are kept; Ctrl-C and SIGTERM keep what is done. Exit
    code 0 if every verdict is the one in the docs, 1 if one has changed, 130 after Ctrl-C, 143 after SIGTERM.

    \b
    Example:
      skillframe reproduce --quick --out reproduce
      skillframe reproduce 2 --set world.friction=0.3 --out rougher
    """
    from skillframe.config import parse_setting
    from skillframe.extend import registry
    from skillframe_papers.jobs import jobs_of
    from skillframe_papers.runner import run

    changed = dict(parse_setting(text) for text in settings)
    jobs = jobs_of(registry(), rows, changed, seed=seed, quick=quick)
    if only_list:
        return _list([registry().row(job.row) for job in jobs], as_json)
    with terminable() as code:
        outcome = run(jobs, out, workers=workers or os.cpu_count() or 1, fresh=fresh, tell=note)
    from skillframe.files import write_whole
    from skillframe_papers import document, page, store

    store.write_table(out, outcome.entries)
    write_whole(out / "reproduce.html", page.render(outcome.entries).encode())
    write_whole(out / "reproduce.md", document.render(outcome.entries).encode())
    return _end(outcome, out, quick, as_json, code())


def _list(rows: Sequence[Any], as_json: bool) -> int:
    from skillframe.cli import PAGE_WIDTH, emit_json, table

    keys = ("summary", "published", "source", "bar", "frozen", "calibrated", "weak")
    found = [{"row": r.name, **{k: getattr(r, k) for k in keys}, "settings": dict(r.settings)} for r in rows]
    if as_json:
        emit_json(found)
    else:
        lines = [
            (
                f["row"],
                f["summary"],
                f["published"],
                ", ".join(f"{key}={value}" for key, value in f["settings"].items()),
            )
            for f in found
        ]
        table(("row", "what", "published", "settings"), lines, PAGE_WIDTH)
    return 0


def _end(outcome: Outcome, out: Path, quick: bool, as_json: bool, interrupted: int) -> int:
    from skillframe_papers import committed

    changed = committed.changes(outcome.entries, committed.verdicts(quick=quick))
    _show(outcome.entries, as_json)
    note(f"table: {out / 'reproduce.json'}, page: {out / 'reproduce.html'}")
    for sentence in changed:
        click.echo(f"changed: {sentence}", err=True)
    if outcome.interrupted:
        done = ", ".join(each["row"] for each in outcome.entries) or "none yet"
        name = Signals(interrupted - 128).name
        kept = f"ended by {name}; finished rows are kept in {out} ({done}), the same command goes on from there"
        click.echo(kept, err=True)
        return interrupted
    if outcome.broken:
        raise RuntimeError("; ".join(outcome.broken))
    if outcome.refused:
        from skillframe_papers.runner import RowFailed

        raise RowFailed("; ".join(outcome.refused))
    return 1 if changed else 0


def _show(entries: Sequence[Mapping[str, Any]], as_json: bool) -> None:
    from skillframe.cli import PAGE_WIDTH, emit_json, table
    from skillframe_papers import store
    from skillframe_papers.bars import with_intervals

    if as_json:
        emit_json(store.table(entries))
        return
    columns = ("row", "summary", "published", "ours", "verdict", "values_are", "wall_s")
    head = ("row", "what", "published", "ours", "verdict", "values", "wall [s]")
    shown = [{**each, "ours": with_intervals(each["ours"])} for each in entries]
    table(head, [[each[c] for c in columns] for each in shown], PAGE_WIDTH)
