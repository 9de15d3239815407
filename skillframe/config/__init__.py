"""Strict reading of TOML tables and text into frozen dataclasses.

The docstring of a dataclass gives unit and range of each field.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import reprlib
import types
import typing
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from skillframe.config.units import Range, range_of, require_within, si, unit_of
from skillframe.errors import InputError, UnknownName
from skillframe.files.documents import NotToml, parse_toml, read_text, shown, storable

ENTRY = re.compile(r"    (\w[\w, ]*): (.*)")


def settings_of(kind: type) -> Iterator[dict[str, Any]]:
    """Yield of each field `name`, `default` (or None), `about`, `unit` (SI or "") and `range`.

    The range is (least, most) in SI, or None.
    """
    said = texts(kind)
    for field in dataclasses.fields(kind):
        factory = field.default_factory
        default = factory() if factory is not dataclasses.MISSING else field.default
        required, about = default is dataclasses.MISSING, said.get(field.name, "")
        limits = range_of(about)
        yield {
            "name": field.name, "default": None if required else default, "about": about, "unit": unit_of(about),
            "range": None if limits is None else limits[:2],
        }  # fmt: skip


def require_ranges(given: Any, where: str) -> None:
    """Refuse a dataclass with a number out of its documented range.

    Raises:
        InputError: names the first such field.
    """
    for row in settings_of(type(given)) if given is not None else ():
        value, limits = getattr(given, row["name"]), row["range"]
        require_within(value, value, row["unit"], limits and Range(*limits), f"{where}.{row['name']}")


@lru_cache(maxsize=256)
def texts(kind: type) -> Mapping[str, str]:
    """Entries of "Attributes:" in the docstrings of a dataclass and its bases. Several names may share one."""
    said: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        names: list[str] = []
        for line in inspect.cleandoc(each.__doc__ or "").partition("Attributes:\n")[2].splitlines():
            entry = ENTRY.fullmatch(line)
            names = entry[1].split(", ") if entry else names
            said |= {n: entry[2] if entry else f"{said.get(n, '')} {line.strip()}".strip() for n in names}
    return said


_T = TypeVar("_T")
LARGEST = 1e100
"""Largest number from outside, whose square does not overflow."""
BARE_POINT = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")
"""Numbers such as .5 and 2., which TOML lacks."""


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises:
        InputError: missing, not text, or as `documents.parse_toml`.
    """
    return parse_toml(read_text(path, "give a TOML file"), path)


def build(cls: type[_T], values: Mapping[str, Any], where: str) -> _T:
    """Instance of a dataclass from plain values. `where`, "file: section", is for messages.

    Raises:
        InputError: unknown or missing key, or a value of the wrong type.
    """
    kind: type = cls
    hints, said = _hints(kind), texts(kind)
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}  # type: ignore[arg-type]
    for key in values:
        if key not in fields:
            raise InputError(where, str(UnknownName("key", str(key), fields)))
    ready = {}
    for key, value in values.items():
        about, place = said.get(key, ""), f"{where}.{key}"
        ready[key] = coerce(in_si(value, hints[key], unit_of(about), place), hints[key], place)
        require_within(value, ready[key], unit_of(about), range_of(about), place)
    missing = [
        n
        for n, f in fields.items()
        if n not in ready and (f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING)
    ]
    if missing:
        raise InputError(where, f"missing {', '.join(missing)}", "add it")
    return cls(**ready)


@lru_cache(maxsize=256)
def _hints(cls: type) -> Mapping[str, Any]:
    return typing.get_type_hints(cls)


