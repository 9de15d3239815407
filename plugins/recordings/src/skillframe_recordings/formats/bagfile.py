"""Contents of a ROS bag: topics, messages by header stamp, transforms, and damage.

`rosbags` reads it without ROS. Its exceptions on foreign bytes become `InputError`.

The unpacked size is limited before a library unpacks it (of MCAP files: `mcap`). ROS 1 packs chunks by bz2 or lz4 with
a stated size; ROS 2 packs files or messages by zstd. Stated sizes can be wrong, so data are unpacked here once, in
blocks, up to the limit. SQLite columns can be computed, so their blobs must fit into the file.
"""

from __future__ import annotations

import bz2
import math
import sqlite3
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, MissingDependency
from skillframe.files.documents import RATIO, SMALL, refuse_bomb
from skillframe_recordings.formats.folders import BAG_FACTS
from skillframe_recordings.formats.mcap import BLOCK, LARGEST_CHUNK, refuse_other_encodings, verify

MAGIC = {".bag": b"#ROSBAG V2.0\n", ".db3": b"SQLite format 3\0", ".mcap": b"\x89MCAP0\r\n"}
TREES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

AGAIN = "do not trust this file, or record it again"
WAYS: dict[str, Callable[[], Any]] = {
    "bz2": bz2.BZ2Decompressor, "lz4": lambda: import_module("lz4.frame").LZ4FrameDecompressor(),
}  # fmt: skip
"""Decompressors of ROS 1 chunks."""


class Recorded(NamedTuple):
    """A topic's messages in the order of their stamps [ns], and their frame.

    Messages of kind "tf" are rows of position and quaternion.

    Attributes:
        stamps: of the headers, or `received` without stamps.
        received: time of writing into the bag [ns].
        frame: `frame_id` of the headers.
        child: the frame of the pose, if given.
        stamped: whether headers have stamps.
    """

    topic: str
    kind: str
    stamps: NDArray[np.int64]
    received: NDArray[np.int64]
    messages: Any
    frame: str
    child: str = ""
    stamped: bool = True

    def by_receipt(self) -> Recorded:
        """Return the messages ordered by their receive time."""
        order = np.argsort(self.received, kind="stable")
        received = self.received[order]
        rows = isinstance(self.messages, np.ndarray)
        messages = self.messages[order] if rows else [self.messages[i] for i in order]
        return self._replace(stamps=received, received=received, messages=messages)


def parts_note(path: Path) -> list[str]:
    """Return a note if a file is one of several parts of its bag."""
    facts = path.parent / BAG_FACTS
    words = facts.read_text("utf-8", "replace").split() if facts.is_file() and path.is_file() else []
    parts = {word for word in words if word.endswith((".db3", ".mcap"))}
    return [f"{path.name} is one of {len(parts)} parts of its bag; give the folder to read all"] * (len(parts) > 1)


def refuse_other_files(path: Path) -> None:
    """Refuse a file that its first bytes show is not a bag. Folders are accepted as ROS 2 bags."""
    if path.is_dir():
        return
    magic = MAGIC[path.suffix.lower()]
    try:
        with path.open("rb") as file:
            head = file.read(len(magic))
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    if not head:
        raise InputError(path, "is empty", "record it again")
    if head != magic:
        raise InputError(path, f"is no {path.suffix} recording", "check what wrote it; ROS 1 bags must be version 2.0")


