"""Parameter values of System Structure and Parameterization (SSP 1.0, Modelica Association, 2019).

A parameter is COMPONENT.NAME, with the name of a variable of the component's FMU. Values are converted to the unit
that the FMU declares by the SI exponents, factor and offset of both units, x_SI = factor x + offset, and a unit without
a definition by the words of `skillframe.config.units`. A file is XML from outside: document types are refused, and
nothing of an archive is unpacked to disk.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from skillframe.config.units import unit_word
from skillframe.errors import InputError, UnknownName
from skillframe.files.documents import parse_xml, read_bytes
from skillframe.fmu.build import find_fmu, fmu_folders
from skillframe.fmu.extract import THIN
from skillframe.fmu.facts import WORDS, FmuVariable, values_of
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.table import read_table, rows

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Units = Mapping[str, Mapping[str, float]]
"""By the name of a unit, the attributes of its BaseUnit that are not the default."""
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
STRUCTURE = "SystemStructure.ssd"


class Declared(NamedTuple):
    """Variables of an FMU by name, and its units."""

    variables: Mapping[str, FmuVariable]
    units: Units


class ParameterValue(NamedTuple):
    """A parameter of a file: name with the component, value, its unit or "", and the file's units."""

    name: str
    value: float | int | bool | str
    unit: str
    units: Units


def declared(fmu: str, base: Path) -> Declared:
    """Variables and units of an FMU, a name in `fmus/` or a path relative to `base`. Sources need not be built.

    Raises:
        InputError, UnknownName: as `find_fmu` and `inspect_fmu`.
    """
    folder = fmu_folders().get(fmu)
    if folder is None:
        facts = inspect_fmu(find_fmu(fmu, base))
        return Declared(facts.variables, facts.units)
    table = read_table(folder)
    variables = {
        row.name: FmuVariable(
            name=row.name, reference=row.reference, type="Boolean" if row.entry.boolean else "Real",
            causality=row.causality, unit=row.entry.unit,
        )
        for row in rows(table)
    }  # fmt: skip
    return Declared(variables, table.units)


def with_parameter_set(values: dict[str, Any], path: Path) -> dict[str, Any]:
    """Content of the robot.toml at `path` with the values of its `parameter_set` in `[[actuation]]`.

    Start values of inputs are left out: a run has its own start.

    Raises:
        InputError: the file cannot be read, names no actuator or parameter, or a value has another type or unit.
    """
    file, drives = path.resolve().parent / str(values["parameter_set"]), values.get("actuation", [])
    if not isinstance(drives, list) or not all(
        isinstance(one, dict) and isinstance(one.get("parameters", {}), dict) for one in drives
    ):
        return values  # refused where tables are read
    copies = [{**one, "parameters": dict(one.get("parameters", {}))} for one in drives]
    own = {str(one.get("joint")): one for one in copies}
    fmus: dict[str, Declared] = {}
    for given in read_parameters(file):
        joint = max((each for each in own if given.name.startswith(f"{each}.")), key=len, default="")
        if not joint:
            raise InputError(file, str(UnknownName("component", given.name.partition(".")[0], own)))
        fmu, name = str(own[joint].get("fmu")), given.name[len(joint) + 1 :]
        if fmu not in fmus:
            fmus[fmu] = declared(fmu, path.resolve().parent)
        known = {n: v for n, v in fmus[fmu].variables.items() if v.causality in ("parameter", "input")}
        if name not in known:
            raise InputError(f"{file}: {joint}", str(UnknownName(f"parameter of {fmu}", name, known)))
        if known[name].causality == "parameter":
            value = in_unit(given, known[name].unit, fmus[fmu].units, f"{file}: {given.name}")
            own[joint]["parameters"][name] = values_of(known[name], value, f"{file}: {joint}")[0]
    return {**values, "actuation": copies}


def in_unit(given: ParameterValue, wanted: str, units: Units, where: str) -> float | int | bool | str:
    """Value of a parameter in the unit `wanted` of an FMU that has `units`.

    Raises:
        InputError: a unit of another dimension, or one that nothing defines.
    """
    value, unit = given.value, given.unit
    if not unit or (unit == wanted and unit not in given.units):
        return value
    source, target = given.units.get(unit, units.get(unit)), units.get(wanted)
    fix = f"give it in {wanted}" if wanted else "give it without a unit"
    if source is not None and target is not None:
        if all(source.get(base, 0) == target.get(base, 0) for base in EXPONENTS):
            si = source.get("factor", 1.0) * float(value) + source.get("offset", 0.0)
            return (si - target.get("offset", 0.0)) / target.get("factor", 1.0)
    else:
        word, of = unit_word(unit), unit_word(wanted)
        if word is not None and of is not None and word[0] == of[0]:
            return float(value) * word[1] / of[1]
        if word is None and source is None:
            raise InputError(where, f"is in {unit!r}, a unit that the file does not define", fix)
    raise InputError(where, f"is in {unit}, and its FMU takes {wanted or 'a number without a unit'}", fix)


