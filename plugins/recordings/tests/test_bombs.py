"""Small files that name gigabytes are refused in one sentence, before memory is asked for; honest ones are read."""

from __future__ import annotations

import importlib
import json
import shutil
import sqlite3
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.files.documents import MOST_BYTES, RATIO, SMALL, refuse_bomb
from tests.unit.demonstration.conftest import HEADER, make

NAMES = HEADER.split(",")
READ = """
import json, sys, time
import h5py, pyarrow.parquet, rosbags.highlevel, scipy.io, skillframe.api, skillframe.extend.reading
from skillframe.errors import InputError
from skillframe.extend.registry import registry
registry().reader("parquet")

def peak():  # of this program alone: getrusage would give that of the parent too
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))

before, found = peak(), []
for path in sys.argv[1:]:
    start = time.process_time()
    try:
        skillframe.extend.reading.read_demonstration(path)
        said = "read"
    except InputError as error:
        said = str(error)
    found.append([said, time.process_time() - start])
print(json.dumps([found, peak() - before]))
"""


def filled(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name in NAMES:  # no chunk is stored: HDF5 would fill in every value
            file.create_dataset(
                name, shape=(20_000_000,), dtype="f8", chunks=(1000,), fillvalue=1.0, compression="gzip"
            )


def longer_chunk(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name in NAMES:
            made = file.create_dataset(name, shape=(1000,), dtype="f8", chunks=(1000,), compression="gzip")
            made.id.write_direct_chunk((0,), zlib.compress(bytes(20_000_000)))


def runs(path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = importlib.import_module("pyarrow").table(dict.fromkeys(NAMES, np.zeros(700_000)))
    parquet.write_table(table, path, compression="zstd")


def zeros(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"log": np.zeros((700_000, 14))}, do_compression=True)


def packed_npz(path: Path) -> None:
    np.savez_compressed(path, **{name: np.zeros(700_000) for name in NAMES})


def computed(path: Path) -> None:
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)")
        file.execute("CREATE TABLE messages (id INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(900000000)))")
        file.execute("INSERT INTO messages (id) VALUES (1)")


def bag_1(path: Path) -> None:
    """A ROS 1 bag whose one chunk says that its bytes unpack to 1 GB."""

    def field(name: bytes, value: bytes) -> bytes:
        return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value

    header = field(b"op", b"\x05") + field(b"compression", b"bz2") + field(b"size", struct.pack("<I", 1_000_000_000))
    body = b"BZh9"
    path.write_bytes(b"#ROSBAG V2.0\n" + struct.pack("<I", len(header)) + header + struct.pack("<I", len(body)) + body)


def mcap(path: Path) -> None:
    """An MCAP file with a packed chunk that says that it unpacks to 255 MB."""

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(content)) + content

    chunk = struct.pack("<QQQII", 0, 0, 255_000_000, 0, 4) + b"zstd" + struct.pack("<Q", 4) + bytes(4)
    end = record(0x0F, bytes(4)) + record(0x02, struct.pack("<QQI", 0, 0, 0))
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + record(0x01, bytes(8)) + record(0x06, chunk) + end + magic)


BOMBS = {
    "filled.hdf5": (filled, "would unpack to 2240000000, which no recording does"),
    "longer.hdf5": (longer_chunk, "holds a chunk of 8000 bytes that unpacks to more"),
    "runs.parquet": (runs, "would unpack to 78400000, which no recording does"),
    "zeros.mat": (zeros, "would unpack to 784000"),
    "packed.npz": (packed_npz, "would unpack to 784"),
    "computed.db3": (computed, "names messages of 900000000 bytes"),
    "chunk.bag": (bag_1, "would unpack to 1000000000, which no recording does"),
    "chunk.mcap": (mcap, "would unpack to 255000000, which no recording does"),
}  # fmt: skip