def checksum_notes(path: Path) -> list[str]:
    """Check sizes and MCAP checksums, and return notes on files without checksums.

    Raises:
        InputError: damage, too many unpacked bytes, or no ROS messages.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix.lower() == ".mcap" else []
    with _foreign(path):
        refuse_packed_files(path)
        notes = [note for file in files for note in verify(file)]
        for file in files:
            refuse_other_encodings(file)
    return notes


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open a bag for reading.

    Raises:
        InputError: damaged or truncated.
        MissingDependency: `rosbags` is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise _no_rosbags(path) from None
    with _foreign(path):
        bag = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))  # older .db3 carry no types
        bag.open()
    try:
        with _foreign(path):
            refuse_packed_messages(path, bag)
        yield bag
    finally:
        bag.close()


def _no_rosbags(path: Path) -> MissingDependency:
    return MissingDependency("rosbags", f"reading {path}", "pip install 'skillframe-recordings[ros]'")


@contextmanager
def _foreign(path: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except ImportError:
        raise _no_rosbags(path) from None
    except Exception as error:  # foreign code on foreign bytes: struct.error, apsw errors, TypeError ...
        first = str(error).strip().splitlines()
        whole = path.is_file() and (path.parent / BAG_FACTS).is_file()
        folder = f"its messages may be packed: give its folder, {path.parent}, or record it again"
        said = f"{type(error).__name__}: {first[0]}" if first else type(error).__name__
        raise InputError(
            path,
            f"cannot be read as a ROS bag ({said})",
            folder if whole else "it may be cut off or damaged: reindex it, or record it again",
        ) from None


@contextmanager
def fields_of(path: Path, topic: str, kind: str) -> Iterator[None]:
    """Guard access to message fields, whose definitions in the bag may be damaged.

    Raises:
        InputError: a field is missing or has another type.
    """
    try:
        yield
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: {topic}", f"its messages are no {kind} as ROS defines it ({error})",
            "it may be damaged: record it again, or choose another topic",
        ) from None  # fmt: skip


def topics_of(path: Path, bag: Any) -> dict[str, str]:
    """Return message types by topic.

    Raises:
        InputError: the bag is damaged or empty.
    """
    with _foreign(path):
        topics = {name: str(info.msgtype) for name, info in bag.topics.items()}
        empty = bag.message_count == 0
    if empty:
        raise InputError(path, "holds no messages", "record it again, and check that the topics are published")
    return topics


def messages_of(path: Path, bag: Any, topic: str) -> list[Any]:
    """Return a topic's messages in the order of receipt. Raises as `received_of`."""
    return [message for _, message in received_of(path, bag, topic)]


def received_of(path: Path, bag: Any, topic: str) -> list[tuple[int, Any]]:
    """Return a topic's messages with receive times [ns], in this order.

    Raises:
        InputError: they are damaged.
    """
    with _foreign(path):
        connections = [c for c in bag.connections if c.topic == topic]
        return [(time, bag.deserialize(raw, c.msgtype)) for c, time, raw in bag.messages(connections)]


def read_topic(path: Path, bag: Any, topic: str, kind: str, notes: list[str]) -> Recorded:
    """Return a topic's messages, sorted by header stamps if present. A note reports reordering.

    Raises:
        InputError: they are missing or damaged.
    """
    found = received_of(path, bag, topic)
    received, messages = np.array([time for time, _ in found], dtype=np.int64), [message for _, message in found]
    if not messages:
        raise InputError(f"{path}: {topic}", "holds no messages", "choose another topic, or record it again")
    if not all(hasattr(getattr(m, "header", None), "stamp") for m in messages):
        raise InputError(f"{path}: {topic}", "holds messages without a header", "choose another topic")
    with fields_of(path, topic, kind):
        times = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages]
        stamps, frame = np.array(times, dtype=np.int64), str(messages[0].header.frame_id)
    child = str(getattr(messages[0], "child_frame_id", ""))
    if not np.any(stamps):
        return Recorded(topic, kind, received, received, messages, frame, child, stamped=False)
    if np.all(np.diff(stamps) >= 0):
        return Recorded(topic, kind, stamps, received, messages, frame, child)
    order = np.argsort(stamps, kind="stable")
    notes.append(f"{int((np.diff(stamps) < 0).sum())} messages of {topic} came late and were sorted by header stamp")
    return Recorded(topic, kind, stamps[order], received[order], [messages[i] for i in order], frame, child)


def read_transforms(path: Path, bag: Any, topics: Sequence[str]) -> list[tuple[bool, Any]]:
    """Return every transform, and whether it is static."""
    with _foreign(path):
        wanted = [c for c in bag.connections if c.topic in topics]
        read = [(c.topic, bag.deserialize(raw, c.msgtype)) for c, _, raw in bag.messages(wanted)]
    with fields_of(path, " and ".join(topics), "transforms"):
        return [(topic.endswith("_static"), each) for topic, message in read for each in message.transforms]


class _Chunk(NamedTuple):
    """Method, stated unpacked bytes, place and packed bytes of a ROS 1 chunk."""

    way: str
    size: int
    place: int
    packed: int


