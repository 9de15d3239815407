"""Files to write whose name says that they are of another kind are refused before the work begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from skillframe.errors import InputError

KINDS = frozenset(
    (".csv", ".htm", ".html", ".json", ".mp4", ".npz", ".pdf", ".png", ".py", ".toml", ".txt", ".urdf", ".yaml", ".yml")
)
"""Endings with a meaning; any other ending is part of a name."""


class OutputFile(click.Path):
    """A file to write with one of some endings, or one without a meaning."""

    def __init__(self, *endings: str) -> None:
        super().__init__(path_type=Path, dir_okay=False)
        self.endings = endings

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path.

        Raises:
            InputError: its ending is that of another kind of file.
        """
        path = Path(str(super().convert(value, param, ctx)))
        if path.suffix.lower() in KINDS.difference(self.endings):
            raise InputError(path, "is the name of another kind of file", f"let it end in {self.endings[0]}")
        return path


TRACE, SKILL, PAGE = OutputFile(".npz"), OutputFile(".json"), OutputFile(".html", ".htm")
