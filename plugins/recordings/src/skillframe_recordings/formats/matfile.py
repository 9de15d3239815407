"""Intact variables of a MATLAB file, version 4 or 5: scipy's reader trusts sizes and can crash on damage.

Version 5 has a header of 128 bytes, then elements (tag and data, padded to 8 bytes): arrays, possibly packed, with
flags, shape, name and data. Version 4 has headers of five numbers with name and data (MathWorks, "MAT-File Format").
Sparse arrays, objects and functions are not read.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from skillframe.files.documents import refuse_bomb

MATRIX, PACKED, HEADER = 14, 15, 128
CELL, STRUCT, CHAR = 1, 2, 4
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a number by type."""
SIZES_4 = (8, 4, 4, 2, 2, 1)
SAVE = "check what wrote it, or save it with -v4"


class _Element(NamedTuple):
    """Type and data of an element, and the place of the next."""

    kind: int
    data: memoryview
    next: int


def whole_variables(content: bytes, source: str = "") -> list[str]:
    """Return the names of the readable variables in order.

    Raises:
        ValueError: what does not fit, and where.
        InputError: its unpacked size exceeds `files.limits`.
    """
    if len(content) < HEADER or 0 in content[:4]:
        return list(_version_4(content))
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or content[125 if order == "<" else 124] != 1:
        raise ValueError("no header of version 4, 5 or 7")
    names, view, elements, at = list[str](), memoryview(content), list[_Element](), HEADER
    while at < len(content):
        elements.append(_element(view, at, order))
        at = elements[-1].next
    refuse_bomb(source, len(content), sum(_size(element, order) for element in elements), SAVE)
    for element in elements:
        data = element.data
        if element.kind == PACKED:
            size = _size(element, order)
            unpack = zlib.decompressobj()
            made = unpack.decompress(data, size + 8)
            if not unpack.eof:
                raise ValueError(f"a packed array that is cut off, or larger than the {size} bytes that it says")
            inner = _element(memoryview(made), 0, order)
            element, data = inner, inner.data
        if element.kind != MATRIX:
            raise ValueError(f"an element of type {element.kind} where an array belongs")
        name = _array(data, order, 0)
        names += [name] if name is not None else []
    return names


def _size(element: _Element, order: str) -> int:
    """Unpacked bytes of an element by its own tag, which limits unpacking."""
    if element.kind != PACKED:
        return len(element.data)
    tag = zlib.decompressobj().decompress(element.data, 8)
    if len(tag) < 8:
        raise ValueError("a packed array that is cut off")
    kind, length = struct.unpack(f"{order}2I", tag)
    return 8 if kind >> 16 else 8 + int(length) + -length % 8


def _element(view: memoryview, at: int, order: str) -> _Element:
    if len(view) - at < 8:
        raise ValueError(f"a tag that is cut off at byte {at}")
    kind, length = struct.unpack_from(f"{order}2I", view, at)
    if kind >> 16:  # up to four bytes within the tag
        kind, length, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
        if length > 4:
            raise ValueError(f"a small element of {length} bytes")
    else:
        begin = at + 8
        end = begin + length + (0 if kind == PACKED else -length % 8)  # packed arrays are not padded
    if begin + length > len(view):
        raise ValueError(f"an element of {length} bytes at byte {at}, where {len(view) - begin} are left")
    return _Element(kind, view[begin : begin + length], min(end, len(view)))


def _array(view: memoryview, order: str, depth: int) -> str | None:
    """The name of an array whose data fit its shape, or None for an unsupported class."""
    if depth > 32:
        raise ValueError(f"arrays {depth} deep in each other")
    if not len(view):
        return ""  # an empty cell
    flags = _element(view, 0, order)
    if flags.kind != 6 or len(flags.data) != 8:
        raise ValueError("an array without flags")
    bits = struct.unpack_from(f"{order}I", flags.data)[0]
    if bits & 0xFF not in (CELL, STRUCT, CHAR, *range(6, 16)):
        return None
    shape = _element(view, flags.next, order)
    if shape.kind != 5 or len(shape.data) % 4 or not 8 <= len(shape.data) <= 128:
        raise ValueError("an array without a shape")
    count = 1
    for size in struct.unpack(f"{order}{len(shape.data) // 4}i", shape.data):
        if size < 0:
            raise ValueError(f"a shape with {size}")
        count *= size
    name = _element(view, shape.next, order)
    if name.kind != 1:
        raise ValueError("an array without a name")
    return bytes(name.data).decode("latin-1") if _content(view, name.next, order, bits, count, depth) else None


def _content(view: memoryview, at: int, order: str, bits: int, count: int, depth: int) -> bool:
    kind = bits & 0xFF
    if kind in (CELL, STRUCT):
        fields = 1
        if kind == STRUCT:
            said = _element(view, at, order)
            width = struct.unpack(f"{order}i", said.data)[0] if said.kind == 5 and len(said.data) == 4 else 0
            if not 1 <= width <= 256:
                raise ValueError("a struct without the length of its names")
            at = said.next
            names = _element(view, at, order)
            if names.kind != 1 or len(names.data) % width:
                raise ValueError("a struct without names of its fields")
            fields, at = len(names.data) // width, names.next
        return all(_inside(view, at, order, count * fields, depth))
    for _ in range(2 if bits & 0x0800 and kind != CHAR else 1):  # real and imaginary part
        data = _element(view, at, order)
        size = SIZES.get(data.kind)
        if size is None or (kind != CHAR and len(data.data) != count * size) or len(data.data) % size:
            raise ValueError(f"{len(data.data)} bytes of type {data.kind} for {count} numbers")
        if kind == CHAR and len(data.data) > 4 * count:
            raise ValueError(f"{len(data.data)} bytes for {count} letters")
        at = data.next
    return True


def _inside(view: memoryview, at: int, order: str, count: int, depth: int) -> Iterator[bool]:
    if count > len(view):
        raise ValueError(f"{count} arrays in {len(view)} bytes")
    for _ in range(count):
        element = _element(view, at, order)
        if element.kind != MATRIX:
            raise ValueError(f"an element of type {element.kind} where an array belongs")
        at = element.next
        yield _array(element.data, order, depth + 1) is not None


def _version_4(content: bytes) -> Iterator[str]:
    """Names of the full numeric matrices in a file of version 4."""
    at = 0
    order = "<" if len(content) >= 4 and 0 <= struct.unpack("<i", content[:4])[0] < 5000 else ">"
    while at < len(content):
        if len(content) - at < 20:
            raise ValueError(f"a header that is cut off at byte {at}")
        kind, rows, columns, two, length = struct.unpack_from(f"{order}5i", content, at)
        number = kind // 10 % 10
        if not 0 <= kind < 5000 or number >= len(SIZES_4) or kind % 10 > 2 or two not in (0, 1):
            raise ValueError(f"no header of version 4 at byte {at}")
        size = rows * columns * SIZES_4[number] * (1 + two)
        if min(rows, columns) < 0 or not 1 <= length <= 256 or at + 20 + length + size > len(content):
            raise ValueError(f"an array of {rows} x {columns} numbers at byte {at}, where {len(content) - at} are left")
        if kind % 10 == 0:
            yield content[at + 20 : at + 20 + length].split(b"\0")[0].decode("latin-1")
        at += 20 + length + size
