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
        line, margin = (line, "") if found is None else (line[found.end() :], "  ")
        label = LABEL.match(line)
        first, *rest = OUTSIDE.split(line)
        if label is None or not rest or len(margin + line) <= 100:  # columns
            yield margin + line
        else:
            texts = [margin + first, *(margin + " " * label.end() + part for part in rest)]
            yield from [*(f"{text};" for text in texts[:-1]), texts[-1]]
