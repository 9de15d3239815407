"""Layout of a skill's description on a screen: long lines are broken at semicolons.

The words stay as the plug-in wrote them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import click

PHASE = re.compile(r"(phase \d+): ")
LABEL = re.compile(r"[a-z][a-z ]{0,15}: ")
OUTSIDE = re.compile(r"; (?![^(]*\))")


def tell(lines: Iterable[str]) -> None:
    """Print a description."""
    for line in laid_out(lines):
        click.echo(line)


def laid_out(lines: Iterable[str]) -> Iterator[str]:
    """Lines of a description: details of one phase below one heading, long lines broken."""
    heading = ""
    for line in lines:
        found = PHASE.match(line)
        if found is not None and found[1] != heading:
            yield found[1]
        heading = "" if found is None else found[1]
        yield from _broken(line if found is None else line[found.end() :], "" if found is None else "  ")


def _broken(line: str, margin: str) -> Iterator[str]:
    label = LABEL.match(line)
    phrases = OUTSIDE.split(line)
    if label is None or len(phrases) == 1 or len(margin + line) <= 100:  # columns
        yield margin + line
        return
    first, *rest = phrases
    texts = [margin + first, *(margin + " " * label.end() + part for part in rest)]
    yield from [*(f"{text};" for text in texts[:-1]), texts[-1]]
