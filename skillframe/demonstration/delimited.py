"""Delimited text of any layout (.dat, .txt, .tsv), read with `--columns`, `--units`, `--euler` and `--rate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skillframe.demonstration.checks import refuse_w_first_header
from skillframe.demonstration.columns import WRENCH, Columns, left_out, name_columns, split_names
from skillframe.demonstration.merged import assemble_split
from skillframe.demonstration.metafile import read_meta
from skillframe.demonstration.options import ReadOptions, read_options
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.table import Table, read_table


def read_delimited(path: Path, options: Mapping[str, Any]) -> Demonstration:
    """A demonstration from delimited text.

    Args:
        path: the file; `NAME.meta.toml` beside it is read too.
        options: fields of `ReadOptions`. If one list of columns names both files' columns, each file takes its own.

    Raises:
        InputError: anything of the contract's list of bad input.
    """
    chosen = read_options(options)
    table = read_table(path)
    if chosen.columns is None:
        refuse_w_first_header(table.source, table.names)
    chosen = _split_columns(table, chosen)
    columns, notes = name_columns(table, chosen.columns, chosen.units), left_out(table)
    return assemble_split(columns, read_meta(path), chosen, notes, read_wrench_file(chosen))


def _split_columns(table: Table, options: ReadOptions) -> ReadOptions:
    """One list of columns for two files: the wrench's names go to the wrench file, t to both."""
    if options.wrench is None or options.columns is None or options.wrench_columns is not None:
        return options
    names = split_names(options.columns)
    if "=" in options.columns or len(names) == table.values.shape[1] or not set(WRENCH) <= set(names):
        return options
    own = ",".join(name for name in names if name not in WRENCH)
    return replace(options, columns=own, wrench_columns=",".join(n for n in names if n in (*WRENCH, "t")))


def read_wrench_file(options: ReadOptions) -> Columns | None:
    """The columns of the separate wrench file, or None where there is none.

    Without a header and without names, six columns are fx ... tz and seven have the time before them.
    """
    if options.wrench is None:
        return None
    table = read_table(options.wrench)
    spec = options.wrench_columns
    if spec is None and not table.names:
        spec = {6: ",".join(WRENCH), 7: ",".join(("t", *WRENCH))}.get(table.values.shape[1])
    return name_columns(table, spec, options.wrench_units or options.units)
