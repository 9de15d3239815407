"""Rows are held against the campaign they claim to be of; a table that somebody edited is said to be so."""

import json

import campaign_fakes as fakes
import pytest
from skillframe_reports.sources import read_folder

from skillframe import files
from skillframe.campaign.partial_results import status_of
from skillframe.campaign.runner import replay_trial
from skillframe.errors import InputError


@pytest.fixture
def out(campaign, tmp_path):
    out = fakes.start(campaign(trials=6), tmp_path / "out")
    fakes.run(out, traces=0)
    return out


def first(records):
    """Index and record of the first row."""
    return next((i, r) for i, r in enumerate(records) if "trial" in r)


def edit(**values):
    def change(records):
        first(records)[1].update(values)
        return records

    return change


def without(key):
    def change(records):
        first(records)[1].pop(key)
        return records

    return change


def another(key, factor):
    def change(records):
        first(records)[1][key] *= factor
        return records

    return change


def flipped(records):
    row = first(records)[1]
    row["success"] = not row["success"]
    return records


def twice(records):
    return [*records, first(records)[1]]


EDITS = [
    (flipped, "success is .*, but its failure says"),
    (edit(seed=8), "its seed is 8, the campaign's 7"),
    (edit(trial=999), r"trial 999 is none of this campaign's \(0 to 5\)"),
    (edit(trial=-1), "trial -1 is none"),
    (edit(skill="b.skill.json"), "its skill 'b.skill.json' is none of this campaign's"),
    (another("start.tilt_y", 1.0 + 2**-50), "start.tilt_y is .*; trial 0 of this campaign samples"),
    (edit(trial=3), "is a second row of trial 3|start.tilt_y is .*; trial 3 of this campaign samples"),
    (twice, "is a second row of trial 0"),
    *((without(key), f"has no '{key}'") for key in ("trial", "skill", "seed", "success", "failure", "duration_s")),
    (without("world.friction"), "has no 'world.friction'"),
    (edit(success=1), "success is 1"),
    (edit(peak_force_n="soft"), "could not convert"),
    (edit(peak_force_n=[]), r"peak_force_n is \[\]"),
]


@pytest.mark.parametrize("old", [False, True], ids=["signed", "of 0.1"])
@pytest.mark.parametrize(("change", "words"), EDITS)
def test_a_row_that_is_not_this_campaigns_is_refused_by_its_line(out, change, words, old):
    fakes.edit_rows(out, change, old)
    for read in (lambda: status_of(out, fakes.FakeParams), lambda: fakes.run(out, traces=0)):
        with pytest.raises(InputError, match=rf"rows.jsonl: line \d+: ({words})"):
            read()


def test_any_flipped_bit_in_a_line_is_refused_by_its_checksum(out):
    content = (out / "rows.jsonl").read_bytes()
    lines = content.splitlines(keepends=True)
    start = sum(map(len, lines[:3]))
    for place in range(start, start + len(lines[3]) - 1, 7):
        damaged = bytearray(content)
        damaged[place] ^= 1
        (out / "rows.jsonl").write_bytes(damaged)
        with pytest.raises(
            InputError, match=r"line 4: (was changed after it was written|is damaged|has lost its checks)"
        ):
            status_of(out, fakes.FakeParams)


def test_a_line_that_lost_its_checksum_is_refused(out):
    lines = (out / "rows.jsonl").read_text().splitlines()
    record = json.loads(lines[4])
    record.pop("crc32")
    lines[4] = json.dumps(record)
    (out / "rows.jsonl").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="line 5: has lost its checksum"):
        status_of(out, fakes.FakeParams)


def test_rows_of_0_1_are_read_and_it_is_said_that_they_carry_no_checksum(out):
    before = (out / "results.csv").read_bytes()
    fakes.edit_rows(out, lambda records: records, old=True)
    told = []
    fakes.run(out, notify=told.append, traces=0)
    assert (out / "results.csv").read_bytes() == before
    lines = (out / "rows.jsonl").read_bytes().count(b"\n") - (out / "rows.jsonl").read_bytes().count(b"crc32")
    (text,) = status_of(out, fakes.FakeParams)["remarks"]
    assert text.startswith(f"{lines} lines of rows.jsonl were written by skillframe 0.1 and carry no checksum")
    assert any("carry no checksum" in p.note for p in told)


