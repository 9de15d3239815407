"""JSON, TOML, npz and typed numbers from outside: each is read, or refused in one sentence with exit 2."""

from __future__ import annotations

import io
import json
import sys
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.execution.trace import COLUMNS, Trace
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.files.documents import parse_json, parse_toml
from tests.unit.demonstration.conftest import make

Said = Callable[..., str]
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Said:
    """What a command says that must end with 2 and one sentence."""

    def demand(*arguments: object) -> str:
        capsys.readouterr()
        code = run([str(word) for word in arguments])
        said = capsys.readouterr().err
        assert code == 2, said
        assert said.count("error") <= 1 and "Traceback" not in said and len(said) < 1000
        return said

    return demand


@given(PLAIN)
def test_every_plain_value_comes_back_from_json_as_it_was(value: Any) -> None:
    text = json.dumps(value)
    assert parse_json(text, "text", "") == json.loads(text)


DEEP = {"lists": "[" * 3000, "closed": "[" * 200 + "]" * 200, "tables": '{"a":' * 300 + "1" + "}" * 300}


@pytest.mark.parametrize("limit", [400, 20_000])
@pytest.mark.parametrize("parse", [parse_toml, lambda text, where: parse_json(text.removeprefix("x = "), where, "")])
def test_depth_is_told_whatever_the_interpreter_lets_recurse(limit: int, parse: Callable[[str, str], object]) -> None:
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(limit)
    try:
        with pytest.raises(InputError, match="nested too deeply"):
            parse("x = " + "[" * 3000, "text")
    finally:
        sys.setrecursionlimit(before)


@pytest.mark.parametrize("how", DEEP)
def test_a_deep_skill_file_is_refused(tmp_path: Path, refused: Said, how: str) -> None:
    (tmp_path / "a.json").write_text(DEEP[how])
    assert "a.json" in refused("show", tmp_path / "a.json")


LONG = "9" * 5000


@pytest.mark.parametrize("value", [LONG, "9" * 41, "[" * 3000, "[" * 200 + "]" * 200])
def test_campaign_robot_and_meta_files_with_endless_numbers_or_lists_are_refused(
    tmp_path: Path, refused: Said, value: str
) -> None:
    write_demonstration(make(), tmp_path / "demo.csv")
    (tmp_path / "demo.meta.toml").write_text(f"sensor.force_noise = {value}")
    with pytest.raises(InputError, match=r"demo\.meta\.toml"):
        read_demonstration(tmp_path / "demo.csv")
    (tmp_path / "robot.toml").write_text(f'urdf = "a.urdf"\nlimits.force_n = {value}')
    assert "robot.toml" in refused("robots", "--check", tmp_path / "robot.toml")
    (tmp_path / "campaign.toml").write_text(f"seed = {value}")
    assert "campaign.toml" in refused("campaign", "run", tmp_path / "campaign.toml", "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.needs_plugins
@pytest.mark.parametrize("content", [f'{{"a": {LONG}}}', "[" * 3000, '{"a": "\\ud800"}', "[1"])
def test_a_report_on_a_damaged_summary_or_scene_is_refused(tmp_path: Path, refused: Said, content: str) -> None:
    """A number of 5000 digits alone is JSON: infinity, which a summary may hold."""
    for name in ("summary.json", "scene.json"):
        folder = tmp_path / name.partition(".")[0]
        folder.mkdir()
        (folder / "summary.json").write_text("{}")
        (folder / name).write_text(content)
        if content == f'{{"a": {LONG}}}':
            assert run(["report", str(folder), "--out", str(tmp_path / "page.html")]) == 0
            (tmp_path / "page.html").unlink()
            continue
        assert name in refused("report", folder, "--out", tmp_path / "page.html")
        assert not (tmp_path / "page.html").exists()


@pytest.mark.needs_plugins
@pytest.mark.parametrize(
    ("name", "key"), [("scene.json", "params"), ("scene.json", "analytic"), ("summary.json", "hashes")]
)
def test_a_report_refuses_a_number_where_a_table_is_shown(tmp_path: Path, refused: Said, name: str, key: str) -> None:
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / name).write_text(json.dumps({key: 2.5}))
    assert f"{name}: {key}: is 2.5, not an object" in refused("report", tmp_path, "--out", tmp_path / "page.html")


HUGE = "1" * 41
TYPED = [
    ["run", "x.json", "--world", "free", "--seed", HUGE],
    ["run", "x.json", "--world", "free", "--duration", "1e300"],
    ["run", "x.json", "--world", "free", "--rate", HUGE + "e300"],
    ["run", "x.json", "--world", "free", "--set", f"start.offset_x={HUGE}"],
    ["run", "x.json", "--world", "free", "--set", f"start.offset_x={LONG}"],
    ["run", "x.json", "--world", "free", "--set", f"start.offset_x={'[' * 3000}"],
    ["campaign", "replay", "x", HUGE],
    ["campaign", "run", "x.toml", "--out", "y", "--workers", HUGE],
    ["campaign", "run", "x.toml", "--out", "y", "--traces", HUGE],
    ["demo", "--trials", HUGE],
    ["segment", "x.npz", "--out", "y.json", "--phases", HUGE],
    ["record", "--world", "free", "--out", "y.npz", "--count", HUGE],
]


