"""Rows in little room: nothing of them is lost, older files stay readable, and a damaged line is named."""

import json
import math
import struct
import tracemalloc
import zlib

import campaign_fakes as fakes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skillframe.campaign.partial_results import status_of
from skillframe.campaign.row_format import PackedRows
from skillframe.campaign.rows import ENDS, JUDGED_MEASURES, MEASURES
from skillframe.campaign.store import RowLog, read_content
from skillframe.errors import InputError
from skillframe.execution.trace import SHARE_JOINTS

VALUES = st.one_of(
    st.floats(),
    st.booleans(),
    st.none(),
    st.integers(-(2**53), 2**53),
    st.text(st.characters(exclude_categories=["Cs"])),
)
NAMES = st.sampled_from(["success", "failure", "score.a", "second.b", "world.c", "peak_force_n", "reason"])

# what versions 1 and 2 wrote
ONE = b"""\
{"format": "skillframe.campaign", "version": 1, "campaign": "x"}
{"trial": 0, "skill": "a", "seed": 7, "success": true, "failure": "", "duration_s": 2.5, "peak_force_n": "nan"}
"""
TWO = b"""\
{"format": "skillframe.campaign", "version": 2, "campaign": "x", "crc32": "892afe77"}
{"session": {"ran_on": {"python": "3.11"}}, "crc32": "6da640fa"}
{"trial": 0, "skill": "a", "seed": 7, "success": true, "failure": "", "duration_s": 2.5, "peak_force_n": "nan", \
"ran_on": 0, "crc32": "71419d7f"}
"""


def bits(value):
    """The value with its kind, so that 1, 1.0 and True differ, and so does every bit of a float."""
    return struct.pack("<d", value) if isinstance(value, float) else (type(value), value)


def same(a, b):
    return list(a) == list(b) and all(bits(a[name]) == bits(b[name]) for name in a)


def judged(n, rng):
    """Rows with every column that a trial of a world has."""
    joints = [f"panda_joint{i}" for i in range(1, 8)]
    return [
        {"trial": i, "skill": "a.skill.json", "seed": 7, "start.tilt_y": rng.random(), "start.offset_x": rng.random(),
         "world.friction": 0.1, "success": i % 10 != 0, "failure": "" if i % 10 else "time limit: 5 s",
         **{name: rng.random() for name in (*MEASURES, *JUDGED_MEASURES)}, "ended_by": "goal" if i % 10 else "time",
         **{name: joints[rng.integers(7)] for name in SHARE_JOINTS}, **dict.fromkeys(ENDS, i % 10 != 0),
         "status": 1, "reason": "done"}
        for i in range(n)
    ]  # fmt: skip


@pytest.fixture
def out(campaign, tmp_path):
    out = fakes.start(campaign(trials=6), tmp_path / "out")
    fakes.run(out, traces=0)
    return out


def rewrite(folder, change):
    """Change the records of rows.jsonl, as they lie there, and let their checksums fit."""
    path = folder / "rows.jsonl"
    records = [json.loads(line) for line in path.read_text().splitlines()]
    content = b""
    for record in change(records):
        record.pop("crc32", None)
        text = json.dumps(record).encode()[:-1]
        content += text + b', "crc32": "%08x"}\n' % zlib.crc32(text)
    path.write_bytes(content)


