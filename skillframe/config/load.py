"""Strict TOML into frozen dataclasses: unknown keys are errors with a suggestion, wrong types say what was expected."""

from __future__ import annotations

import dataclasses
import re
import types
import typing
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from skillframe.config.fields import texts
from skillframe.config.ranges import range_of, require_within
from skillframe.config.units import parse, si, unit_of
from skillframe.errors import InputError, UnknownName
from skillframe.files.documents import NotToml, parse_toml, read_text, shown, storable

T = TypeVar("T")
LARGEST = 1e100
"""Size of a number from outside; beyond it squares overflow."""
BARE_POINT = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")
"""Numbers such as .5 and 2., which people type and TOML does not know."""


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises:
        InputError: missing, not text, not TOML (with the line), or anything that `documents.parse_toml` refuses.
    """
    return parse_toml(read_text(path, "give a TOML file"), path)


def build(cls: type[T], values: Mapping[str, Any], where: str) -> T:
    """An instance of a dataclass from plain values, checked key by key.

    Args:
        cls: the dataclass; its annotations say what is allowed.
        values: as read from TOML or `--set`.
        where: for messages, "file: section".

    Raises:
        InputError: an unknown or missing key, or a value of the wrong type.
    """
    kind: type = cls
    hints, said = _hints(kind), texts(kind)
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}  # type: ignore[arg-type]
    for key in values:
        if key not in fields:
            raise InputError(where, str(UnknownName("key", str(key), fields)))
    ready = {
        key: _value(value, hints[key], said.get(key, ""), f"{where}.{key}") for key, value in values.items()
    }  # fmt: skip
    missing = [n for n, f in fields.items() if n not in ready and _required(f)]
    if missing:
        raise InputError(where, f"missing {', '.join(missing)}", "add it")
    return cls(**ready)


@lru_cache(maxsize=256)
def _hints(cls: type) -> Mapping[str, Any]:
    """Kept, because Python evaluates the annotations again at every call, and a file has a table in every line."""
    return typing.get_type_hints(cls)


def _value(value: Any, hint: Any, about: str, where: str) -> Any:
    """A value of the annotated type, in SI, within the range that the text about its field states."""
    ready = coerce(in_si(value, hint, unit_of(about), where), hint, where)
    require_within(value, ready, unit_of(about), range_of(about), where)
    return ready


def in_si(value: Any, hint: Any, unit: str, where: str) -> Any:
    """Texts with a unit ("8mm") as SI numbers where the type asks for numbers, also in lists and tables.

    Raises:
        InputError: a unit of another dimension.
    """
    if isinstance(value, Mapping) and typing.get_origin(hint) is dict:
        return {key: in_si(inner, typing.get_args(hint)[1], unit, f"{where}.{key}") for key, inner in value.items()}
    if isinstance(value, list | tuple) and not isinstance(hint, type):
        return [in_si(inner, _inner(hint, i), unit, f"{where}[{i}]") for i, inner in enumerate(value)]
    if not isinstance(value, str) or parse(value) is None or not _numeric(hint):
        return value
    return si(value, unit, where)


def _inner(hint: Any, index: int) -> Any:
    """The type of an element of a list or tuple. Of a union, that of its list or tuple."""
    options = [h for h in (hint, *typing.get_args(hint)) if typing.get_origin(h) in (list, tuple)]
    args = typing.get_args(options[0]) if options else ()
    return args[min(index, len(args) - 1)] if args and args[-1] is not Ellipsis else args[0] if args else Any


def _numeric(hint: Any) -> bool:
    """Whether a number is asked for, and no text."""
    kinds = (hint, *typing.get_args(hint))
    return str not in kinds and (float in kinds or int in kinds)


def _required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


WORDS = {float: "a number", int: "a whole number", str: "text", bool: "true or false", Path: "a path"}


def coerce(value: Any, hint: Any, where: str) -> Any:
    """A plain value as the annotated type, or `InputError` that says what was expected."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        return _coerce_union(value, args, where)
    if origin is typing.Literal:
        if value not in args:
            raise InputError(where, str(UnknownName("value", str(value), map(str, args))))
        return value
    if origin in (tuple, list):
        return _coerce_sequence(value, origin, args, where)
    if origin is dict:
        if not isinstance(value, Mapping):
            raise InputError(where, f"expected a table, got {value!r}")
        return {str(k): coerce(v, args[1], f"{where}.{k}") for k, v in value.items()}
    if dataclasses.is_dataclass(hint):
        if not isinstance(value, Mapping):
            raise InputError(where, f"expected a table, got {value!r}")
        return build(hint, value, where)  # type: ignore[type-var, arg-type]
    return _coerce_scalar(value, hint, where)


def _coerce_union(value: Any, args: tuple[Any, ...], where: str) -> Any:
    if value is None and type(None) in args:
        return None
    problem: InputError | None = None
    for option in (a for a in args if a is not type(None)):
        try:
            return coerce(value, option, where)
        except InputError as error:
            problem = error
    raise problem or InputError(where, f"unexpected value {value!r}")


def _coerce_sequence(value: Any, origin: type, args: tuple[Any, ...], where: str) -> Any:
    if isinstance(value, Mapping):
        name = where.rpartition(".")[2]
        raise InputError(where, "expected a list of tables, got one table", f"write [[{name}]] in place of [{name}]")
    if not isinstance(value, list | tuple):
        raise InputError(where, f"expected a list, got {value!r}")
    if origin is list or (len(args) == 2 and args[1] is Ellipsis):
        return origin(coerce(v, args[0], f"{where}[{i}]") for i, v in enumerate(value))
    if len(value) != len(args):
        raise InputError(where, f"expected {len(args)} values, got {len(value)}")
    return tuple(coerce(v, a, f"{where}[{i}]") for i, (v, a) in enumerate(zip(value, args, strict=True)))


def _coerce_scalar(value: Any, hint: Any, where: str) -> Any:
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
    raise InputError(where, f"expected {WORDS.get(hint, getattr(hint, '__name__', hint))}, got {value!r}")


def parse_setting(text: str) -> tuple[str, Any]:
    """`KEY=VALUE` from the command line. The value is read as TOML, or kept as text where it is none.

    Raises:
        InputError: there is no "=", or the value is beyond what a file may hold, such as a number of 41 digits.
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
    """Numbers from "A,B,...", empty where one of them is none that anything could be computed with."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(abs(number) <= LARGEST for number in numbers) else ()
