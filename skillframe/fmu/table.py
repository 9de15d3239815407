"""`fmu.toml`: the table of an FMU's variables, from which its C header and its model description are made."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from skillframe.config import build, read_toml
from skillframe.errors import InputError, UnknownName

Causality = Literal["input", "output", "local", "parameter", "independent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One variable as written in fmu.toml.

    Attributes:
        unit: a key of [units]; start: value before initialisation (inputs, parameters); nominal: typical size.
        discrete: an input that only changes at communication points; boolean: true or false instead of a number.
        derivative: name of the state that this is the rate of; text: one line for people.
    """

    unit: str = ""
    start: float = 0.0
    nominal: float = 1.0
    discrete: bool = False
    boolean: bool = False
    derivative: str = ""
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableTable:
    """A model's variables and sources.

    Attributes:
        name: model identifier, also the folder's name; description: one line.
        sources: C files beside fmu.toml; step_size: recommended communication step [s].
        units: SI exponents (kg, m, s, A, K, rad) by unit name.
        input, output, local, parameter: variables by name, in order.
    """

    name: str
    description: str = ""
    sources: tuple[str, ...]
    step_size: float = 0.001
    units: dict[str, dict[str, int]] = field(default_factory=dict)
    input: dict[str, Entry] = field(default_factory=dict)
    output: dict[str, Entry] = field(default_factory=dict)
    local: dict[str, Entry] = field(default_factory=dict)
    parameter: dict[str, Entry] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A variable with its place in the table: `reference` is its value reference in both versions of the standard."""

    name: str
    reference: int
    causality: Causality
    entry: Entry

    @property
    def symbol(self) -> str:
        """Its name in C: `der(x)` becomes DER_X."""
        return self.name.replace("der(", "der_").rstrip(")").upper()


def read_table(folder: Path) -> VariableTable:
    """The table of an FMU's source folder.

    Raises:
        InputError: no fmu.toml, or one that cannot be meant.
    """
    path = folder / "fmu.toml"
    table = build(VariableTable, read_toml(path), str(path))
    names = [row.name for row in rows(table)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(path, f"variable {name!r} is declared twice", "rename one")
    for row in rows(table):
        if row.entry.unit and row.entry.unit not in table.units:
            raise InputError(f"{path}: {row.name}", str(UnknownName("unit", row.entry.unit, table.units)))
        if row.entry.derivative and row.entry.derivative not in names:
            raise InputError(f"{path}: {row.name}", str(UnknownName("state", row.entry.derivative, names)))
    for source in table.sources:
        if not (folder / source).is_file():
            raise InputError(f"{path}: sources", f"there is no file {source!r} beside it", "correct the name")
    return table


def rows(table: VariableTable) -> list[Row]:
    """All variables in the order of their value references. Time, the independent variable, is last."""
    groups: list[tuple[Causality, dict[str, Entry]]] = [
        ("input", table.input), ("output", table.output), ("local", table.local), ("parameter", table.parameter),
        ("independent", {"time": Entry(unit="s" if "s" in table.units else "", text="time")}),
    ]  # fmt: skip
    flat = [(name, causality, entry) for causality, group in groups for name, entry in group.items()]
    return [Row(name=n, reference=i, causality=c, entry=e) for i, (n, c, e) in enumerate(flat)]


def states(table: VariableTable) -> list[tuple[Row, Row]]:
    """(state, its rate) in the order of the rates' declaration."""
    by_name = {row.name: row for row in rows(table)}
    return [(by_name[row.entry.derivative], row) for row in rows(table) if row.entry.derivative]
