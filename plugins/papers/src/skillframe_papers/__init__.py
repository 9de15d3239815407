"""skillframe plug-in: the papers' results, row by row, and the command `skillframe reproduce` that computes them.

Read `published` (the rows, with what ours must reach), `rows` (a module a subject: how each is computed), `jobs` (what
is to be computed), `runner` (each group of rows in a process), `store` (what is kept), `page` and `document` (what is
shown), `committed` (has a verdict changed?). This module is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend.records import RowType

skillframe_contract = "0.2"


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """The published results."""
    from skillframe_papers.published import row_types

    return row_types()