@pytest.mark.slow
def test_small_files_that_name_gigabytes_are_refused_within_a_second_and_200_mb(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    for name, (write, _) in BOMBS.items():
        write(tmp_path / name)
    paths = [str(tmp_path / name) for name in BOMBS]
    done = subprocess.run([sys.executable, "-c", READ, *paths], capture_output=True, text=True, check=True)
    found, kilobytes = json.loads(done.stdout)
    for (said, seconds), (name, (_, what)) in zip(found, BOMBS.items(), strict=True):
        assert what in said and said.count("\n") == 0, (name, said)
        assert seconds < 1.0, (name, seconds)  # of the processor, what is imported left out
    assert kilobytes < 200_000


@pytest.mark.parametrize("mode", ["file", "message"])
@pytest.mark.slow
def test_a_bag_that_zstd_packs_by_file_or_message_is_read_unless_it_unpacks_to_too_much(
    tmp_path: Path, demo: Demonstration, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore
    from skillframe_recordings.formats import bagfile

    from plugins.recordings.tests.bags_written import head, poses, wrenches

    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    with writer:
        for topic, (kind, messages) in {"/tool": poses(demo), "/ft": wrenches(demo)}.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for stamp, fields in messages:
                message = store.types[kind](header=head(store, stamp, "base", {}), **fields(store))
                writer.write(connection, stamp, store.serialize_cdr(message, kind))
    assert len(read_demonstration(tmp_path / "bag")) == len(demo)
    monkeypatch.setattr(bagfile, "SMALL", 1000)  # bytes, as if the bag were a thousand times larger
    monkeypatch.setattr(bagfile, "RATIO", 0)
    with pytest.raises(InputError, match=r"which no recording does|than any recording does"):
        read_demonstration(tmp_path / "bag")


def test_an_index_that_names_a_chunk_twice_is_refused(tmp_path: Path, demo: Demonstration) -> None:
    pytest.importorskip("rosbags")
    from plugins.recordings.tests.bags_written import poses, wrenches, write_bag

    path = write_bag(tmp_path / "demo.mcap", {"/tool": poses(demo), "/ft": wrenches(demo)})
    made, place, index = path.read_bytes(), 8, b""
    while place < len(made) - 8:
        kind, length = struct.unpack_from("<BQ", made, place)
        index = index or (made[place : place + 9 + length] if kind == 0x08 else b"")
        place += 9 + length
    at = made.index(index)
    path.write_bytes(made[:at] + 3 * index + made[at:])
    with pytest.raises(InputError, match="its index names 4 chunks, and it has 1"):
        read_demonstration(path)


def test_an_hour_of_thirty_columns_at_1_khz_and_constant_columns_pass() -> None:
    hour = 3600 * 1000 * 30 * 8
    refuse_bomb("hour.npz", hour // 3, hour, "")
    refuse_bomb("small.npz", 1, SMALL, "")
    refuse_bomb("packed.npz", MOST_BYTES // RATIO, MOST_BYTES, "")
    for packed, unpacked in ((1, SMALL + 1), (MOST_BYTES // RATIO - 1, MOST_BYTES), (MOST_BYTES, MOST_BYTES + 1)):
        with pytest.raises(InputError, match="which no recording does"):
            refuse_bomb("bomb.npz", packed, unpacked, "")


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".hdf5", ".parquet", ".mat", ".npz"])
def test_ten_minutes_of_real_numbers_at_1_khz_are_read(tmp_path: Path, ending: str) -> None:
    rng, time = np.random.default_rng(0), np.arange(600_000) / 1000.0
    short = make(count=200)
    values = np.column_stack([short.position, short.quaternion, short.wrench])[np.arange(len(time)) % 200]
    values[:, 7:] += rng.normal(size=(len(time), 6))
    columns = dict(zip(NAMES, [time, *values.T], strict=True))
    path = tmp_path / f"long{ending}"
    if ending == ".hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file.create_dataset(name, data=column, compression="gzip", compression_opts=1)
    elif ending == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
        parquet.write_table(importlib.import_module("pyarrow").table(columns), path)
    elif ending == ".mat":
        from scipy.io import savemat

        savemat(path, columns, do_compression=True)
    else:
        np.savez_compressed(path, **columns)
    from skillframe_recordings.formats.foreign import foreign_table
    from skillframe_recordings.formats.hdf5 import hdf5_table
    from skillframe_recordings.formats.parquet import parquet_table

    read = {".hdf5": hdf5_table, ".parquet": parquet_table}.get(ending, foreign_table)
    assert len(read(path, {}).values) == len(time)
    shutil.rmtree(tmp_path)
