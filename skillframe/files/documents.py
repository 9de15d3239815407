"""Documents from outside: JSON and TOML as plain values, npz files as arrays.

Refused are deep nesting, which breaks recursive code, integers beyond 64 bits (floats in JSON), and lone surrogates,
which no file can hold.

`kind_of` recognises skillframe's own files by content, to name a file given in place of another.

Of npz files nothing is unpickled. The declared sizes of their arrays are summed before unpacking, against
decompression bombs.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError

DEEPEST = 100
DEEP = re.compile(rf"(?:[\[{{][^\[\]{{}}]*){{{DEEPEST + 1}}}")
"""Most levels of nesting; skillframe's files have ten."""
LARGEST_WHOLE = 2**63 - 1
DIGITS = 18
"""Digits that always fit 64 bits."""


class NotToml(InputError):
    """Text is not TOML, in contrast to refused content."""


def read_text(path: Path, fix: str = "give a text file") -> str:
    """UTF-8 text of a file, without byte order mark. `fix` is advice for the message.

    Raises:
        InputError: missing, a folder, unreadable, or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except UnicodeDecodeError:
        raise InputError(path, "is a binary file, not text in UTF-8", fix) from None
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(path, f"cannot be read as text ({said})", fix) from None


def read_json(path: Path, fix: str) -> Any:
    """Content of a JSON file. `fix` is advice for the message.

    Raises:
        InputError: unreadable, or as `parse_json`.
    """
    return parse_json(read_text(path, fix), path, fix)


def parse_json(text: str | bytes, where: object, fix: str) -> Any:
    """Plain values from JSON text. `where` and `fix` are for the message.

    Raises:
        InputError: not JSON, nested too deeply, or a lone surrogate.
    """
    try:
        value = json.loads(text, parse_int=_whole)
    except json.JSONDecodeError as error:
        if DEEP.search(error.doc):
            raise too_deep(where, fix) from None
        raise InputError(where, _not_json(error), fix) from None
    except UnicodeDecodeError:
        raise InputError(where, "is not text in UTF-8", fix) from None
    except RecursionError:
        raise too_deep(where, fix) from None
    check_plain(value, where, fix)
    return value


def _not_json(error: json.JSONDecodeError) -> str:
    if not error.doc.strip():
        return "is empty"
    cut = not error.doc[error.pos :].strip() or "Unterminated string" in error.msg
    if cut and error.doc.lstrip().startswith(("{", "[")):
        return f"is cut off at line {error.lineno}"
    return f"is not JSON: {error.msg} at line {error.lineno}, column {error.colno}"


def parse_toml(text: str, where: object) -> dict[str, Any]:
    """Plain values from TOML text.

    Raises:
        NotToml: wrong syntax.
        InputError: nested too deeply, or a number beyond 64 bits.
    """
    try:
        value = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        if DEEP.search(text):
            raise too_deep(where, "correct it") from None
        raise NotToml(where, f"is not valid TOML: {error}", "correct that line") from None
    except RecursionError:
        raise too_deep(where, "correct it") from None
    except ValueError:
        raise InputError(where, "holds a number with thousands of digits", "give a number of usual length") from None
    check_plain(value, where, "correct it")
    return value


def too_deep(where: object, fix: str) -> InputError:
    """Error for excessive nesting."""
    return InputError(where, f"is nested too deeply (more than {DEEPEST} levels)", fix)


def check_plain(value: Any, where: object, fix: str) -> None:
    """Refuse plain values that break other code.

    Raises:
        InputError: nested too deeply, an integer beyond 64 bits, or a lone surrogate; names the key.
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
    """Whether a text has no lone surrogates, so that files can hold it."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def shown(text: str) -> str:
    """Printable text, with lone surrogates (file names of other encodings) escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def _at(where: object, key: str) -> str:
    return f"{where}: {shown(key)}" if key else str(where)


def _whole(text: str) -> int | float:
    """JSON integer: exact within 64 bits, else the nearest float or infinity."""
    if len(text) <= DIGITS:
        return int(text)
    if len(text) > DIGITS + 2:
        return float(text)
    value = int(text)
    return value if abs(value) <= LARGEST_WHOLE else float(value)


COMMANDS = {
    "skill": "skillframe show {}",
    "campaign": "skillframe campaign run {} --out FOLDER, or certify run",
    "task": "skillframe certify run {} --out FOLDER",
    "fixture": "skillframe worlds {}",
    "robot": "skillframe robots {} --check",
}
"""Command for each kind of file."""


def refuse_other(path: Path, wanted: str) -> None:
    """Refuse a TOML or JSON file of another kind than wanted.

    Raises:
        InputError: names both kinds, and the command for this file.
    """
    found = kind_of(path)
    if found not in ("", wanted):
        fix = f"give the {wanted}, or type {COMMANDS[found].format(path)}"
        raise InputError(path, f"is a {found} file, and a {wanted} is wanted here", fix)