@pytest.mark.parametrize("words", TYPED, ids=lambda words: f"{words[0]} {words[-2]}")
def test_a_number_of_41_digits_on_the_command_line_is_wrong_usage(
    words: list[str], refused: Said, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refused(*words)
    assert any(word in said for word in ("large", "usual size", "usual length", "range", "is beyond", "deeply")), said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.needs_plugins
def test_a_file_name_that_is_no_text_is_learned_from_and_written_escaped(tmp_path: Path) -> None:
    """A file name on Linux is bytes: what is no UTF-8 reaches Python as half surrogates, which no file can hold."""
    name = tmp_path / b"demo\xff.csv".decode("utf-8", "surrogateescape")
    write_demonstration(make(), name)
    assert run(["learn", str(name), "--out", str(tmp_path / "a.json")]) == 0
    assert json.loads((tmp_path / "a.json").read_text())["learned_from"][0]["file"].endswith("demo\\udcff.csv")


def test_half_a_surrogate_pair_in_a_skill_s_words_is_stored_in_trace_and_rows(tmp_path: Path) -> None:
    from skillframe.campaign.rows import plain_value
    from skillframe.campaign.store import RowLog, read_content

    assert plain_value(np.str_("gave up \ud800")) == "gave up \\ud800"
    row = {"trial": 0, "skill": "a", "seed": 1, "success": False, "failure": plain_value("gave up \ud800")}
    row |= {"duration_s": 1.0, "peak_force_n": 1.0, "final_error_m": 0.0, "final_error_rad": 0.0}
    with RowLog(tmp_path, "x") as log:
        log.append([row])
    assert read_content(tmp_path).done == {(0, "a"): row}
    arrays = {name: np.ones((2, *shape)) for name, shape in COLUMNS.items()} | {"time": np.arange(2.0)}
    drawn = {"q": np.ones((2, 7)), "body_position": np.ones((2, 1, 3)), "body_quaternion": np.ones((2, 1, 4))}
    Trace(**arrays, **drawn, meta={"reason": "gave up \ud800"}).save(tmp_path / "t.npz")
    assert Trace.load(tmp_path / "t.npz").meta["reason"] == "gave up ?"


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in members.items():
            made.writestr(f"{name}.npy", content)
    return path


def packed(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def bomb(path: Path) -> Path:
    """A megabyte that unpacks to one thousand: one block of zeros a hundred times, since to pack them takes seconds."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (125_000_000,)})
    packer = zlib.compressobj(wbits=-15)
    start, block = (packer.compress(part) + packer.flush(zlib.Z_FULL_FLUSH) for part in (head.getvalue(), bytes(10**7)))
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("t.npy", start + 100 * block + packer.flush())
        member = made.getinfo("t.npy")
        member.compress_type, member.file_size = zipfile.ZIP_DEFLATED, len(head.getvalue()) + 10**9
    return path


@pytest.mark.needs_plugins
def test_an_npz_member_without_magic_is_refused(tmp_path: Path, refused: Said) -> None:
    path = archive(tmp_path / "a.npz", t=b"no array", meta=packed(np.array("{}")))
    assert "a.npz" in refused("report", path, "--out", tmp_path / "page.html")
    with pytest.raises(InputError, match=r"a\.npz"):
        read_demonstration(path)


def test_an_npz_bomb_is_refused_before_it_is_unpacked(tmp_path: Path, refused: Said) -> None:
    path = bomb(tmp_path / "a.npz")
    assert path.stat().st_size < 1_100_000
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"would unpack to 10000001\d\d"):
            Trace.load(path)
        with pytest.raises(InputError, match=r"would unpack to 10000001\d\d"):
            read_demonstration(path)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000  # the file itself is 1 MB
    finally:
        tracemalloc.stop()


def test_an_npy_header_that_claims_more_than_its_member_holds_is_refused_unallocated(tmp_path: Path) -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (400000000,), }".ljust(117) + b"\n"
    path = archive(tmp_path / "a.npz", t=b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(80))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="says 3200000000 bytes and holds 80"):
            read_demonstration(path)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


def test_an_npz_with_two_members_of_one_name_is_refused(tmp_path: Path) -> None:
    """Which of the two counts would depend on the reader."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as made:
        made.writestr("t.npy", packed(np.zeros(3)))
        with pytest.warns(UserWarning, match="Duplicate name"):
            made.writestr("t.npy", packed(np.ones(3)))
    with pytest.raises(InputError, match="two arrays of one name"):
        read_demonstration(tmp_path / "a.npz")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_npz_packed_in_a_way_that_cannot_be_bounded_is_refused(tmp_path: Path, method: int) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as made:
        made.writestr("t.npy", packed(np.zeros(1000)))
    with pytest.raises(InputError, match="is packed in another way"):
        read_demonstration(tmp_path / "a.npz")


def test_constant_columns_that_pack_to_almost_nothing_are_read(tmp_path: Path) -> None:
    """The bound is on traps: an hour of a held pose packs to a thousandth and is no trap."""
    demo = make(count=2000)
    write_demonstration(demo, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = {**file, "held": np.zeros(2000)}
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    assert len(read_demonstration(tmp_path / "a.npz").time) == 2000


@pytest.mark.parametrize("key", ["trial", "skill"])
def test_a_row_of_a_campaign_without_a_key_is_refused_by_line_and_key(tmp_path: Path, key: str) -> None:
    from skillframe.campaign.store import read_content

    row = {"trial": 0, "skill": "a", "seed": 1, "success": True, "failure": "", "duration_s": 1.0, "peak_force_n": 1.0}
    row |= {"final_error_m": "nan", "final_error_rad": 0.0}
    head = {"format": "skillframe.campaign", "version": 1, "campaign": "x"}
    del row[key]
    (tmp_path / "rows.jsonl").write_text(f"{json.dumps(head)}\n{json.dumps(row)}\n")
    with pytest.raises(
        InputError, match=f"rows.jsonl: line 2: has no '{key}'; put the file back as it was, or delete that line"
    ):
        read_content(tmp_path)
