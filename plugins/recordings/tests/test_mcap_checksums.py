"""Checksums of MCAP recordings: a flipped bit anywhere is refused or changes nothing. A file without any says so."""

from __future__ import annotations

import random
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.assemble import NOTES
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from tests.unit.demonstration.conftest import make

pytest.importorskip("rosbags", reason="rosbags is not installed (pip install rosbags)")

from plugins.recordings.tests.bags_written import poses, wrenches, write_bag

CHUNK, DATA_END = 0x06, 0x0F
FLIPS = 60


def with_checksums(raw: bytes, chunks: bool, data: bool, summary: bool) -> bytes:
    """The file that rosbags wrote (unpacked chunks, checksums all 0) with checksums filled in as the format says."""
    made, place = bytearray(raw), 8
    while place < len(made) - 8:
        kind, length = struct.unpack_from("<BQ", made, place)
        content = place + 9
        if kind == CHUNK and chunks:
            begin = content + 32 + struct.unpack_from("<I", made, content + 28)[0] + 8
            struct.pack_into("<I", made, content + 24, zlib.crc32(made[begin : content + length]))
        if kind == DATA_END and data:
            struct.pack_into("<I", made, content, zlib.crc32(made[:place]))
        place = content + length
    footer = len(made) - 8 - 20
    start = struct.unpack_from("<Q", made, footer)[0]
    if summary:
        struct.pack_into("<I", made, footer + 16, zlib.crc32(made[start : footer + 16]))
    return bytes(made)


def notes_of(demonstration: Demonstration) -> list[str]:
    return [str(note) for note in demonstration.meta.get(NOTES, [])]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("mcap")
    demo = make(count=60)
    return write_bag(folder / "demo.mcap", {"/tool": poses(demo), "/ft": wrenches(demo)}).read_bytes()


@pytest.mark.parametrize("chunks", [True, False])
def test_a_flipped_bit_of_a_protected_recording_never_gives_other_numbers(
    tmp_path: Path, plain: bytes, chunks: bool
) -> None:
    """With checksums on data and summary every bit of the file is protected, whether its chunks have their own."""
    raw, path = with_checksums(plain, chunks, data=True, summary=True), tmp_path / "demo.mcap"
    path.write_bytes(raw)
    sound, rng, refused = read_demonstration(path), random.Random(5), 0
    for _ in range(FLIPS):
        damaged = bytearray(raw)
        damaged[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        try:
            found = read_demonstration(path)
        except InputError:
            refused += 1
            continue
        for name in ("time", "position", "quaternion", "wrench"):
            assert np.array_equal(getattr(found, name), getattr(sound, name)), name
    assert refused > FLIPS // 2  # or nothing was verified


def test_damage_in_a_chunk_is_named_with_its_place_and_exit_2(
    tmp_path: Path, plain: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    raw = bytearray(with_checksums(plain, chunks=True, data=False, summary=False))
    raw[len(raw) // 3] ^= 1
    (tmp_path / "demo.mcap").write_bytes(raw)
    assert run(["check", str(tmp_path / "demo.mcap")]) == 2
    assert "is damaged: its chunk at byte" in capsys.readouterr().err


@pytest.mark.parametrize(("part", "words"), [("summary", "its index does not fit"), ("data", "its data do not fit")])
def test_damage_that_only_the_checksum_of_the_index_or_of_the_data_shows_is_refused(
    tmp_path: Path, plain: bytes, part: str, words: str
) -> None:
    raw = bytearray(with_checksums(plain, chunks=False, data=part == "data", summary=part == "summary"))
    start = struct.unpack_from("<Q", raw, len(raw) - 8 - 20)[0]
    raw[start + 12 if part == "summary" else start // 2] ^= 1
    (tmp_path / "demo.mcap").write_bytes(raw)
    with pytest.raises(InputError, match=words):
        read_demonstration(tmp_path / "demo.mcap")


def test_a_recording_without_checksums_says_so_and_one_with_them_does_not(tmp_path: Path, plain: bytes) -> None:
    path = tmp_path / "demo.mcap"
    path.write_bytes(plain)
    assert any("carries no checksums" in note for note in notes_of(read_demonstration(path)))
    path.write_bytes(with_checksums(plain, chunks=True, data=False, summary=False))
    assert not any("carries no checksums" in note for note in notes_of(read_demonstration(path)))


def test_a_chunk_that_claims_gigabytes_is_refused_before_it_is_unpacked(tmp_path: Path, plain: bytes) -> None:
    raw, place = bytearray(plain), 8
    while raw[place] != CHUNK:
        place += 9 + struct.unpack_from("<Q", raw, place + 1)[0]
    struct.pack_into("<Q", raw, place + 9 + 16, 1 << 40)
    (tmp_path / "demo.mcap").write_bytes(raw)
    with pytest.raises(InputError, match="would unpack to 1099511627776"):
        read_demonstration(tmp_path / "demo.mcap")


def record(kind: int, content: bytes) -> bytes:
    return bytes([kind]) + len(content).to_bytes(8, "little") + content


def text(said: str) -> bytes:
    return len(said).to_bytes(4, "little") + said.encode()


@pytest.mark.parametrize("encoding", ["json", "protobuf", ""])
def test_a_sound_file_of_another_encoding_is_named_and_not_called_damaged(encoding: str, tmp_path: Path) -> None:
    magic = b"\x89MCAP0\r\n"
    channel = record(4, b"\x01\0\0\0" + text("/ft") + text(encoding) + text(""))
    head = magic + record(1, text("") + text("a recorder")) + channel + record(0x0F, bytes(4))
    footer = len(head).to_bytes(8, "little") + bytes(12)
    (tmp_path / "log.mcap").write_bytes(head + channel + record(2, footer) + magic)
    with pytest.raises(
        InputError, match=rf"without messages of ROS: /ft \({encoding or 'no encoding'}\); cdr and ros1"
    ):
        read_demonstration(tmp_path / "log.mcap")
