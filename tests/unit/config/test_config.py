from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.config import build, coerce, parse_setting, read_toml
from skillframe.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    clearance: float = 0.25e-3
    segments: int = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer:
    name: str
    friction: float = 0.2
    base: Literal["fixed", "free"] = "fixed"
    inner: Inner = field(default_factory=Inner)
    limits: tuple[float, float] = (0.0, 1.0)
    names: tuple[str, ...] = ()
    many: list[Inner] = field(default_factory=list)
    table: dict[str, float] = field(default_factory=dict)
    note: str | None = None
    file: Path = Path("a.urdf")
    anything: Any = None
    flag: bool = False


def refusal(values):
    with pytest.raises(InputError) as caught:
        build(Outer, values, "peg.toml")
    return str(caught.value)


def test_plain_values_become_the_annotated_types():
    made = build(
        Outer,
        {"name": "peg", "friction": 1, "inner": {"segments": 8}, "limits": [0, 2], "names": ["a"],
         "many": [{}, {"clearance": 1}], "table": {"x": 1}, "note": "n", "file": "b.urdf", "flag": True},
        "peg.toml",
    )  # fmt: skip
    assert made == Outer(
        name="peg", friction=1.0, inner=Inner(segments=8), limits=(0.0, 2.0), names=("a",),
        many=[Inner(), Inner(clearance=1.0)], table={"x": 1.0}, note="n", file=Path("b.urdf"), flag=True,
    )  # fmt: skip
    assert type(made.friction) is float


def test_an_unknown_key_is_refused_with_the_nearest_known_one():
    text = refusal({"name": "peg", "fricton": 0.1})
    assert "peg.toml" in text and "'fricton'" in text and "did you mean 'friction'?" in text


def test_an_unknown_key_in_a_nested_table_names_its_section():
    text = refusal({"name": "peg", "inner": {"segmnts": 4}})
    assert "peg.toml.inner" in text and "did you mean 'segments'?" in text


def test_a_missing_key_is_named():
    assert "missing name" in refusal({})


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"friction": "high"}, "friction: expected a number"),
        ({"friction": True}, "friction: expected a number"),
        ({"friction": float("nan")}, "not a number"),
        ({"flag": 1}, "flag: expected true or false"),
        ({"base": "fre"}, "did you mean 'free'?"),
        ({"limits": [1.0]}, "expected 2 values, got 1"),
        ({"limits": 3.0}, "expected a list"),
        ({"names": ["a", 1]}, "names[1]: expected text"),
        ({"inner": 3}, "expected a table"),
        ({"table": [1]}, "expected a table"),
        ({"inner": {"segments": 2.5}}, "inner.segments: expected a whole number"),
        ({"note": 3}, "note: expected text"),
    ],
)
def test_a_value_of_the_wrong_type_says_where_and_what_was_expected(values, said):
    assert said in refusal({"name": "peg", **values})


def test_nothing_is_a_value_only_where_the_annotation_allows_it():
    assert coerce(None, str | None, "x") is None
    with pytest.raises(InputError):
        coerce(None, str, "x")


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["world.friction", "start.tilt_y"]))
def test_a_number_set_on_the_command_line_arrives_exactly(value, key):
    assert parse_setting(f"{key}={value!r}") == (key, value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("k=true", True),
        ("k=[1, 2]", [1, 2]),
        ('k="3"', "3"),
        ("k=panda", "panda"),
        ("k=a=b", "a=b"),
        ("k=", ""),
        ("k=7", 7),
        ("k=.5", 0.5),
        ("k=-.5e-3", -0.5e-3),
        ("k=2.", 2.0),
        ("k=1.2.3", "1.2.3"),
        ("k=.", "."),
    ],
)
def test_settings_are_read_as_toml_or_kept_as_text(text, value):
    assert parse_setting(text) == ("k", value)


def test_one_table_for_a_list_of_tables_is_told_its_brackets():
    with pytest.raises(InputError, match=r"write \[\[arm\]\] in place of \[arm\]"):
        coerce({"name": "a"}, tuple[str, ...], "file.arm")


def test_toml_with_a_byte_order_mark_is_read(tmp_path):
    (tmp_path / "a.toml").write_text("\ufeffk = 1\r\n", newline="")
    assert read_toml(tmp_path / "a.toml") == {"k": 1}


@pytest.mark.parametrize("text", ["friction", "=3", " =3"])
def test_a_setting_without_key_or_equals_sign_is_refused(text):
    with pytest.raises(InputError, match="is not KEY=VALUE"):
        parse_setting(text)


def test_a_toml_file_that_is_missing_broken_or_not_text_is_refused_by_name(tmp_path):
    broken, binary = tmp_path / "broken.toml", tmp_path / "binary.toml"
    broken.write_text("a = [1,\nb = 2")
    binary.write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "missing.toml", broken, binary):
        with pytest.raises(InputError, match=path.name):
            read_toml(path)


def test_the_line_of_a_broken_toml_file_is_said(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("a = 1\nb = = 2\n")
    with pytest.raises(InputError, match="line 2"):
        read_toml(path)
