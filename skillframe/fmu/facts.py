"""Facts of an FMU read from its file, and conversion of plain values to its types.

Ranges are those of the standard: FMI 2's Integer has 32 bits, FMI 3's names give the bits.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skillframe.config.units import si, unit_word
from skillframe.errors import InputError, UnknownName

FLOATS = ("Real", "Float64")


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """A variable of an FMU.

    Attributes:
        name, reference: name and value reference; type: "Real", "Float64", "Boolean" ...
        causality: "input", "output", "parameter" ...; size: number of scalars (FMI 3 arrays).
        start: as written, or None; unit, text: unit and description, or "".
    """

    name: str
    reference: int
    type: str
    causality: str
    size: int = 1
    start: str | None = None
    unit: str = ""
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuFacts:
    """Facts of an FMU.

    Attributes:
        path, digest: the file and its SHA-256.
        fmi_version: "2.0", "3.0" ...; name: of the model.
        kinds: of "co_simulation", "model_exchange", "scheduled_execution".
        platforms: folders with a binary; has_sources: carries C sources.
        runs_here: has a binary for this machine.
        saves_state, serializes_state, variable_step, input_derivatives: claimed capabilities.
        variables: by name, without locals if read in a child.
        token, identifier, needs_tool: instantiation token, library name, whether its tool is needed.
        source_files, definitions: C sources and compiler options.
        units: by name, the attributes of a unit's BaseUnit that are not the default: SI exponents, factor, offset.
    """

    path: Path
    digest: str
    fmi_version: str
    name: str
    kinds: tuple[str, ...]
    platforms: tuple[str, ...]
    has_sources: bool
    runs_here: bool
    saves_state: bool
    serializes_state: bool
    variable_step: bool
    input_derivatives: bool
    variables: dict[str, FmuVariable]
    token: str = ""
    identifier: str = ""
    needs_tool: bool = False
    source_files: tuple[str, ...] = ()
    definitions: tuple[str, ...] = ()
    units: dict[str, dict[str, float]] = field(default_factory=dict)

    def names(self, causality: str) -> list[str]:
        """Names of the variables of a causality, in order."""
        return [v.name for v in self.variables.values() if v.causality == causality]

    def variable(self, name: str, causality: str) -> FmuVariable:
        """Variable of a name.

        Raises:
            UnknownName: there is none of that causality.
        """
        found = self.variables.get(name)
        if found is None or found.causality != causality:
            note = f"{name!r} is there as {found.causality}" if found else ""
            raise UnknownName(f"{causality} of {self.path.name}", name, self.names(causality), note)
        return found

    def settable(self, name: str) -> FmuVariable:
        """Parameter or input of a name. Raises `UnknownName`."""
        found = self.variables.get(name)
        if found is not None and found.causality in ("parameter", "input"):
            return found
        note = f"{name!r} is there as {found.causality}" if found else ""
        known = [*self.names("input"), *self.names("parameter")]
        raise UnknownName(f"parameter or input of {self.path.name}", name, known, note)

    def require_runnable(self) -> None:
        """Refuse an FMU that cannot run here.

        Raises:
            InputError: no co-simulation, or no binary for this machine.
        """
        if "co_simulation" not in self.kinds:
            inside = " and ".join(self.kinds) + " only" if self.kinds else "no interface that can be run"
            raise InputError(self.path, f"holds {inside}", "export it as co-simulation")
        if self.runs_here:
            return
        from fmpy import platform, platform_tuple

        here = platform if self.fmi_version.startswith("2") else platform_tuple
        inside = f"holds binaries for {', '.join(self.platforms)}" if self.platforms else "holds no binaries"
        if self.has_sources:
            fix = f"it carries C sources: type skillframe fmu build {self.path}"
        else:
            fix = f"and no sources; ask its maker for {here} or for sources"
        raise InputError(self.path, f"{inside}, this machine is {here}", fix)


WORDS = {"true": True, "false": False, "1": True, "0": False}


def values_of(variable: FmuVariable, value: Any, where: object) -> list[Any]:
    """Values of a parameter or input, converted to its type.

    Raises:
        InputError: wrong length, or the type cannot hold a value.
    """
    values = list(value) if isinstance(value, list | tuple) else [value]
    place = f"{where}: {variable.name}"
    if len(values) != variable.size:
        raise InputError(place, f"holds {variable.size}, got {len(values)}", "give as many values as it holds")
    values = [_in_its_unit(variable, v, place) for v in values]
    try:
        return [converted(variable.type, v) for v in values]
    except (TypeError, ValueError, OverflowError):
        shown = repr(value) if len(repr(value)) < 60 else repr(value)[:60] + " ..."
        raise InputError(place, f"is of type {variable.type}, got {shown}", _advice(variable.type)) from None


def _in_its_unit(variable: FmuVariable, value: Any, place: str) -> Any:
    if not isinstance(value, str) or variable.type not in FLOATS:
        return value
    unit, factor = unit_word(variable.unit) or ("", 1.0)
    number = si(value, unit, place)
    return number if isinstance(number, str) else number / factor


def converted(type_: str, value: Any) -> Any:
    """A plain value as an FMI type.

    Raises:
        TypeError, ValueError, OverflowError: the type cannot hold it.
    """
    if type_ in ("Real", "Float64", "Float32"):
        largest = 3.4028234663852886e38 if type_ == "Float32" else math.inf
        if isinstance(value, bool):
            raise TypeError(value)
        number = float(value)
        if largest < abs(number) < math.inf:
            raise ValueError(value)
        return number
    if type_ == "Boolean":
        if isinstance(value, str):
            value = WORDS.get(value.lower(), value)
        if value not in (0, 1):
            raise ValueError(value)
        return bool(value)
    if type_ == "String":
        if not isinstance(value, str | int | float):
            raise TypeError(value)
        return str(value).lower() if isinstance(value, bool) else str(value)
    if type_ in ("Binary", "Clock"):
        raise TypeError(type_)
    if isinstance(value, bool):
        raise TypeError(value)
    number = int(value)
    least, most = _range(type_)
    if (not isinstance(value, str) and number != value) or not least <= number <= most:
        raise ValueError(value)
    return number


def _range(type_: str) -> tuple[int, int]:
    bits = int(found[0]) if (found := re.findall(r"\d+$", type_)) else 32
    return (0, 2**bits - 1) if type_.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _advice(type_: str) -> str:
    if type_ == "Boolean":
        return "give true or false"
    if type_ == "String":
        return "give text"
    if type_ in ("Binary", "Clock"):
        return "leave it at its start value"
    if type_ == "Enumeration":
        return "give the number of one of its items"
    least, largest = _range(type_) if "nt" in type_ else (0, 0)
    return f"give a whole number from {least} to {largest}" if largest else "give a number"
