"""`fmu.toml`: an FMU's variables, its C header and model description (FMI 2.0.4 section 2.2, FMI 3.0.2 section 2.4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from xml.sax.saxutils import quoteattr

from skillframe.config import build, read_toml
from skillframe.errors import InputError, UnknownName

Causality = Literal["input", "output", "local", "parameter", "independent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A variable in fmu.toml.

    Attributes:
        unit: a key of [units]; start: initial value (inputs, parameters); nominal: typical size.
        discrete: an input that changes only at communication points; boolean: true or false instead of a number.
        derivative: name of its state if it is a rate; text: description.
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
    """Variables and sources of a model.

    Attributes:
        name: model identifier and folder name; description: one line.
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
    """A variable with its value `reference` in both versions of the standard."""

    name: str
    reference: int
    causality: Causality
    entry: Entry

    @property
    def symbol(self) -> str:
        """Name in C: `der(x)` becomes DER_X."""
        return self.name.replace("der(", "der_").rstrip(")").upper()


def read_table(folder: Path) -> VariableTable:
    """Table of an FMU's source folder.

    Raises:
        InputError: fmu.toml is missing or invalid.
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
    """All variables in the order of value references, with time last."""
    groups: list[tuple[Causality, dict[str, Entry]]] = [
        ("input", table.input), ("output", table.output), ("local", table.local), ("parameter", table.parameter),
        ("independent", {"time": Entry(unit="s" if "s" in table.units else "", text="time")}),
    ]  # fmt: skip
    flat = [(name, causality, entry) for causality, group in groups for name, entry in group.items()]
    return [Row(name=n, reference=i, causality=c, entry=e) for i, (n, c, e) in enumerate(flat)]


def states(table: VariableTable) -> list[tuple[Row, Row]]:
    """Pairs (state, rate) in the order of the rates."""
    by_name = {row.name: row for row in rows(table)}
    return [(by_name[row.entry.derivative], row) for row in rows(table) if row.entry.derivative]


_CAUSALITY = {"input": "INPUT", "output": "OUTPUT", "local": "LOCAL", "parameter": "PARAMETER"}


def variables_header(table: VariableTable, token: str) -> str:
    """C header of numbered variables. `token` ties binary and description together."""
    listed = rows(table)
    lines = ["/* Made from fmu.toml; do not edit. */", f'#define MODEL_TOKEN "{token}"', "enum {"]
    lines += [f"    {row.symbol} = {row.reference}," for row in listed]
    lines += [f"    N_VARIABLES = {len(listed)}", "};", "static const Variable VARIABLES[N_VARIABLES] = {"]
    lines += [
        f'    {{"{row.name}", {_CAUSALITY.get(row.causality, "INDEPENDENT")},'
        f" {'BOOLEAN' if row.entry.boolean else 'REAL'}, {row.entry.start!r}, {row.entry.nominal!r}}},"
        for row in listed
    ]
    pairs = states(table)
    lines += ["};", f"#define N_STATES {len(pairs)}"]
    for name, column in (("STATES", 0), ("RATES", 1)):
        numbers = ", ".join(str(pair[column].reference) for pair in pairs) or "0"
        lines.append(f"static const unsigned {name}[] = {{{numbers}}};")
    return "\n".join([*lines, ""])


def model_description(table: VariableTable, token: str, version: int) -> str:
    """modelDescription.xml for FMI 2.0 (version 2) or 3.0 (version 3)."""
    return _description2(table, token) if version == 2 else _description3(table, token)


def build_description(table: VariableTable, sources: list[str]) -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    files = "\n".join(f"      <SourceFile name={quoteattr(s)}/>" for s in sources)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f"  <BuildConfiguration modelIdentifier={quoteattr(table.name)}>\n"
        f'    <SourceFileSet language="C99">\n{files}\n    </SourceFileSet>\n'
        "  </BuildConfiguration>\n</fmiBuildDescription>\n"
    )


def _units(table: VariableTable) -> str:
    lines = []
    for name, powers in table.units.items():
        base = " ".join(f'{unit}="{power}"' for unit, power in powers.items())
        lines.append(
            f"    <Unit name={quoteattr(name)}><BaseUnit {base}/></Unit>".replace("<BaseUnit />", "<BaseUnit/>")
        )
    return "  <UnitDefinitions>\n" + "\n".join(lines) + "\n  </UnitDefinitions>\n" if lines else ""


def _states_and_unknowns(table: VariableTable) -> tuple[list[Row], list[Row]]:
    outputs = [row for row in rows(table) if row.causality == "output"]
    hidden = [row for pair in states(table) for row in pair if row.causality == "local"]
    return outputs, sorted(hidden, key=lambda row: row.reference)


def _variability(row: Row) -> str:
    if row.causality == "parameter":
        return "fixed"
    return "discrete" if row.entry.discrete or row.entry.boolean else "continuous"


def _common(row: Row) -> str:
    text = f" description={quoteattr(row.entry.text)}" if row.entry.text else ""
    initial = {"parameter": ' initial="exact"', "output": ' initial="calculated"', "local": ' initial="calculated"'}
    return (
        f'name={quoteattr(row.name)} valueReference="{row.reference}" causality="{row.causality}"'
        f' variability="{_variability(row)}"{initial.get(row.causality, "")}{text}'
    )


def _attributes(row: Row, derivative: str) -> str:
    entry, parts = row.entry, []
    if entry.unit:
        parts.append(f"unit={quoteattr(entry.unit)}")
    if entry.nominal != 1.0:
        parts.append(f'nominal="{entry.nominal!r}"')
    if row.causality in ("input", "parameter"):
        parts.append(f'start="{("true" if entry.start else "false") if entry.boolean else repr(entry.start)}"')
    if entry.derivative:
        parts.append(f'derivative="{derivative}"')
    return " ".join(parts)


def _description2(table: VariableTable, token: str) -> str:
    index = {row.name: row.reference + 1 for row in rows(table)}
    lines = []
    for row in rows(table):
        kind = "Boolean" if row.entry.boolean else "Real"
        inner = _attributes(row, str(index.get(row.entry.derivative, 0)))
        lines.append(f"    <ScalarVariable {_common(row)}><{kind} {inner}/></ScalarVariable>".replace(" />", "/>"))
    outputs, hidden = _states_and_unknowns(table)
    unknowns = sorted([*outputs, *hidden], key=lambda row: row.reference)
    sources = "".join(f"<File name={quoteattr(s)}/>" for s in ("face2.c", *table.sources))
    features = (
        f'modelIdentifier={quoteattr(table.name)} canNotUseMemoryManagementFunctions="true"'
        ' canGetAndSetFMUstate="true" canSerializeFMUstate="true"'
    )
    return _join(
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(table.name)} guid={quoteattr(token)}'
        f" description={quoteattr(table.description)}"
        f' generationTool="skillframe" variableNamingConvention="structured" numberOfEventIndicators="0">\n',
        f'  <ModelExchange {features} completedIntegratorStepNotNeeded="true">'
        f"<SourceFiles>{sources}</SourceFiles></ModelExchange>\n" if states(table) else "",
        f'  <CoSimulation {features} canHandleVariableCommunicationStepSize="true">'
        f"<SourceFiles>{sources}</SourceFiles></CoSimulation>\n",
        _units(table),
        '  <LogCategories><Category name="logAll"/><Category name="logStatusError"/></LogCategories>\n',
        f'  <DefaultExperiment startTime="0" stopTime="1" stepSize="{table.step_size!r}"/>\n',
        "  <ModelVariables>\n" + "\n".join(lines) + "\n  </ModelVariables>\n  <ModelStructure>\n",
        _unknowns2("Outputs", outputs, index),
        _unknowns2("Derivatives", [rate for _, rate in states(table)], index),
        _unknowns2("InitialUnknowns", unknowns, index),
        "  </ModelStructure>\n</fmiModelDescription>\n",
    )  # fmt: skip


def _unknowns2(kind: str, members: list[Row], index: dict[str, int]) -> str:
    entries = "".join(f'<Unknown index="{index[row.name]}"/>' for row in members)
    return f"    <{kind}>{entries}</{kind}>\n" if members else ""


def _description3(table: VariableTable, token: str) -> str:
    reference = {row.name: row.reference for row in rows(table)}
    lines = []
    for row in rows(table):
        kind = "Boolean" if row.entry.boolean else "Float64"
        inner = _attributes(row, str(reference.get(row.entry.derivative, 0)))
        lines.append(f"    <{kind} {_common(row)} {inner}/>".replace(" />", "/>"))
    outputs, hidden = _states_and_unknowns(table)
    unknowns = sorted([*outputs, *hidden], key=lambda row: row.reference)
    members = (
        [("Output", row) for row in outputs]
        + [("ContinuousStateDerivative", rate) for _, rate in states(table)]
        + [("InitialUnknown", row) for row in unknowns]
    )
    structure = "\n".join(f'    <{kind} valueReference="{row.reference}"/>' for kind, row in members)
    features = f'modelIdentifier={quoteattr(table.name)} canGetAndSetFMUState="true" canSerializeFMUState="true"'
    return _join(
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(table.name)}'
        f" instantiationToken={quoteattr(token)} description={quoteattr(table.description)}"
        ' generationTool="skillframe" variableNamingConvention="structured">\n',
        f"  <ModelExchange {features}/>\n" if states(table) else "",
        f'  <CoSimulation {features} canHandleVariableCommunicationStepSize="true"/>\n',
        _units(table),
        '  <LogCategories><Category name="logAll"/><Category name="logStatusError"/></LogCategories>\n',
        f'  <DefaultExperiment startTime="0" stopTime="1" stepSize="{table.step_size!r}"/>\n',
        "  <ModelVariables>\n" + "\n".join(lines) + "\n  </ModelVariables>\n",
        f"  <ModelStructure>\n{structure}\n  </ModelStructure>\n</fmiModelDescription>\n",
    )


def _join(*parts: str) -> str:
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "".join(parts)