def kind_of(path: Path) -> str:
    """Kind of a file, or "" if none or unreadable."""
    readers: Mapping[str, Any] = {".toml": tomllib.loads, ".json": json.loads}
    try:
        # larger ones are recordings in JSON, and a pipe would be waited for
        if path.suffix not in readers or not path.is_file() or path.stat().st_size > 1_000_000:
            return ""
        values = readers[path.suffix](path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return ""
    if not isinstance(values, dict):
        return ""
    marks = {
        "skill": values.get("format") == "skillframe.skill", "robot": "urdf" in values, "campaign": "skills" in values,
        "task": "teacher" in values or "demonstrations" in values, "fixture": {"fixture", "tool"} <= values.keys(),
    }  # fmt: skip
    return next((kind for kind, is_one in marks.items() if is_one), "")


MOST_BYTES = 1_000_000_000
"""Largest unpacked size in bytes (an hour at 1 kHz with 30 columns)."""
SMALL = 64_000_000
"""Unpacked bytes always allowed (constant columns pack well)."""
RATIO = 100
"""Largest ratio of unpacked to packed bytes beyond `SMALL`; recordings reach 10."""
NUMBER = 8
"""Bytes of a number."""


def refuse_bomb(path: Path | str, packed: int, unpacked: int, fix: str, most: float = MOST_BYTES) -> None:
    """Refuse a file, or a part, by its packed and unpacked bytes. `most` is infinity if read in parts.

    Raises:
        InputError: with both sizes.
    """
    if unpacked > min(most, max(SMALL, RATIO * packed)):
        raise InputError(path, f"has {packed} bytes and would unpack to {unpacked}, which no recording does", fix)


ENDING = ".npy"
Arrays = dict[str, NDArray[Any]]


def read_arrays(path: Path, kind: str, fix: str) -> Arrays:
    """Every array of an npz file, by name. `kind` and `fix` are for messages.

    Raises:
        InputError: missing, not npz, damaged, with Python objects, or too large.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError(path, "is a folder", "give a file")
        if not size:
            raise InputError(path, "is empty", fix)
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            names = [info.filename for info in members]
            if len(members) > 1000:
                raise InputError(path, f"holds {len(members)} arrays, and 1000 are allowed", fix)
            if len(set(names)) != len(names):
                raise InputError(path, "holds two arrays of one name", fix)
            refuse_bomb(path, size, sum(info.file_size for info in members), fix)
            for info in members:
                if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise InputError(path, f"{info.filename!r} is packed in another way than npz files are", fix)
            return {info.filename.removesuffix(ENDING): _array(archive, info) for info in archive.infolist()}
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except (InputError, MemoryError):  # not the file's fault
        raise
    except Exception as error:  # foreign bytes: BadZipFile, zlib.error, EOFError, SyntaxError, struct.error ...
        said = " ".join(str(error).split())[:120]
        problem = f"is not a readable {kind}, or is damaged" + (f" ({said})" if said else "")
        raise InputError(path, problem, fix) from None


def json_member(path: Path, arrays: Arrays, fix: str) -> dict[str, Any] | None:
    """JSON object in the text of the array `meta`, or None for other content.

    Raises:
        InputError: invalid JSON, or as `documents.parse_json`.
    """
    array = arrays["meta"]
    if array.size != 1 or array.dtype.kind not in "US":
        return None
    text = array.reshape(-1)[0]
    try:
        value = parse_json(text if isinstance(text, bytes) else str(text), f"{path}: meta", fix)
    except InputError as error:
        raise InputError(error.where, f"is not a JSON object ({error.problem})", fix) from None
    return value if isinstance(value, dict) else None


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(info) as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)
        if dtype.hasobject:
            raise ValueError("it holds Python objects, which are never loaded")
        declared, held = math.prod(shape) * dtype.itemsize, info.file_size - file.tell()
        if declared != held or min(shape, default=0) < 0:
            raise ValueError(f"{info.filename} says {declared} bytes and holds {held}")
    with archive.open(info) as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        return array


def read_bytes(path: Path, kind: str = "a URDF") -> bytes:
    """Content of an XML file.

    Raises:
        InputError: unreadable, empty, binary or too large.
    """
    if path.is_dir():
        raise InputError(path, "is a folder", f"give {kind} file in it")
    try:
        if path.stat().st_size > 64 * 2**20:  # the largest humanoids are below 1 MB
            raise InputError(path, "is larger than 64 MB", f"is it {kind}?")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    if not content.strip():
        raise InputError(path, "is empty", f"give {kind}")
    if b"\0" in content[:1024] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(path, f"is a binary file, not {kind}", f"give {kind} itself, which is XML text")
    return content


def parse_xml(path: Path, content: bytes, text: bool = False) -> ET.Element:
    """Element tree by expat, without namespaces.

    Document types are refused before entities expand. `text` keeps the text between elements.

    Raises:
        InputError: invalid XML, or a document type.
    """
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()

    def refuse(*_: object) -> NoReturn:
        raise InputError(f"{path}: line {parser.CurrentLineNumber}", "has a document type (DOCTYPE)", "remove it")

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    if text:
        parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        where = f"{path}: line {error.lineno}"
        raise InputError(where, f"is not valid XML ({expat.ErrorString(error.code)})", "correct that line") from None
    except (LookupError, ValueError) as error:
        raise InputError(path, f"is in an encoding that cannot be read ({error})", "save it as UTF-8") from None
    return builder.close()
