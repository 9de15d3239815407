"""Listings: aligned columns for people, colours on a terminal only, and JSON alone on stdout for scripts."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from textwrap import wrap
from typing import Any, TypeVar

import click


def emit_json(value: Any) -> None:
    """Print a value as JSON, keys sorted. Numbers that are not finite are a mistake of the caller."""
    click.echo(json.dumps(value, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False))


_F = TypeVar("_F", bound=Callable[..., Any])
QUIET = "skillframe.quiet"


def quiet_option(function: _F) -> _F:
    """`-q`: no progress and no notes. See `is_quiet`."""
    option = click.option(
        "-q", "--quiet", is_flag=True, expose_value=False, callback=_silence,
        help="No progress and no notes on stderr; warnings and errors stay.",
    )  # fmt: skip
    return option(function)


def _silence(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    ctx.meta[QUIET] = value


def is_quiet() -> bool:
    """Was the command that runs told to be quiet?"""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(QUIET, False))


def note(text: str) -> None:
    """A line on stderr that is not needed. `-q` leaves it out."""
    if not is_quiet():
        click.echo(text, err=True)


@contextmanager
def warned() -> Iterator[None]:
    """Within this, warnings of the API are lines on stderr, which `-q` leaves as they are."""
    from skillframe.errors import SkillframeWarning

    with warnings.catch_warnings():
        other = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
            if issubclass(category, SkillframeWarning):
                click.echo(f"warning: {message}", err=True)
            else:
                other(message, category, *rest, **more)

        warnings.simplefilter("always", SkillframeWarning)
        warnings.showwarning = show
        yield


GAP = 2  # columns of blanks between the columns of a table
LIST_WIDTH = 80
"""Columns that a listing keeps in a pipe, too: a terminal's as it opens."""
PAGE_WIDTH = 110
"""Columns of text that a page or an editor shows without breaking lines."""


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], width: int | None = None) -> None:
    """Print rows under headings: as wide as a terminal, and in a pipe a line per row.

    Args:
        columns: headings.
        rows: cells.
        width: of the whole in a pipe; None: as wide as it is.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    terminal = sys.stdout.isatty()
    room = shutil.get_terminal_size().columns if terminal else width
    for number, line in enumerate(laid_out(columns, texts, room)):
        click.echo(bold(line) if number == 0 else line)


def bold(text: str) -> str:
    """A text in bold on a terminal, unless NO_COLOR is set, else as it is."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not sys.stdout.isatty()
    return text if plain else click.style(text, bold=True)


def laid_out(columns: Sequence[str], texts: Sequence[Sequence[str]], width: int | None) -> Iterator[str]:
    """The lines of a table within a width. No word is ever broken.

    What does not fit goes on below in its own column, with an empty line between rows; where the columns' longest words
    do not fit side by side, each cell has a line, behind its heading.
    """
    whole = [columns, *texts]
    natural = [max(len(line[i]) for line in whole) for i in range(len(columns))]
    least = [max(len(word) for line in whole for word in [*line[i].split(), ""]) for i in range(len(columns))]
    room = None if width is None else width - GAP * (len(columns) - 1)
    if room is not None and sum(least) > room:
        yield from _paragraphs(columns, texts, width or 0)
        return
    widths = natural if room is None else _narrowed(natural, least, room)
    for i, line in enumerate(whole):
        if i > 1 and widths != natural:
            yield ""
        cells = [_wrapped(cell, at) if len(cell) > at else [cell] for cell, at in zip(line, widths, strict=True)]
        for parts in zip_longest(*cells, fillvalue=""):
            yield (GAP * " ").join(part.ljust(at) for part, at in zip(parts, widths, strict=True)).rstrip()


def _narrowed(natural: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Widths that share a room: as wide as they are, but none above a cap that makes them fit, nor below its least."""

    def capped(cap: int) -> list[int]:
        return [max(low, min(cap, n)) for n, low in zip(natural, least, strict=True)]

    return next((widths for c in range(max(natural), 0, -1) if sum(widths := capped(c)) <= room), list(least))


def _wrapped(text: str, width: int) -> list[str]:
    return wrap(text, width, break_long_words=False, break_on_hyphens=False)


def _paragraphs(columns: Sequence[str], texts: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Rows one below the other, each cell behind its heading."""
    yield ", ".join(columns)
    for line in texts:
        yield ""
        for heading, cell in zip(columns, line, strict=True):
            yield from _wrapped(f"{heading}: {cell}", width)


@contextmanager
def progress(what: str, after_s: float = 0.0) -> Iterator[Callable[[float, float], None]]:
    """A function of how many of how many are done: a bar on a terminal, a line per tenth in a pipe, on stderr.

    Work that is over within `after_s` shows nothing in a pipe.
    """
    if is_quiet():
        yield lambda done, total: None
        return
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
