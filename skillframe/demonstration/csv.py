"""CSV demonstrations: a header, a row per sample, metadata in `NAME.meta.toml` beside it.

Delimited text of any layout (.dat, .txt, .tsv), read by `columns`, `units`, `euler` and `rate`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skillframe.demonstration.assemble import assemble_split, read_wrench_file
from skillframe.demonstration.checks import refuse_w_first_header
from skillframe.demonstration.columns import CANONICAL, WRENCH, Columns, left_out, name_columns, split_names
from skillframe.demonstration.options import meta_path, read_meta, read_options, toml_text
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.table import read_table
from skillframe.errors import InputError
from skillframe.files import write_whole


def demonstration_columns(demonstration: Demonstration) -> Columns:
    """A demonstration's arrays under their file names, further columns last."""
    d = demonstration
    arrays = [d.time, *d.position.T, *d.quaternion.T, *d.wrench.T]
    return Columns({**dict(zip(CANONICAL, arrays, strict=True)), **d.extra}, d.source)


def write_csv(demonstration: Demonstration, path: Path) -> None:
    """Write a CSV and its metadata, each file as a whole. Numbers are exact."""
    columns = demonstration_columns(demonstration)
    for name in columns:
        if any(c in name for c in ',;"\n'):
            raise InputError(path, f"column name {name!r} cannot stand in a CSV header", "rename it, or write .npz")
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"
    write_whole(path, text.encode())
    write_whole(meta_path(path), toml_text({"quaternion": "xyzw", **demonstration.meta}).encode())


def read_delimited(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """Read a demonstration from delimited text.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    chosen = read_options(options)
    table = read_table(path)
    if chosen.columns is None:
        refuse_w_first_header(table.source, table.names)
    if chosen.wrench is not None and chosen.columns is not None and chosen.wrench_columns is None:
        names = split_names(chosen.columns)
        if "=" not in chosen.columns and len(names) != table.values.shape[1] and set(WRENCH) <= set(names):
            own = ",".join(name for name in names if name not in WRENCH)
            chosen = replace(chosen, columns=own, wrench_columns=",".join(n for n in names if n in (*WRENCH, "t")))
    columns, notes = name_columns(table, chosen.columns, chosen.units), left_out(table)
    return assemble_split(columns, read_meta(path), chosen, notes, read_wrench_file(chosen))
