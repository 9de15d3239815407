"""Which policies are not told apart, as letters: two that share one are not.

The letters are the columns that "insert and absorb" leaves (Piepho 2004, "An algorithm for a letter-based
representation of all-pairwise comparisons", J. Comput. Graph. Stat. 13(2)): begin with one column that holds all; for
each pair that differs, part every column that holds both into two, each without one of them; drop what lies in another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from string import ascii_lowercase


def letters(names: Sequence[str], differ: Iterable[tuple[str, str]]) -> dict[str, str]:
    """The letters of each name.

    Args:
        names: in the order in which letters are given, the best first.
        differ: pairs of names that are told apart.
    """
    columns = [frozenset(names)]
    for first, second in differ:
        parted = [column for column in columns if not {first, second} <= column]
        for column in columns:
            if {first, second} <= column:
                parted += [column - {first}, column - {second}]
        columns = [
            c for i, c in enumerate(parted) if not any(c < d or (c == d and i > j) for j, d in enumerate(parted))
        ]
    order = {name: i for i, name in enumerate(names)}
    columns.sort(key=lambda column: sorted(order[name] for name in column))
    return {name: "".join(_letter(i) for i, column in enumerate(columns) if name in column) for name in names}


def _letter(index: int) -> str:
    """One of a to z, then a1 and so on."""
    turn, place = divmod(index, len(ascii_lowercase))
    return ascii_lowercase[place] + (str(turn) if turn else "")
