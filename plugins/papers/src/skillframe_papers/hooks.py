"""Hooks of skillframe-papers, the only module that listing plug-ins imports."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import RowType

skillframe_contract = "0.2"


@hookimpl
def skillframe_rows() -> Iterable[RowType]:
    """The published results."""
    from skillframe_papers.published import row_types

    return row_types()
