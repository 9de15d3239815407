"""Listings: aligned columns for people, colours on a terminal only, and JSON alone on stdout for scripts."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from textwrap import wrap
from typing import Any

import click


def emit_json(value: Any) -> None:
    """Print a value as JSON, keys sorted; numbers that are not finite are a mistake of the caller."""
    click.echo(json.dumps(value, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False))


PAGE_WIDTH = 110
"""Columns of text that a page or an editor shows without breaking lines of its own accord."""


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], width: int | None = None) -> None:
    """Print rows under headings: a drawn table on a terminal, plain aligned columns in a pipe.

    Args:
        columns: headings.
        rows: cells.
        width: in a pipe, of the whole; what does not fit goes on below in its own column. None: a line per row.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    if sys.stdout.isatty():
        _drawn(columns, texts)
        return
    natural = [max(len(line[i]) for line in [columns, *texts]) for i in range(len(columns))]
    widths = natural if width is None else _narrowed(natural, width - 2 * (len(columns) - 1))
    for i, line in enumerate([columns, *texts]):
        if i > 1 and widths != natural:
            click.echo()  # rows of several lines are told apart by an empty one
        cells = [wrap(cell, at) if len(cell) > at else [cell] for cell, at in zip(line, widths, strict=True)]
        for parts in zip_longest(*cells, fillvalue=""):
            click.echo("  ".join(part.ljust(at) for part, at in zip(parts, widths, strict=True)).rstrip())


def _narrowed(natural: Sequence[int], room: int) -> list[int]:
    """Widths that share a room: as wide as they are, but none above a cap that makes them fit."""
    cap = next((c for c in range(max(natural), 0, -1) if sum(min(c, n) for n in natural) <= room), 1)
    return [min(cap, n) for n in natural]


@contextmanager
def progress(what: str, after_s: float = 0.0) -> Iterator[Callable[[float, float], None]]:
    """A function of how many of how many are done: a bar on a terminal, a line per tenth in a pipe; both on stderr.

    Work that is over within `after_s` shows nothing in a pipe.
    """
    if not sys.stderr.isatty():
        yield _tenths(what, time.monotonic() + after_s)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _tenths(what: str, earliest: float) -> Callable[[float, float], None]:
    shown = -1

    def show(done: float, total: float) -> None:
        nonlocal shown
        if int(10 * done / total) != shown and time.monotonic() >= earliest:
            shown = int(10 * done / total)
            click.echo(f"{done:g} of {total:g} {what}", err=True)

    return show


def _drawn(columns: Sequence[str], texts: Sequence[Sequence[str]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    drawn = Table(*columns, box=box.SIMPLE_HEAD, header_style="bold")
    for line in texts:
        drawn.add_row(*(Text(cell) for cell in line))
    Console().print(drawn)