@settings(max_examples=50)
@given(values=st.lists(st.dictionaries(NAMES, VALUES), min_size=1, max_size=4))
def test_any_row_comes_back_from_memory_and_file_to_the_last_bit(values, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rows")
    rows = [{"trial": i, "skill": "a", "seed": 7, **more} for i, more in enumerate(values)]
    with RowLog(folder, "x") as log:
        log.append(rows, {"python": "3.11"})
        kept = log.done
        assert [log.done.ran_on((i, "a")) for i in range(len(rows))] == [0] * len(rows)
    for done in (kept, read_content(folder).done):
        assert all(same(row, done[row["trial"], "a"]) for row in rows)
        assert list(done) == [(i, "a") for i in range(len(rows))]


def test_a_float_that_is_no_number_keeps_the_bits_that_say_why(tmp_path):
    odd = struct.unpack("<d", struct.pack("<Q", 0xFFF8_0000_0000_0123))[0]
    row = {"trial": 0, "skill": "a", "seed": 7, "peak_force_n": odd, "final_error_m": -0.0, "duration_s": math.inf}
    with RowLog(tmp_path, "x") as log:
        log.append([row])
    assert same(row, read_content(tmp_path).done[0, "a"])


def test_a_row_takes_less_than_300_bytes_in_the_file_and_600_in_memory(tmp_path):
    rows = judged(2000, np.random.default_rng(0))
    with RowLog(tmp_path, "x") as log:
        log.append(rows, {"python": "3.11"})
    assert (tmp_path / "rows.jsonl").stat().st_size / len(rows) < 300
    tracemalloc.start()
    before, packed = tracemalloc.get_traced_memory()[0], PackedRows()
    for row in rows:
        packed.add(row, 0)
    taken = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert taken / len(rows) < 600
    assert all(same(row, packed[row["trial"], row["skill"]]) for row in rows)


@pytest.mark.parametrize(("content", "version", "unchecked"), [(ONE, 1, 2), (TWO, 2, 0)])
def test_a_file_of_an_older_version_is_read_and_goes_on_in_its_own(tmp_path, content, version, unchecked):
    path = tmp_path / "rows.jsonl"
    path.write_bytes(content)
    old = {"trial": 0, "skill": "a", "seed": 7, "success": True, "failure": "", "duration_s": 2.5,
           "peak_force_n": math.nan}  # fmt: skip
    new = {**old, "trial": 1, "peak_force_n": math.inf}
    with RowLog(tmp_path, "x") as log:
        assert same(old, log.done[0, "a"])
        assert log.unchecked == unchecked
        assert log.done.ran_on((0, "a")) == (0 if version == 2 else None)
        log.append([old, new], {"python": "3.11"})
    assert path.read_bytes().startswith(content)
    assert json.loads(path.read_bytes().splitlines()[-1])["peak_force_n"] == "inf"
    found = read_content(tmp_path, "x")
    assert found.version == version
    assert [same(a, b) for a, b in zip(found.done.values(), (old, new), strict=True)] == [True, True]
    assert found.done.ran_on((1, "a")) == 0


def test_a_folder_of_version_2_gives_the_same_table_and_ends_there(out):
    table = fakes.table(out)
    fakes.edit_rows(out, lambda records: [r for r in records if r.get("trial", 0) < 4])
    fakes.run(out, traces=0)
    assert fakes.table(out) == table
    assert read_content(out).version == 2
    assert len(read_content(out).done) == 12


def row_with(**values):
    def change(records):
        next(r for r in records if "bits" in r).update(values)
        return records

    return change


def layout_with(**values):
    def change(records):
        next(r for r in records if "columns" in r).update(values)
        return records

    return change


EDITS = [
    (row_with(bits="AAAA"), "does not fit its layout"),
    (row_with(bits="!"), "does not fit its layout"),
    (row_with(bits=1), "does not fit its layout"),
    (row_with(rest=[]), "does not fit its layout"),
    (row_with(layout=9), "is of layout 9, which no line states"),
    (row_with(layout=[0]), r"is of layout \[0\], which no line states"),
    (row_with(layout=True), "is of layout True, which no line states"),
    (row_with(trial="0"), "trial is '0'"),
    (row_with(trial=3), "is a second row of trial 3|start.tilt_y is .*; trial 3 of this campaign samples"),
    (row_with(trial=999), "trial 999 is none of this campaign's"),
    (lambda records: [r for r in records if "columns" not in r], "is of layout 0, which no line states"),
    (lambda records: records + [r for r in records if "columns" in r], "states layout 0, which is no number or"),
    (layout_with(columns=None), "states no layout of rows"),
    (layout_with(floats=["x"]), "states a layout with columns that it does not have"),
    (layout_with(columns=["seed", "seed"], floats=[], shared={}), "states a layout that names a column twice"),
    (layout_with(ran_on="here"), "says that rows ran on 'here'"),
    (layout_with(shared={"skill": "b", "seed": 7}), "its skill 'b' is none of this campaign's"),
    (layout_with(shared={"skill": "a.skill.json", "seed": 8}), "its seed is 8, the campaign's 7"),
]


@pytest.mark.parametrize(("change", "words"), EDITS)
def test_a_packed_row_or_layout_that_was_changed_is_refused_by_its_line(out, change, words):
    rewrite(out, change)
    for read in (lambda: status_of(out, fakes.FakeParams), lambda: fakes.run(out, traces=0)):
        with pytest.raises(InputError, match=rf"rows.jsonl: line \d+: ({words})"):
            read()


def test_a_kill_while_a_layout_is_written_loses_no_row_before_it_and_ends_in_the_same_table(out):
    path, table = out / "rows.jsonl", fakes.table(out)
    content = path.read_bytes()
    start = content.index(b'{"layout":1')  # of the second skill
    end = content.index(b"\n", start)
    for cut in (*range(start, end, 40), end, end + 1, end + 2):
        path.write_bytes(content[:cut])
        assert len(read_content(out).done) == content[:start].count(b'"bits"') == 6
        fakes.run(out, traces=0)
        assert fakes.table(out) == table
