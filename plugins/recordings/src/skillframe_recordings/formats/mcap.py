"""Checksums of an MCAP recording, verified before its numbers are used.

MCAP (https://mcap.dev/spec) has optional CRC-32 sums of each chunk's unpacked content, the data section, and the
summary; 0 means none. ROS 1 bags and SQLite files have no checksums. A chunk's declared size limits its unpacking.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from skillframe.errors import InputError
from skillframe.files.documents import refuse_bomb

MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHANNEL, CHUNK, CHUNK_INDEX, METADATA, DATA_END = 0x02, 0x04, 0x06, 0x08, 0x0C, 0x0F
READ = ("cdr", "ros1")
"""Supported message encodings: ROS 2 and ROS 1."""
FOOTER_LENGTH = 20
LARGEST_CHUNK = 256_000_000
"""Most unpacked bytes of a chunk; writers use about a megabyte."""
BLOCK = 1 << 20
AGAIN = "take a sound copy of the file, or record it again"
UNPROTECTED = "carries no checksums, so damage to its numbers would not be seen"
_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")


class _Record(NamedTuple):
    """Kind, first byte and content length of a record. The content begins 9 bytes later."""

    kind: int
    start: int
    length: int

    @property
    def content(self) -> int:
        """Place of the content."""
        return self.start + _HEAD.size


def verify(path: Path) -> list[str]:
    """Check every checksum of a file.

    Returns:
        a note if numbers have no checksum.

    Raises:
        InputError: a wrong checksum or chunk size, or a truncated record.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return []
        records = list(_records(path, file))
        stored = [record for record in records if record.kind == CHUNK]
        sizes = list[int]()
        for record in stored:
            file.seek(record.content)
            head = file.read(_CHUNK.size)
            sizes.append(int(_CHUNK.unpack(head)[2]) if len(head) == _CHUNK.size else 0)  # declared, when unpacked
        refuse_bomb(path, file.seek(0, 2), sum(sizes), AGAIN, most=math.inf)
        for record, size in zip(stored, sizes, strict=True):
            refuse_bomb(f"{path}: chunk at byte {record.start}", record.length, size, AGAIN, most=LARGEST_CHUNK)
        named = sum(record.kind == CHUNK_INDEX for record in records)
        if named > len(stored):
            raise InputError(path, f"is damaged: its index names {named} chunks, and it has {len(stored)}", AGAIN)
        chunks = [_chunk_is_protected(path, file, record) for record in records if record.kind == CHUNK]
        data = [_data_is_protected(path, file, record, records[0]) for record in records if record.kind == DATA_END]
        if not records or records[-1].kind != FOOTER or records[-1].length < FOOTER_LENGTH:
            raise InputError(path, "is cut off: it has no end", AGAIN)
        footer = records[-1]
        file.seek(footer.content)
        start, _, stated = struct.unpack("<QQI", file.read(FOOTER_LENGTH))
        if start and stated and _crc(file, start, footer.content + FOOTER_LENGTH - 4) != stated:
            raise InputError(path, "is damaged: its index does not fit its checksum", AGAIN)
    return [] if any(data) or (chunks and all(chunks)) else [f"{path.name} {UNPROTECTED}"]


def refuse_other_encodings(path: Path) -> None:
    """Refuse an intact MCAP file without ROS encodings.

    Raises:
        InputError: its channels name only other encodings. A file without channels in its summary passes.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return
        found = dict(_channel(file, record) for record in _records(path, file) if record.kind == CHANNEL)
    if found and not set(found.values()) & set(READ):
        topics = ", ".join(f"{topic} ({encoding or 'no encoding'})" for topic, encoding in sorted(found.items()))
        raise InputError(
            path, f"is an MCAP file without messages of ROS: {topics}",
            "cdr and ros1 are read; export its topics as CSV or JSON lines, and type --layout auto",
        )  # fmt: skip


def _channel(file: BinaryIO, record: _Record) -> tuple[str, str]:
    file.seek(record.content)
    content, place, texts = file.read(min(record.length, BLOCK)), 4, []
    for _ in range(2):
        length = int.from_bytes(content[place : place + 4], "little")
        texts.append(content[place + 4 : place + 4 + length].decode("utf-8", "replace"))
        place += 4 + length
    return texts[0], texts[1]


def metadata_record(path: Path, name: str) -> dict[str, str]:
    """Return the first metadata record of a name, empty if there is none or the file is no MCAP.

    Raises:
        InputError: a record is truncated or damaged.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return {}
        for record in _records(path, file):
            if record.kind == METADATA:
                file.seek(record.content)
                found, *texts = _texts(path, record, file.read(min(record.length, LARGEST_CHUNK)))
                if found == name:
                    return dict(zip(texts[::2], texts[1::2], strict=False))
    return {}