def test_old_rows_that_hold_trouble_of_the_machine_are_said_to_be_no_result(out):
    nan = "nan"
    lost = edit(
        success=False, failure="error: /somewhere/robot.toml: no such file", duration_s=nan, peak_force_n=nan,
        final_error_m=nan, final_error_rad=nan,
    )  # fmt: skip
    fakes.edit_rows(out, lost, old=True)
    text = status_of(out, fakes.FakeParams)["remarks"][0]
    assert text.startswith("1 of 12 rows are probably trouble of the machine, and not of a skill")
    assert "campaign run" in text


def test_an_edited_table_is_told_by_status_and_report_and_written_again_by_resume(out):
    path = out / "results.csv"
    before = path.read_bytes()
    assert status_of(out, fakes.FakeParams)["remarks"] == []
    undisturbed = read_folder(out).notes  # that the fake's demonstration is none
    path.write_bytes(before.replace(b",0,stuck", b",1,", 1))
    assert path.read_bytes() != before
    (text,) = status_of(out, fakes.FakeParams)["remarks"]
    assert text.startswith("results.csv is not as the campaign wrote it")
    assert [note for note in read_folder(out).notes if note not in undisturbed] == [text]
    fakes.run(out, traces=0)
    assert path.read_bytes() == before


def test_where_rows_ran_is_kept_with_each_row_and_counted_in_the_summary(out):
    other = {"python": "3.11.7", "processor": "another one", "platform": "Linux"}

    def elsewhere(records):
        number = sum("ran_on" in r.get("session", {}) for r in records)
        first(records)[1]["ran_on"] = number
        return [*records, {"session": {"ran_on": other}}]

    fakes.edit_rows(out, elsewhere)
    summary = fakes.run(out, traces=0)
    assert sorted(entry["rows"] for entry in summary["environments"]) == [1, 11]
    assert [e["versions"] for e in summary["environments"] if e["rows"] == 1] == [other]
    (text,) = status_of(out, fakes.FakeParams)["remarks"]
    assert text.startswith("rows ran on 2 kinds of machine (")
    assert "another one on Linux" in text
    label = "a.skill.json"
    own, others = (replay_trial(out, trial, fakes.good, label, fakes.FakeParams).environment for trial in (0, 1))
    assert any("another one" in line for line in own)
    assert others == []


@pytest.mark.parametrize("name", ["lock", "watch"])
def test_a_link_in_the_folder_is_not_written_through(out, tmp_path, name):
    victim = tmp_path / "victim"
    (victim.mkdir if name == "watch" else victim.touch)()
    (out / name).symlink_to(victim)
    (out / "rows.jsonl").unlink()
    with pytest.raises(InputError, match=f"{name}: is"):
        fakes.run(out, **({"workers": 1} if name == "watch" else {}))
    assert list(victim.iterdir()) == [] if name == "watch" else victim.read_bytes() == b""


def test_a_link_under_a_temporary_name_is_not_written_through(out, tmp_path):
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    for name in ("results.csv", "summary.json"):
        (out / f"{name}.tmp").symlink_to(victim)
    fakes.run(out, traces=0)
    assert victim.read_bytes() == b"mine"
    assert not (out / "results.csv").is_symlink()


def test_what_a_killed_session_left_half_written_is_removed_and_nothing_else(out):
    with files.writing_whole(out / "traces" / "00000_a.npz") as half:
        pass
    half.touch()  # as a kill before the rename leaves it
    others = [out / ".notes.txt", out / ".git", out / "traces" / "00000_a.npz"]
    for path in others:
        path.touch()
    fakes.run(out, traces=0)
    assert not half.exists()
    assert all(path.exists() for path in others)