def in_si(value: Any, hint: Any, unit: str, where: str) -> Any:
    """Convert texts with units ("8mm") to SI where numbers are expected, also in lists and tables.

    Raises:
        InputError: a unit of another dimension.
    """
    if isinstance(value, Mapping) and typing.get_origin(hint) is dict:
        return {key: in_si(inner, typing.get_args(hint)[1], unit, f"{where}.{key}") for key, inner in value.items()}
    if isinstance(value, list | tuple) and not isinstance(hint, type):
        return [in_si(inner, _inner(hint, i), unit, f"{where}[{i}]") for i, inner in enumerate(value)]
    kinds = (hint, *typing.get_args(hint))
    numeric = str not in kinds and (float in kinds or int in kinds)
    return si(value, unit, where) if isinstance(value, str) and numeric else value


def _inner(hint: Any, index: int) -> Any:
    options = [h for h in (hint, *typing.get_args(hint)) if typing.get_origin(h) in (list, tuple)]
    args = typing.get_args(options[0]) if options else ()
    return args[min(index, len(args) - 1)] if args and args[-1] is not Ellipsis else args[0] if args else Any


WORDS = {float: "a number", int: "a whole number", str: "text", bool: "true or false", Path: "a path"}


def coerce(value: Any, hint: Any, where: str) -> Any:
    """Value as the annotated type. Raises `InputError` with the expected one."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in args:
            return None
        problem: InputError | None = None
        for option in (a for a in args if a is not type(None)):
            try:
                return coerce(value, option, where)
            except InputError as error:
                problem = error
        raise problem or InputError(where, f"unexpected value {value!r}")
    if origin is typing.Literal:
        if value not in args:
            raise InputError(where, str(UnknownName("value", str(value), map(str, args))))
        return value
    if origin in (tuple, list):
        if isinstance(value, Mapping):
            name = where.rpartition(".")[2]
            raise InputError(
                where, "expected a list of tables, got one table", f"write [[{name}]] in place of [{name}]"
            )
        if not isinstance(value, list | tuple):
            raise InputError(where, f"expected a list, got {reprlib.repr(value)}")
        if origin is list or (len(args) == 2 and args[1] is Ellipsis):
            return origin(coerce(v, args[0], f"{where}[{i}]") for i, v in enumerate(value))
        if len(value) != len(args):
            raise InputError(where, f"expected {len(args)} values, got {len(value)}")
        return tuple(coerce(v, a, f"{where}[{i}]") for i, (v, a) in enumerate(zip(value, args, strict=True)))
    if origin is dict:
        if not isinstance(value, Mapping):
            raise InputError(where, f"expected a table, got {reprlib.repr(value)}")
        return {str(k): coerce(v, args[1], f"{where}.{k}") for k, v in value.items()}
    if dataclasses.is_dataclass(hint):
        if not isinstance(value, Mapping):
            raise InputError(where, f"expected a table, got {reprlib.repr(value)}")
        return build(hint, value, where)  # type: ignore[type-var, arg-type]
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            raise InputError(where, "is too large a number", "give a finite number") from None
        if number != number:
            raise InputError(where, "is not a number (NaN)", "give a finite number")
        return number
    if hint is Path and isinstance(value, str):
        return Path(value)
    if hint in (int, str, bool) and type(value) is hint:
        return value
    raise InputError(where, f"expected {WORDS.get(hint, getattr(hint, '__name__', hint))}, got {reprlib.repr(value)}")


def parse_setting(text: str) -> tuple[str, Any]:
    """`KEY=VALUE` from the command line, with the value as TOML or else text.

    Raises:
        InputError: no "=", or a value that files may not hold.
    """
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise InputError(f"--set {text}", "is not KEY=VALUE", "write for example --set world.friction=0.3")
    if not storable(text):
        raise InputError(f"--set {shown(text)}", "is not text in UTF-8", "type it again")
    try:
        return key.strip(), parse_toml(f"x = {value}", f"--set {text:.80}")["x"]
    except NotToml:
        value = value.strip()
        return key.strip(), float(value) if BARE_POINT.fullmatch(value) else value


def parse_numbers(text: str) -> tuple[float, ...]:
    """Numbers from "A,B,...", empty if one is invalid."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(abs(number) <= LARGEST for number in numbers) else ()