def refuse_packed_files(path: Path) -> None:
    """Refuse files of a bag that would unpack to more than the limit.

    Raises:
        InputError: with both sizes.
    """
    for file in sorted(path.glob("*.*")) if path.is_dir() else [path]:
        ending = file.suffix.lower()
        if ending == ".zstd":
            with file.open("rb") as packed, zstd().open(packed, "rb") as content:
                size, read = file.stat().st_size, 0
                while block := content.read(BLOCK):
                    read += len(block)
                    if read > max(SMALL, RATIO * size):
                        raise InputError(
                            file, f"has {size} bytes and unpacks to more than {read}, which no recording does", AGAIN
                        )
        elif ending == ".db3":
            _refuse_computed_blobs(file)
        elif ending == ".bag":
            _refuse_chunks(file)


def refuse_packed_messages(path: Path, bag: Any) -> None:
    """Refuse a bag whose individually packed messages exceed the limit.

    Raises:
        InputError: the messages unpack to more than the limit.
    """
    for reader in bag.readers:
        if getattr(reader, "compression_mode", None) != "message":
            continue
        room = max(SMALL, RATIO * sum(file.stat().st_size for file in path.glob("*.*")))
        for storage in reader.storage.storages:
            for _, _, data in storage.messages(storage.connections, None, None):
                unpack = zstd().ZstdDecompressor()
                room -= len(unpack.decompress(data, max_length=room + 1))
                if room < 0 or not unpack.eof or unpack.unused_data:
                    raise InputError(path, "holds packed messages that unpack to more than any recording does", AGAIN)


def zstd() -> Any:
    """Return the zstd library of Python or of `rosbags`."""
    try:
        return import_module("compression.zstd")
    except ImportError:
        return import_module("backports.zstd")


def _refuse_computed_blobs(path: Path) -> None:
    connection = sqlite3.connect(f"file:{quote(str(path))}?mode=ro&immutable=1", uri=True)
    try:
        found = connection.execute("SELECT type FROM sqlite_master WHERE name = 'messages'").fetchall()
        if found != [("table",)]:
            return  # no bag; its reader reports it
        stored = int(connection.execute("SELECT total(length(data)) FROM messages").fetchone()[0])
    except sqlite3.Error:
        return  # damaged; its reader reports it
    finally:
        connection.close()
    size = path.stat().st_size
    if stored > size:
        raise InputError(path, f"has {size} bytes and names messages of {stored} bytes", AGAIN)


def _refuse_chunks(path: Path) -> None:
    with path.open("rb") as file:
        if file.read(len(MAGIC[".bag"])) != MAGIC[".bag"]:
            return
        chunks = list(_chunks(file))
        refuse_bomb(path, path.stat().st_size, sum(chunk.size for chunk in chunks), AGAIN, most=math.inf)
        for chunk in chunks:
            where = f"{path}: chunk at byte {chunk.place}"
            refuse_bomb(where, chunk.packed, chunk.size, AGAIN, most=LARGEST_CHUNK)
            if chunk.way in WAYS:
                file.seek(chunk.place)
                made = WAYS[chunk.way]().decompress(file.read(chunk.packed), max_length=chunk.size + 1)
                if len(made) > chunk.size:
                    raise InputError(where, f"unpacks to more than the {chunk.size} bytes that it says", AGAIN)


def _chunks(file: BinaryIO) -> Iterator[_Chunk]:
    """The chunks of a ROS 1 bag, up to a damaged one, which the bag's reader reports."""
    while len(head := file.read(4)) == 4:
        header = file.read(struct.unpack("<I", head)[0])
        length = file.read(4)
        if len(length) < 4:
            return
        packed, place = struct.unpack("<I", length)[0], file.tell()
        fields = dict(_fields(header))
        if fields.get("op") == bytes([5]) and len(fields.get("size", b"")) == 4:
            way = fields.get("compression", b"").decode("latin-1")
            yield _Chunk(way, struct.unpack("<I", fields["size"])[0], place, packed)
        file.seek(place + packed)


def _fields(header: bytes) -> Iterator[tuple[str, bytes]]:
    place = 0
    while place + 4 <= len(header):
        length = struct.unpack_from("<I", header, place)[0]
        name, _, value = header[place + 4 : place + 4 + length].partition(b"=")
        yield name.decode("latin-1"), value
        place += 4 + length
