"""What a ROS bag holds: its topics, their messages by header stamp, its transforms, and damage in one sentence.

Read through `rosbags`, which needs no ROS. Whatever that library raises on foreign bytes becomes an `InputError`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.mcap import refuse_other_encodings, verify
from skillframe.errors import InputError, MissingDependency

BAG_FACTS = "metadata.yaml"
"""What the folder of a ROS 2 bag holds beside its files."""
MAGIC = {".bag": b"#ROSBAG V2.0\n", ".db3": b"SQLite format 3\0", ".mcap": b"\x89MCAP0\r\n"}
TREES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


class Recorded(NamedTuple):
    """One topic's messages in the order of their header stamps [ns], and the frame that they are in.

    Of kind "tf" the messages are rows of position and quaternion.
    """

    topic: str
    kind: str
    stamps: NDArray[np.int64]
    messages: Any
    frame: str


def parts_note(path: Path) -> list[str]:
    """A note that a file is one of several of its bag, as the metadata in its folder says."""
    facts = path.parent / BAG_FACTS
    words = facts.read_text("utf-8", "replace").split() if facts.is_file() and path.is_file() else []
    parts = {word for word in words if word.endswith((".db3", ".mcap"))}
    return [f"{path.name} is one of {len(parts)} parts of its bag; give the folder to read all"] * (len(parts) > 1)


def refuse_other_files(path: Path) -> None:
    """Refuse what is not a bag by its first bytes, before any library is asked. A folder is a bag of ROS 2."""
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
    """Verify the checksums of every MCAP file of a bag. Returns notes on those that carry none.

    Raises:
        InputError: damage, or no messages of ROS.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix.lower() == ".mcap" else []
    with _foreign(path):
        notes = [note for file in files for note in verify(file)]
        for file in files:
            refuse_other_encodings(file)
    return notes


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """The bag, open for reading.

    Raises:
        InputError: damaged or cut off.
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
        yield bag
    finally:
        bag.close()


def _no_rosbags(path: Path) -> MissingDependency:
    return MissingDependency("rosbags", f"reading {path}", "pip install 'skillframe[ros]'")


@contextmanager
def _foreign(path: Path) -> Iterator[None]:
    """Whatever the library raises on a damaged file, as one sentence."""
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
    """Where fields of messages are read. A bag brings its definitions of them, which damage may have changed.

    Raises:
        InputError: a field is not there, or holds something else.
    """
    try:
        yield
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: {topic}", f"its messages are no {kind} as ROS defines it ({error})",
            "it may be damaged: record it again, or choose another topic",
        ) from None  # fmt: skip


def topics_of(path: Path, bag: Any) -> dict[str, str]:
    """Message type by topic.

    Raises:
        InputError: the bag is damaged, or holds no message.
    """
    with _foreign(path):
        topics = {name: str(info.msgtype) for name, info in bag.topics.items()}
        empty = bag.message_count == 0
    if empty:
        raise InputError(path, "holds no messages", "record it again, and check that the topics are published")
    return topics


def messages_of(path: Path, bag: Any, topic: str) -> list[Any]:
    """All messages of a topic in the order of their receive times.

    Raises:
        InputError: they are damaged.
    """
    with _foreign(path):
        connections = [c for c in bag.connections if c.topic == topic]
        return [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(connections)]


def read_topic(path: Path, bag: Any, topic: str, kind: str, notes: list[str]) -> Recorded:
    """All messages of a topic, sorted by their headers' stamps. Adds a note if that was needed.

    Raises:
        InputError: there are none, or they are damaged.
    """
    messages = messages_of(path, bag, topic)
    if not messages:
        raise InputError(f"{path}: {topic}", "holds no messages", "choose another topic, or record it again")
    if not all(hasattr(getattr(m, "header", None), "stamp") for m in messages):
        raise InputError(f"{path}: {topic}", "holds messages without a header", "choose another topic")
    with fields_of(path, topic, kind):
        times = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages]
        stamps, frame = np.array(times, dtype=np.int64), str(messages[0].header.frame_id)
    if np.all(np.diff(stamps) >= 0):
        return Recorded(topic, kind, stamps, messages, frame)
    order = np.argsort(stamps, kind="stable")
    notes.append(f"{int((np.diff(stamps) < 0).sum())} messages of {topic} came late and were sorted by header stamp")
    return Recorded(topic, kind, stamps[order], [messages[i] for i in order], frame)


def read_transforms(path: Path, bag: Any, topics: Sequence[str]) -> list[tuple[bool, Any]]:
    """Every transform, and whether it holds for ever."""
    with _foreign(path):
        wanted = [c for c in bag.connections if c.topic in topics]
        read = [(c.topic, bag.deserialize(raw, c.msgtype)) for c, _, raw in bag.messages(wanted)]
    with fields_of(path, " and ".join(topics), "transforms"):
        return [(topic.endswith("_static"), each) for topic, message in read for each in message.transforms]
