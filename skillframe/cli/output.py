"""Output of commands: aligned columns, colours on a terminal only, JSON alone on stdout for scripts, and progress.

SIGTERM ends as Ctrl-C a command that keeps what it has finished.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from textwrap import wrap
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from skillframe.campaign.runner import Progress


def emit_json(value: Any) -> None:
    """Print a value as JSON with sorted keys. Numbers must be finite."""
    import json

    click.echo(json.dumps(value, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False))


_F = TypeVar("_F", bound=Callable[..., Any])
QUIET = "skillframe.quiet"


def quiet_option(function: _F) -> _F:
    """`-q`: no progress and no notes. See `is_quiet`."""
    option = click.option(
        "-q", "--quiet", is_flag=True, expose_value=False,
        callback=lambda ctx, _, value: ctx.meta.update({QUIET: value}),
        help="No progress and no notes on stderr; warnings and errors stay.",
    )  # fmt: skip
    return option(function)


def is_quiet() -> bool:
    """Whether the running command has `-q`."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(QUIET, False))


def note(text: str) -> None:
    """Print an optional line on stderr, which `-q` leaves out."""
    if not is_quiet():
        click.echo(text, err=True)


@contextmanager
def warned() -> Iterator[None]:
    """While open, warnings of the API are lines on stderr, also with `-q`."""
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


GAP = 2  # blanks between the columns of a table
LIST_WIDTH = 80
"""Width of a listing in a pipe, that of a new terminal."""
PAGE_WIDTH = 110
"""Width of text in pages and editors."""


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], width: int | None = None) -> None:
    """Print rows under headings: as wide as a terminal, and in a pipe a line per row.

    Args:
        columns: headings.
        rows: cells.
        width: of the whole in a pipe; None: as wide as needed.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    terminal = sys.stdout.isatty()
    room = shutil.get_terminal_size().columns if terminal else width
    for number, line in enumerate(laid_out(columns, texts, room)):
        click.echo(bold(line) if number == 0 else line)


def bold(text: str) -> str:
    """A text in bold on a terminal, unless NO_COLOR is set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not sys.stdout.isatty()
    return text if plain else click.style(text, bold=True)


def laid_out(columns: Sequence[str], texts: Sequence[Sequence[str]], width: int | None) -> Iterator[str]:
    """The lines of a table within a width, without breaking words.

    Cells wrap in their own column, with an empty line between rows. If the columns' longest words do not fit side by
    side, each cell has a line, behind its heading.
    """
    whole = [columns, *texts]
    natural = [max(len(line[i]) for line in whole) for i in range(len(columns))]
    least = [max(len(word) for line in whole for word in [*line[i].split(), ""]) for i in range(len(columns))]
    room = None if width is None else width - GAP * (len(columns) - 1)
    if room is not None and sum(least) > room:
        yield ", ".join(columns)
        for line in texts:
            yield ""
            for heading, cell in zip(columns, line, strict=True):
                yield from _wrapped(f"{heading}: {cell}", width or 0)
        return
    widths = natural if room is None else _narrowed(natural, least, room)
    for i, line in enumerate(whole):
        if i > 1 and widths != natural:
            yield ""
        cells = [_wrapped(cell, at) if len(cell) > at else [cell] for cell, at in zip(line, widths, strict=True)]
        for parts in zip_longest(*cells, fillvalue=""):
            yield (GAP * " ").join(part.ljust(at) for part, at in zip(parts, widths, strict=True)).rstrip()


def _narrowed(natural: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Column widths that fit a room: capped at a common width, but not below the longest word."""

    def capped(cap: int) -> list[int]:
        return [max(low, min(cap, n)) for n, low in zip(natural, least, strict=True)]

    return next((widths for c in range(max(natural), 0, -1) if sum(widths := capped(c)) <= room), list(least))


def _wrapped(text: str, width: int) -> list[str]:
    return wrap(text, width, break_long_words=False, break_on_hyphens=False)


@contextmanager
def progress(what: str, after_s: float = 0.0) -> Iterator[Callable[[float, float], None]]:
    """Yields a function of the amounts done and in total: a bar on a terminal, a line per tenth in a pipe, on stderr.

    Work shorter than `after_s` shows nothing in a pipe.
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


@contextmanager
def campaign_progress() -> Iterator[Callable[[Progress], None]]:
    """A bar on a terminal, a line per tenth of the work in a pipe, both on stderr. With -q only unusual notes."""
    import sys

    if is_quiet():
        yield lambda progress: click.echo(progress.note, err=True) if progress.note and not progress.usual else None
        return
    if not sys.stderr.isatty():
        yield _lines()
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    with Bar(console=console, transient=True) as bar:
        task = bar.add_task("runs", total=None)

        def show(progress: Progress) -> None:
            bar.update(task, completed=progress.done + progress.under_way, total=progress.total)
            if progress.note:
                console.print(progress.note, markup=False)

        yield show


def _lines() -> Callable[[Progress], None]:
    import time

    shown, began, first = -1, time.monotonic(), -1.0

    def show(progress: Progress) -> None:
        nonlocal shown, first
        share = (progress.done + progress.under_way) / progress.total
        first = share if first < 0.0 else first
        if int(10 * share) > shown:
            shown = int(10 * share)
            spent = time.monotonic() - began
            left = spent * (1.0 - share) / (share - first) if share > first else 0.0
            guess = f", about {_span(left)} left" if left >= 1.0 else ""
            click.echo(f"{share:.0%} simulated, {progress.done} of {progress.total} runs complete{guess}", err=True)
        if progress.note:
            click.echo(progress.note, err=True)

    return show


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


INTERRUPTED, TERMINATED = 130, 143
"""128 and the signal's number, the convention of shells."""


@contextmanager
def terminable() -> Iterator[Callable[[], int]]:
    """While open, SIGTERM (of Slurm, systemd, a shutdown) interrupts as Ctrl-C. Yields a function for the exit code."""
    codes = [INTERRUPTED]

    def answer(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the tables are being written
        codes.append(TERMINATED)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # Python handles signals in the main thread only
        yield lambda: codes[-1]
        return
    before = signal.signal(signal.SIGTERM, answer)
    try:
        yield lambda: codes[-1]
    finally:
        signal.signal(signal.SIGTERM, before)