def read_parameters(path: Path) -> Iterator[ParameterValue]:
    """Parameters of an .ssv file, or of all bindings in an .ssp file.

    Raises:
        InputError: unreadable, neither of both, unsafe, or a value that is none.
    """
    if path.suffix != ".ssp":
        yield from _parameters(parse_xml(path, read_bytes(path, "an SSV file")), path, {})
        return
    fix = "give an .ssp file as a tool exports it"
    try:
        with zipfile.ZipFile(path) as archive:
            yield from _bound(archive, path)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError) as error:
        raise InputError(path, f"is no zip archive that can be read ({error})", fix) from None


def _bound(archive: zipfile.ZipFile, path: Path) -> Iterator[ParameterValue]:
    """Parameters of the bindings in an archive, named with their components. Those that prevail in SSP come last."""
    root, fix = _member(archive, path, STRUCTURE), "give the parameters as an .ssv file, by the names of the FMUs"
    units = _units(root)
    for element in (*_below(root, "System", "Elements", "Component"), *_below(root, "System")):
        if _below(element, "Elements", "System"):
            raise InputError(path, "holds systems within its system, which are not read", fix)
        whose = f"{element.get('name')}." if _local(element) == "Component" else ""
        for binding in _below(element, "ParameterBindings", "ParameterBinding"):
            if _below(binding, "ParameterMapping"):
                raise InputError(path, "maps names of parameters (.ssm), which is not read", fix)
            source, before = binding.get("source"), whose + binding.get("prefix", "")
            where = Path(f"{path}: {source or STRUCTURE}")
            found = [_member(archive, path, source)] if source else _below(binding, "ParameterValues", "ParameterSet")
            for each in found:
                yield from (given._replace(name=before + given.name) for given in _parameters(each, where, units))


def _member(archive: zipfile.ZipFile, path: Path, name: str) -> Element:
    """Root of an XML document in an archive, read without unpacking it to disk."""
    try:
        info = archive.getinfo(name)
    except KeyError:
        raise InputError(path, f"holds no {name}", "give an .ssp file as a tool exports it") from None
    if info.file_size > THIN:
        problem = f"holds {name} of {info.file_size} bytes, where {THIN} are the most"
        raise InputError(path, problem, "do not trust this file")
    return parse_xml(Path(f"{path}: {name}"), archive.read(info))


def _parameters(root: Element, where: Path, units: Units) -> Iterator[ParameterValue]:
    if _local(root) != "ParameterSet":
        raise InputError(where, f"is no parameter set of SSP, but <{root.tag:.60}>", "give an .ssv or .ssp file")
    own = {**units, **_units(root)}
    for parameter in _below(root, "Parameters", "Parameter"):
        name = parameter.get("name", "")
        for value in parameter:
            kind = _local(value)
            if kind != "Annotations":
                plain = _plain(kind, value.get("value", ""), f"{where}: {name}")
                yield ParameterValue(name, plain, value.get("unit", "") if kind == "Real" else "", own)


def _plain(kind: str, text: str, where: str) -> float | int | bool | str:
    try:
        if kind == "Real" and float(text) - float(text) == 0.0:
            return float(text)
        if kind == "Boolean":
            return WORDS[text.strip()]
        if kind == "Integer":
            return int(text)
    except (ValueError, KeyError):
        pass
    if kind == "String":
        return text
    raise InputError(where, f"is <{kind:.20}> {text!r:.60}", "give a finite Real, an Integer, a Boolean or a String")


def _units(root: Element) -> dict[str, dict[str, float]]:
    """Units that a file defines. A unit with an attribute that is no finite number stays undefined."""
    found = {}
    for unit in _below(root, "Units", "Unit"):
        for base in _below(unit, "BaseUnit"):
            try:
                read = {name: float(text) for name, text in base.attrib.items()}
            except ValueError:
                continue
            if read.get("factor") != 0.0 and all(math.isfinite(value) for value in read.values()):
                found[unit.get("name", "")] = read
    return found


def _local(element: Element) -> str:
    return element.tag.rpartition(":")[2]


def _below(element: Element, *path: str) -> list[Element]:
    """Elements down a path of names, whatever their prefixes."""
    found = [element]
    for name in path:
        found = [child for each in found for child in each if _local(child) == name]
    return found
