"""CSV demonstrations: a header, a row per sample, metadata in `NAME.meta.toml` beside it. Numbers round-trip."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skillframe.demonstration.columns import CANONICAL, Columns
from skillframe.demonstration.delimited import read_delimited
from skillframe.demonstration.metafile import meta_path, toml_text
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.files import write_whole


def read_csv(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """A demonstration from a CSV file.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    return read_delimited(path, options)


def demonstration_columns(demonstration: Demonstration) -> Columns:
    """A demonstration's arrays under their file names, further columns last."""
    d = demonstration
    arrays = [d.time, *d.position.T, *d.quaternion.T, *d.wrench.T]
    return Columns({**dict(zip(CANONICAL, arrays, strict=True)), **d.extra}, d.source)


def write_csv(demonstration: Demonstration, path: Path) -> None:
    """Write a CSV and its metadata. Each file appears complete or not at all."""
    columns = demonstration_columns(demonstration)
    for name in columns:
        if any(c in name for c in ',;"\n'):
            raise InputError(path, f"column name {name!r} cannot stand in a CSV header", "rename it, or write .npz")
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"
    write_whole(path, text.encode())
    write_whole(meta_path(path), toml_text({"quaternion": "xyzw", **demonstration.meta}).encode())
