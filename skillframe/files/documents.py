"""JSON and TOML as plain values that the rest can use: the one place where text from outside is parsed.

Beyond the syntax three things are refused, because they break code far from here: a nesting that recursive code cannot
walk, a whole number beyond 64 bits (TOML promises no more; JSON has no whole numbers, so a longer one becomes a float),
and half of a surrogate pair, which JSON can escape and no file can hold.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from skillframe.errors import InputError

DEEPEST = 100
"""Lists and tables within each other; ours have less than ten (our choice)."""
LARGEST_WHOLE = 2**63 - 1
DIGITS = 18
"""Digits that always fit into 64 bits."""


class NotToml(InputError):
    """Text that is not TOML, as told apart from TOML that holds what we refuse."""


def read_text(path: Path, fix: str = "give a text file") -> str:
    """The text of a file in UTF-8, without a byte order mark.

    Args:
        path: the file.
        fix: what to do if it is no text, for the message.

    Raises:
        InputError: missing, a folder, unreadable, or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except UnicodeDecodeError:
        raise InputError(path, "is a binary file, not text in UTF-8", fix) from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        said = getattr(error, "strerror", None) or error
        raise InputError(path, f"cannot be read as text ({said})", fix) from None


def read_json(path: Path, fix: str) -> Any:
    """The content of a JSON file.

    Args:
        path: the file.
        fix: what to do if it cannot be used, for the message.

    Raises:
        InputError: it cannot be read, is not JSON, or holds what `parse_json` refuses.
    """
    return parse_json(read_text(path, fix), path, fix)


def parse_json(text: str | bytes, where: object, fix: str) -> Any:
    """Plain values from JSON text.

    Args:
        text: the whole document.
        where: for messages.
        fix: what to do if it cannot be used, for the message.

    Raises:
        InputError: it is not JSON (with the line), is nested too deeply, or holds half a surrogate pair.
    """
    try:
        value = json.loads(text, parse_int=_whole)
    except json.JSONDecodeError as error:
        raise InputError(where, _not_json(error), fix) from None
    except UnicodeDecodeError:
        raise InputError(where, "is not text in UTF-8", fix) from None
    except RecursionError:
        raise too_deep(where, fix) from None
    check_plain(value, where, fix)
    return value


def _not_json(error: json.JSONDecodeError) -> str:
    """What is wrong with text that is not JSON, or that the file was cut off."""
    if not error.doc.strip():
        return "is empty"
    cut = not error.doc[error.pos :].strip() or "Unterminated string" in error.msg
    if cut and error.doc.lstrip().startswith(("{", "[")):
        return f"is cut off at line {error.lineno}"
    return f"is not JSON: {error.msg} at line {error.lineno}, column {error.colno}"


def parse_toml(text: str, where: object) -> dict[str, Any]:
    """Plain values from TOML text.

    Raises:
        NotToml: the syntax is wrong (with the line).
        InputError: it is nested too deeply, or holds a number beyond 64 bits.
    """
    try:
        value = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotToml(where, f"is not valid TOML: {error}", "correct that line") from None
    except RecursionError:
        raise too_deep(where, "correct it") from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        raise InputError(where, "holds a number with thousands of digits", "give a number of usual length") from None
    check_plain(value, where, "correct it")
    return value


def too_deep(where: object, fix: str) -> InputError:
    """The refusal of a document whose lists and tables stand too deep within each other."""
    return InputError(where, f"is nested too deeply (more than {DEEPEST} levels)", fix)


def check_plain(value: Any, where: object, fix: str) -> None:
    """Refuse what breaks code that walks or stores plain values.

    Raises:
        InputError: nested too deeply, a whole number beyond 64 bits, or text that cannot be stored; names the key.
    """
    waiting: list[tuple[Any, int, str]] = [(value, 0, "")]
    while waiting:
        item, depth, key = waiting.pop()
        if isinstance(item, (dict, list)):
            if depth >= DEEPEST:
                raise too_deep(where, fix)
            if isinstance(item, dict):
                waiting += [(name, depth + 1, str(name)) for name in item]
            pairs = item.items() if isinstance(item, dict) else ((key, inner) for inner in item)
            waiting += [(inner, depth + 1, name) for name, inner in pairs if type(inner) is not float]
        elif isinstance(item, str) and not storable(item):
            raise InputError(_at(where, key), "holds half a character (a lone surrogate)", "write the text again")
        elif isinstance(item, int) and abs(item) > LARGEST_WHOLE:
            raise InputError(_at(where, key), "is too large a whole number (beyond 64 bits)", "give a smaller number")


def storable(text: str) -> bool:
    """Whether a text can be written to a file: it holds no half of a surrogate pair."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def shown(text: str) -> str:
    """A text that can be stored and printed: what has no character, as in file names of other encodings, is escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def _at(where: object, key: str) -> str:
    return f"{where}: {shown(key)}" if key else str(where)


def _whole(text: str) -> int | float:
    """A whole number of JSON: exact where 64 bits hold it, else the nearest float, infinity beyond all of them."""
    if len(text) <= DIGITS:
        return int(text)
    if len(text) > DIGITS + 2:
        return float(text)
    value = int(text)
    return value if abs(value) <= LARGEST_WHOLE else float(value)
