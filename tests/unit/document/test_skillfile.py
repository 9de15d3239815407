import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_testkit.checks.examples import example_demonstrations
from skillframe_testkit.suites import HoldSkill

from skillframe import __version__
from skillframe.document import file as skillfile
from skillframe.errors import InputError, UnknownName
from skillframe.extend import Document, SkillType
from skillframe.extend.registry import Plugin, load_registry

FRAME = {"work_at": [0.0, 0.0, -0.2], "learned_at": [0.0, 0.0, 0.0], "center_of_compliance": [0.0, 0.0, 0.0]}


def check(document: Document) -> None:
    if "speed" not in document["phases"][0]:
        raise InputError("phases[0]", "lacks the key 'speed'", "add it")


TYPE = SkillType(name="hold", summary="holds", version=3, build=lambda document: HoldSkill(), check=check)


@pytest.fixture(autouse=True)
def hold_is_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    class Entry:
        """A plug-in's entry module."""

    registry = load_registry()
    plugin = registry.add(Plugin(name="hold", distribution="hold-plugin", version="1.2"), lambda: Entry)
    registry._keep("skill", TYPE, plugin)
    monkeypatch.setattr(skillfile, "registry", lambda: registry)


def body() -> Document:
    frame = {**FRAME, "axes": "base", "frames": {"tip": [0.0, 0.0, 0.2]}}
    return {"frame": frame, "phases": [{"speed": 0.02, "stiffness": np.diag([1e3, 1e3, 0.0]).tolist()}]}


def document() -> Document:
    return skillfile.new_document(TYPE, body())


def written(tmp_path: Path, change: dict[str, object]) -> Path:
    path = tmp_path / "a.json"
    path.write_text(json.dumps({**document(), **change}))
    return path


def test_what_is_saved_comes_back_equal(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a.skill.json"
    skillfile.save(document(), path)
    assert skillfile.load(path) == document()
    assert list(path.parent.iterdir()) == [path]


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_numbers_come_back_to_the_last_bit(numbers: list[float]) -> None:
    back = json.loads(skillfile.to_text({"numbers": numbers}))["numbers"]
    assert [math.copysign(1.0, x) for x in back] == [math.copysign(1.0, x) for x in numbers]
    assert back == numbers


def test_saving_what_was_loaded_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "1.json", tmp_path / "2.json"
    skillfile.save(document(), first)
    skillfile.save(skillfile.load(first), second)
    assert first.read_bytes() == second.read_bytes()


def test_keys_are_sorted_and_a_row_of_numbers_stands_on_one_line() -> None:
    text = skillfile.to_text(document())
    assert "[1000.0, 0.0, 0.0]\n" not in text
    assert "        [1000.0, 0.0, 0.0],\n" in text
    assert text == skillfile.to_text(dict(reversed(document().items())))


def test_it_says_who_made_it_and_from_what(tmp_path: Path) -> None:
    demonstration = example_demonstrations()[0]
    made = skillfile.new_document(TYPE, body(), [demonstration, demonstration])
    assert made["created_by"] == {"skillframe": __version__, "plugin": "hold-plugin", "plugin_version": "1.2"}
    assert [s["file"] for s in made["learned_from"]] == ["(in memory)"] * 2
    assert made["learned_from"][0] == made["learned_from"][1]
    assert len(made["learned_from"][0]["sha256"]) == 64


def test_it_says_whether_a_simulated_person_taught() -> None:
    demonstration = example_demonstrations()[0]
    plain = {key: value for key, value in demonstration.meta.items() if key not in ("simulated", "teacher")}
    taught = replace(demonstration, meta={**plain, "simulated": {"kind": "kinesthetic"}, "teacher": "kinesthetic"})
    first, second = skillfile.new_document(TYPE, body(), [taught, replace(demonstration, meta=plain)])["learned_from"]
    assert (first["simulated"], first["teacher"]) == (True, "kinesthetic")
    assert second["simulated"] is False and "teacher" not in second


def test_a_failed_save_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    skillfile.save(document(), path)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"phases\[0\]\.speed.*not a finite number"):
        skillfile.save({**document(), "phases": [{"speed": math.nan}]}, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("key", ["version", "type", "created_by", "learned_from", "frame", "phases"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps({k: v for k, v in document().items() if k != key}))
    with pytest.raises(InputError, match=f"lacks the key '{key}'"):
        skillfile.load(path)


@pytest.mark.parametrize("key", ["work_at", "learned_at", "center_of_compliance", "axes"])
def test_a_missing_key_of_the_frame_is_named(tmp_path: Path, key: str) -> None:
    frame = {k: v for k, v in document()["frame"].items() if k != key}
    with pytest.raises(InputError, match=f"lacks the key 'frame.{key}'"):
        skillfile.load(written(tmp_path, {"frame": frame}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 99}, "version 99, newer than 1; update skillframe"),
        ({"version": "1"}, "version: should be a whole number"),
        ({"version": True}, "version: should be a whole number"),
        ({"type_version": 4}, "holds version 4 of skill type hold, newer than 3; update the plug-in"),
        ({"format": "skillframe.trace"}, "has format 'skillframe.trace'"),
        ({"phases": {}}, "phases: should be a list"),
        ({"phases": [1]}, r"phases\[0\]: is not an object"),
        ({"phases": [{}]}, r"a\.json: phases\[0\]: lacks the key 'speed'"),
        ({"phases": [{"speed": math.nan}]}, r"phases\[0\]\.speed: is not a finite number"),
        ({"phases": [{"speed": [1.0, math.inf]}]}, r"phases\[0\]\.speed\[1\]: is not a finite number"),
        ({"learned_from": [{"file": "a"}]}, r"lacks the key 'learned_from\[0\]\.sha256'"),
        ({"frame": {**FRAME, "axes": "bse"}}, "did you mean 'base'"),
        ({"frame": {**FRAME, "axes": "base", "learned_at": [0, 0]}}, r"frame\.learned_at: should be a point"),
        ({"frame": {**FRAME, "axes": "base", "frames": []}}, r"frame\.frames: should be an object"),
        ({"frame": {**FRAME, "axes": "base", "frames": {"tip": "x"}}}, r"frame\.frames\.tip: should be a point"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        skillfile.load(written(tmp_path, change))
    assert str(caught.value).startswith(str(tmp_path / "a.json"))


def test_an_unknown_type_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match=r"\.json: unknown skill 'hodl'; did you mean 'hold'"):
        skillfile.load(written(tmp_path, {"type": "hodl"}))


@pytest.mark.parametrize("number", ["1e999", "1" + "0" * 400])
def test_a_number_too_large_for_a_float_is_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(document()).replace("0.02", number))
    with pytest.raises(InputError, match=r"speed: is not a finite number"):
        skillfile.load(path)


@pytest.mark.parametrize("keep", [0.02, 0.3, 0.6, 0.95])
def test_a_truncated_file_is_called_cut_off(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "a.json"
    text = skillfile.to_text(document())
    path.write_text(text[: max(1, int(keep * len(text)))])
    with pytest.raises(InputError, match=r"is cut off|is not JSON"):
        skillfile.load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"hello", "is not JSON"),
        (b"[1, 2]", "holds no JSON object"),
        (b"{}", "has format None"),
        (b"\xff\xfe\x00PK", "is a binary file"),
        (b"[" * 200_000, "nested too deeply|is not JSON"),
    ],
)
def test_what_is_no_skill_file_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        skillfile.load(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        skillfile.load(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read"):
        skillfile.load(tmp_path)


def test_a_folder_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.json").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        skillfile.save(document(), tmp_path / "a.json")
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
