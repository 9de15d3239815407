"""The checksums of an MCAP recording, verified before its numbers are believed.

MCAP (https://mcap.dev/spec) can carry three kinds of CRC-32: of each chunk's content as unpacked, of the data section,
and of the summary that indexes it; 0 says that the writer left it out. ROS 1 bags and the SQLite files of ROS 2 have no
checksum: a flipped bit in a number of theirs is another number. What a chunk unpacks to is bounded by what it declares.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from skillframe.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHANNEL, CHUNK, METADATA, DATA_END = 0x02, 0x04, 0x06, 0x0C, 0x0F
READ = ("cdr", "ros1")
"""Encodings of messages that are read: those of ROS 2 and ROS 1."""
FOOTER_LENGTH = 20
LARGEST_CHUNK = 256_000_000
"""Bytes that a chunk may unpack to; writers close one after about a megabyte (our choice)."""
BLOCK = 1 << 20
AGAIN = "take a sound copy of the file, or record it again"
UNPROTECTED = "carries no checksums, so damage to its numbers would not be seen"
_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")


class _Record(NamedTuple):
    """Kind, place of its first byte (its content begins 9 bytes later) and length of the content."""

    kind: int
    start: int
    length: int

    @property
    def content(self) -> int:
        """Place of the content."""
        return self.start + _HEAD.size


def verify(path: Path) -> list[str]:
    """Check every checksum that a file carries.

    Args:
        path: an MCAP file; any other file is passed over.

    Returns:
        a note where numbers stand in the file without a checksum.

    Raises:
        InputError: a checksum does not fit, a chunk declares what it does not hold, or a record is cut off.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return []
        records = list(_records(path, file))
        chunks = [_chunk_is_protected(path, file, record) for record in records if record.kind == CHUNK]
        data = [_data_is_protected(path, file, record, records[0]) for record in records if record.kind == DATA_END]
        _check_summary(path, file, records)
    return [] if any(data) or (chunks and all(chunks)) else [f"{path.name} {UNPROTECTED}"]


def refuse_other_encodings(path: Path) -> None:
    """Refuse a sound MCAP file in which no message is encoded as ROS does, by the names of its encodings.

    Raises:
        InputError: its channels say so. A file without channels in its summary is passed over.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return
        found = dict(_channel(file, record) for record in _records(path, file) if record.kind == CHANNEL)
    if found and not set(found.values()) & set(READ):
        topics = ", ".join(f"{topic} ({encoding or 'no encoding'})" for topic, encoding in sorted(found.items()))
        raise InputError(
            path, f"is an MCAP file without messages of ROS: {topics}",
            "cdr and ros1 are read; export its topics as CSV or JSON lines, and type --columns auto",
        )  # fmt: skip


def _channel(file: BinaryIO, record: _Record) -> tuple[str, str]:
    """Topic and message encoding of a channel."""
    file.seek(record.content)
    content, place, texts = file.read(min(record.length, BLOCK)), 4, []
    for _ in range(2):
        length = int.from_bytes(content[place : place + 4], "little")
        texts.append(content[place + 4 : place + 4 + length].decode("utf-8", "replace"))
        place += 4 + length
    return texts[0], texts[1]


def metadata_record(path: Path, name: str) -> dict[str, str]:
    """What the first metadata record of a name holds, empty where there is none or the file is no MCAP.

    Raises:
        InputError: a record is cut off, or damaged.
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
    """Name, and keys and values in turn, of a metadata record: each with its length before it, as is the map's."""
    texts, place = list[str](), 0
    try:
        while place < len(content):
            length = int.from_bytes(content[place : place + 4], "little")
            texts.append(content[place + 4 : place + 4 + length].decode())
            place += 4 + length + 4 * (len(texts) == 1)  # after the name stands how long the map is
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
    """Check one chunk's checksum and size. Returns False where it carries none."""
    file.seek(record.content)
    content = file.read(record.length)
    try:
        _, _, size, stated, length = _CHUNK.unpack_from(content)
        begin = _CHUNK.size + length
        packed = struct.unpack_from("<Q", content, begin)[0]
        method, body = content[_CHUNK.size : begin].decode(), content[begin + 8 : begin + 8 + packed]
    except (struct.error, UnicodeDecodeError):
        raise _damaged(path, record, "cannot be read") from None
    if size > LARGEST_CHUNK:
        raise _damaged(path, record, f"would unpack to {size} bytes")
    raw = _unpacked(path, record, method, body, size)
    if len(raw) != size:
        raise _damaged(path, record, f"says {size} bytes and holds others")
    if stated and zlib.crc32(raw) != stated:
        raise _damaged(path, record, "does not fit its checksum")
    return bool(stated)


def _unpacked(path: Path, record: _Record, method: str, body: bytes, size: int) -> bytes:
    """What a chunk holds, and at most one byte more than it says."""
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
    """A function of packed bytes and size, from whichever library the installed `rosbags` brings."""
    for name in ("compression.zstd", "backports.zstd"):
        try:
            module = import_module(name)
        except ImportError:
            continue
        return lambda body, size: module.ZstdDecompressor().decompress(body, max_length=size + 1)
    module = import_module("zstandard")
    return lambda body, size: module.ZstdDecompressor().stream_reader(body).read(size + 1)


def _data_is_protected(path: Path, file: BinaryIO, end: _Record, header: _Record) -> bool:
    """Check the data section's checksum. False where there is none. Some writers count it from the file's start.

    Others begin after the magic bytes or after the header; any of the three that fits is right.
    """
    file.seek(end.content)
    stated = int.from_bytes(file.read(4), "little")
    starts = (0, len(MAGIC), header.content + header.length)
    if stated and all(_crc(file, start, end.start) != stated for start in starts):
        raise InputError(path, "is damaged: its data do not fit their checksum", AGAIN)
    return bool(stated)


def _check_summary(path: Path, file: BinaryIO, records: list[_Record]) -> None:
    """The footer's checksum goes from the summary's first byte to the footer's own last field but one."""
    if not records or records[-1].kind != FOOTER or records[-1].length < FOOTER_LENGTH:
        raise InputError(path, "is cut off: it has no end", AGAIN)
    footer = records[-1]
    file.seek(footer.content)
    start, _, stated = struct.unpack("<QQI", file.read(FOOTER_LENGTH))
    if start and stated and _crc(file, start, footer.content + FOOTER_LENGTH - 4) != stated:
        raise InputError(path, "is damaged: its index does not fit its checksum", AGAIN)


def _crc(file: BinaryIO, start: int, stop: int) -> int:
    file.seek(min(start, stop))
    value, left = 0, max(stop - start, 0)
    while left > 0 and (block := file.read(min(BLOCK, left))):
        value, left = zlib.crc32(block, value), left - len(block)
    return value


def _damaged(path: Path, record: _Record, problem: str) -> InputError:
    return InputError(path, f"is damaged: its chunk at byte {record.start} {problem}", AGAIN)