def _texts(path: Path, record: _Record, content: bytes) -> list[str]:
    """Name, then alternating keys and values, of a metadata record. Lengths precede them."""
    texts, place = list[str](), 0
    try:
        while place < len(content):
            length = int.from_bytes(content[place : place + 4], "little")
            texts.append(content[place + 4 : place + 4 + length].decode())
            place += 4 + length + 4 * (len(texts) == 1)  # the map's length follows the name
    except UnicodeDecodeError:
        raise InputError(path, f"is damaged: its metadata at byte {record.start} are no text", AGAIN) from None
    return texts or [""]


def _records(path: Path, file: BinaryIO) -> Iterator[_Record]:
    size = file.seek(0, 2)
    place = len(MAGIC)
    while place < size - len(MAGIC):
        file.seek(place)
        head = file.read(_HEAD.size)
        kind, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, size)
        if place + _HEAD.size + length > size:
            raise InputError(path, f"is damaged or cut off: its record at byte {place} goes beyond the end", AGAIN)
        yield _Record(kind, place, length)
        if kind == FOOTER:
            return
        place += _HEAD.size + length


def _chunk_is_protected(path: Path, file: BinaryIO, record: _Record) -> bool:
    """Check a chunk's checksum and size. Return False without a checksum."""
    file.seek(record.content)
    content = file.read(record.length)
    try:
        _, _, size, stated, length = _CHUNK.unpack_from(content)
        begin = _CHUNK.size + length
        packed = struct.unpack_from("<Q", content, begin)[0]
        method, body = content[_CHUNK.size : begin].decode(), content[begin + 8 : begin + 8 + packed]
    except (struct.error, UnicodeDecodeError):
        raise _damaged(path, record, "cannot be read") from None
    raw = _unpacked(path, record, method, body, size)
    if len(raw) != size:
        raise _damaged(path, record, f"says {size} bytes and holds others")
    if stated and zlib.crc32(raw) != stated:
        raise _damaged(path, record, "does not fit its checksum")
    return bool(stated)


def _unpacked(path: Path, record: _Record, method: str, body: bytes, size: int) -> bytes:
    try:
        if method == "":
            return body
        if method == "lz4":
            return bytes(import_module("lz4.frame").LZ4FrameDecompressor().decompress(body, max_length=size + 1))
        if method == "zstd":
            return bytes(_zstd()(body, size))
    except (ImportError, InputError):
        raise
    except Exception as error:  # foreign code on foreign bytes: RuntimeError, ZstdError ...
        raise _damaged(path, record, f"cannot be unpacked ({error})") from None
    raise _damaged(path, record, f"is packed by {method!r:.40}, which is not known")


def _zstd() -> Any:
    """A function of packed bytes and size, from the zstd library that `rosbags` uses."""
    for name in ("compression.zstd", "backports.zstd"):
        try:
            module = import_module(name)
        except ImportError:
            continue
        return lambda body, size: module.ZstdDecompressor().decompress(body, max_length=size + 1)
    module = import_module("zstandard")
    return lambda body, size: module.ZstdDecompressor().stream_reader(body).read(size + 1)


def _data_is_protected(path: Path, file: BinaryIO, end: _Record, header: _Record) -> bool:
    """Check the data section's checksum. Return False without one.

    Writers count it from the file's start, after the magic bytes, or after the header; all are accepted.
    """
    file.seek(end.content)
    stated = int.from_bytes(file.read(4), "little")
    starts = (0, len(MAGIC), header.content + header.length)
    if stated and all(_crc(file, start, end.start) != stated for start in starts):
        raise InputError(path, "is damaged: its data do not fit their checksum", AGAIN)
    return bool(stated)


def _crc(file: BinaryIO, start: int, stop: int) -> int:
    file.seek(min(start, stop))
    value, left = 0, max(stop - start, 0)
    while left > 0 and (block := file.read(min(BLOCK, left))):
        value, left = zlib.crc32(block, value), left - len(block)
    return value


def _damaged(path: Path, record: _Record, problem: str) -> InputError:
    return InputError(path, f"is damaged: its chunk at byte {record.start} {problem}", AGAIN)
