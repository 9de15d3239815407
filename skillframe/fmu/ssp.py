"""A system of FMUs as System Structure and Parameterization (SSP 1.0, Modelica Association, 2019).

The archive holds SystemStructure.ssd, the FMUs and one parameter set under resources/. Inputs and outputs of the
components are connected with those of the system, not with each other. SSP 1.0 has no place for a communication step:
it stands in the system's description, and in the annotation of OMSimulator (its schema/oms.xsd).
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from skillframe.errors import InputError
from skillframe.files import writing_whole
from skillframe.fmu.build import find_fmu
from skillframe.fmu.facts import FLOATS, FmuFacts, FmuVariable, values_of
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.ssv import STRUCTURE

SPACES = {
    **{f"xmlns:ss{letter}": f"http://ssp-standard.org/SSP1/SystemStructure{name}" for letter, name in (
        ("c", "Common"), ("d", "Description"), ("v", "ParameterValues"))},
    "xmlns:oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}  # fmt: skip
PARAMETERS = "resources/parameters.ssv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """An FMU of a system.

    Attributes:
        name: of the component.
        fmu: a name in `fmus/`, or a path.
        parameters: values of parameters, by the FMU's names.
        start: further values at the start, of inputs too, by the FMU's names.
        inputs, outputs: the system's connectors, to the FMU's names. Components may share an input.
    """

    name: str
    fmu: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    start: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)


def write_ssp(path: Path, name: str, components: Sequence[Component], step: float, base: Path | None = None) -> None:
    """Write a system `name` of components, whose FMUs may be relative to `base`, with a communication step [s].

    Raises:
        InputError, UnknownName: an FMU cannot be found, read or named, lacks a variable, or `path` cannot be written.
    """
    files = {each.fmu: find_fmu(each.fmu, base) for each in components}
    if len({file.name for file in files.values()}) < len(files):
        raise InputError(path, f"would hold two FMUs of one name ({', '.join(files)})", "rename one")
    known = {each.name: inspect_fmu(files[each.fmu]) for each in components}
    values, structure = _parameter_set(name, components, known), _structure(name, components, known, step)
    with writing_whole(path) as part, zipfile.ZipFile(part, "w") as archive:  # without dates, so that bytes repeat
        for member, root in ((STRUCTURE, structure), (PARAMETERS, values)):
            ET.indent(root)
            text = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
            archive.writestr(zipfile.ZipInfo(member), text, zipfile.ZIP_DEFLATED)
        for file in files.values():  # packed already
            archive.writestr(zipfile.ZipInfo(f"resources/{file.name}"), file.read_bytes())


def _structure(name: str, components: Sequence[Component], known: Mapping[str, FmuFacts], step: float) -> ET.Element:
    exact = f"{step:.15f}".rstrip("0")
    root = ET.Element("ssd:SystemStructureDescription", {**SPACES, "version": "1.0", "name": name})
    system = ET.SubElement(root, "ssd:System", {"name": name, "description": f"communication step {exact} s"})
    outer, bindings, elements, connections, annotations = (
        ET.SubElement(system, f"ssd:{each}")
        for each in ("Connectors", "ParameterBindings", "Elements", "Connections", "Annotations")
    )
    ET.SubElement(bindings, "ssd:ParameterBinding", {"source": PARAMETERS})
    shown, used = set[str](), _UsedUnits()
    for each in components:
        facts = known[each.name]
        own = {"name": each.name, "source": f"resources/{facts.path.name}", "implementation": "CoSimulation"}
        inner = ET.SubElement(ET.SubElement(elements, "ssd:Component", own), "ssd:Connectors")
        for kind, ours in (("input", each.inputs), ("output", each.outputs)):
            far, near = ("start", "end") if kind == "input" else ("end", "start")
            for connector, theirs in ours.items():
                variable = facts.variable(theirs, kind)
                for place, called in ((inner, theirs), (outer, connector)):
                    if place is inner or connector not in shown:
                        made = ET.SubElement(place, "ssd:Connector", {"name": called, "kind": kind})
                        ET.SubElement(made, f"ssc:{_type(variable)}", used.of(variable, facts))
                shown.add(connector)
                ends = {f"{near}Element": each.name, f"{near}Connector": theirs, f"{far}Connector": connector}
                ET.SubElement(connections, "ssd:Connection", ends)
    notes = ET.SubElement(annotations, "ssc:Annotation", {"type": "org.openmodelica"})
    notes = ET.SubElement(ET.SubElement(notes, "oms:Annotations"), "oms:SimulationInformation")
    master = {"description": "oms-ma", "stepSize": exact, "relativeTolerance": "0.0001"}
    ET.SubElement(notes, "oms:FixedStepMaster", master)
    used.define(root, "ssd")
    ET.SubElement(root, "ssd:DefaultExperiment", {"startTime": "0"})
    return root


def _parameter_set(name: str, components: Sequence[Component], known: Mapping[str, FmuFacts]) -> ET.Element:
    root = ET.Element("ssv:ParameterSet", {**SPACES, "version": "1.0", "name": name})
    parameters, used = ET.SubElement(root, "ssv:Parameters"), _UsedUnits()
    for each in components:
        facts = known[each.name]
        for theirs, value in {**each.parameters, **each.start}.items():
            variable = facts.settable(theirs)
            plain = values_of(variable, value, each.name)[0]
            own = ET.SubElement(parameters, "ssv:Parameter", {"name": f"{each.name}.{theirs}"})
            text = str(plain).lower() if isinstance(plain, bool) else str(plain)
            ET.SubElement(own, f"ssv:{_type(variable)}", {"value": text, **used.of(variable, facts)})
    used.define(root, "ssv")
    return root


class _UsedUnits:
    """Units that a document refers to and has to define. An FMU's unit without a definition is left out."""

    def __init__(self) -> None:
        self._units: dict[str, Mapping[str, float]] = {}

    def of(self, variable: FmuVariable, facts: FmuFacts) -> dict[str, str]:
        """Attribute for the unit of a variable. Raises `InputError` if two FMUs define it differently."""
        if variable.type not in FLOATS or variable.unit not in facts.units:
            return {}
        if self._units.setdefault(variable.unit, facts.units[variable.unit]) != facts.units[variable.unit]:
            raise InputError(facts.path, f"defines the unit {variable.unit!r} unlike another FMU", "rename its unit")
        return {"unit": variable.unit}

    def define(self, root: ET.Element, space: str) -> None:
        """Append the definitions to a document."""
        units = ET.SubElement(root, f"{space}:Units") if self._units else root
        for name, base in self._units.items():
            powers = {key: str(value) for key, value in base.items()}
            ET.SubElement(ET.SubElement(units, "ssc:Unit", {"name": name}), "ssc:BaseUnit", powers)


def _type(variable: FmuVariable) -> str:
    if variable.type in ("Boolean", "String"):
        return variable.type
    return "Real" if variable.type.startswith(("Real", "Float")) else "Integer"
