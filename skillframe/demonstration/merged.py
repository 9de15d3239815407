"""One table that holds pose and wrench on clocks of their own: sparse exports, and a wrench whose clock is shifted.

Tools that plot topics export them side by side: each row has one topic's stamp and values, and the other topics' cells
are empty. Such a table is two recordings with one clock, and is joined as two files are. It is taken for one only if
pose or wrench is empty as a whole in a tenth of the rows or more (our choice). A row that holds a part is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.assemble import assemble
from skillframe.demonstration.columns import (
    EULER,
    MATRIX,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    WRENCH,
    Columns,
    select_arm,
)
from skillframe.demonstration.options import ReadOptions
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError

POSE = (*POSITION, *QUATERNION, *EULER, *ROTATION_VECTOR, *MATRIX)
LEAST_EMPTY = 0.1


def assemble_split(
    columns: Columns, meta: Mapping[str, Any], options: ReadOptions, notes: list[str], wrench: Columns | None = None
) -> Demonstration:
    """A demonstration from a table whose pose and wrench may have clocks of their own. Takes what `assemble` takes."""
    if wrench is None:
        chosen = select_arm(columns, options.arm)
        parts = _sparse(chosen, notes) or _shifted(chosen, options)
        if parts is not None:
            columns, wrench = parts
            options = replace(options, arm=None, wrench=Path(columns.source))  # so that cuts keep a margin until joined
    return assemble(columns, meta, options, notes, wrench)


def _sparse(columns: Columns, notes: list[str]) -> tuple[Columns, Columns] | None:
    """Pose and wrench of a sparse table, each with its own rows, or None where it is none.

    Raises:
        InputError: a row holds a part of the pose or of the wrench.
    """
    groups = [[name for name in names if name in columns] for names in (POSE, WRENCH)]
    if not all(groups) or "t" not in columns:
        return None
    empty = [np.isnan(columns.stack(names)) for names in groups]
    rows = [np.any(~each, axis=1, keepdims=True)[:, 0] for each in empty]
    if min(each.sum() for each in rows) < 2 or min(each.mean() for each in rows) > 1.0 - LEAST_EMPTY:
        return None
    for names, each, some in zip(groups, empty, rows, strict=True):
        for row, column in np.argwhere(each & some[:, None])[:1]:
            raise InputError(
                columns.place(int(row), names[column]), "is empty, while other cells of the row are not",
                "export each topic's values together, or fill the cell",
            )  # fmt: skip
    pose, wrench = (int(each.sum()) for each in rows)
    notes.append(f"pose stands in {pose} rows and wrench in {wrench} of {len(columns['t'])}: joined on time")
    others = {n: v for n, v in columns.items() if n not in WRENCH and not np.isnan(v[rows[0]]).any()}
    own = {name: columns[name] for name in ("t", *groups[1])}
    return _rows(columns.with_values(others), rows[0]), _rows(columns.with_values(own), rows[1])


def _shifted(columns: Columns, options: ReadOptions) -> tuple[Columns, Columns] | None:
    """Pose and wrench of a table whose wrench is to be moved in time, or None where it is not."""
    if not options.wrench_shift or not columns.has(("t", *WRENCH)):
        return None
    own = {name: columns[name] for name in ("t", *WRENCH)}
    return columns.with_values({n: v for n, v in columns.items() if n not in WRENCH}), columns.with_values(own)


def _rows(columns: Columns, keep: NDArray[np.bool_]) -> Columns:
    rows = None if columns.rows is None else np.asarray(columns.rows)[keep].tolist()
    return Columns({name: column[keep] for name, column in columns.items()}, columns.source, rows)
