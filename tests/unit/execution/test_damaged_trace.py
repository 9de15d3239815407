"""Trace files with damaged arrays or metadata are refused in a sentence. What is recorded of a run is read."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.execution.trace import COLUMNS, Trace

ROWS = 5
META = {"format": "skillframe.trace", "version": 1, "params": {"slope": 0.5}, "bodies": [{"name": "tool", "geoms": []}]}


def arrays() -> dict[str, Any]:
    made: dict[str, Any] = {name: np.ones((ROWS, *shape)) for name, shape in COLUMNS.items()}
    made |= {"q": np.ones((ROWS, 7)), "body_position": np.ones((ROWS, 1, 3), np.float32)}
    return made | {"body_quaternion": np.ones((ROWS, 1, 4), np.float32), "time": np.arange(ROWS) / 100}


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Trace]:
    def write_and_load(meta: str | None = None, **changes: Any) -> Trace:
        np.savez(tmp_path / "t.npz", **{**arrays(), **changes}, meta=np.array(meta or json.dumps(META)))
        return Trace.load(tmp_path / "t.npz")

    return write_and_load


def test_a_sound_trace_is_read_with_forces_that_are_not_known(read: Callable[..., Trace]) -> None:
    wrench = np.full((ROWS, 6), np.nan)
    assert np.isnan(read(wrench=wrench).wrench).all()


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("position", np.full((ROWS, 3), np.nan), "array position holds a number out of all bounds in row 0"),
        ("wrench", np.full((ROWS, 6), 1e300), "array wrench holds a number out of all bounds"),
        ("body_position", np.full((ROWS, 1, 3), np.inf, np.float32), "array body_position holds a number out of"),
        ("desired_position", np.full((ROWS, 3), "x"), "array desired_position holds <U1, no numbers"),
        ("time", np.arange(ROWS)[::-1] / 100, "its time does not increase"),
        ("time", np.zeros(ROWS), "its time does not increase"),
    ],
)
def test_arrays_that_cannot_be_drawn_are_refused(read: Callable[..., Trace], name: str, value: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(**{name: value})


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("analytic", [1, 2], r"meta\.analytic: is \[1, 2\]"),
        ("frames", -1.0, r"meta\.frames: is -1\.0"),
        ("bodies", [2.5], r"meta\.bodies\[0\]: is no body"),
        ("bodies", [{"geoms": 0}], r"meta\.bodies\[0\]: is no body"),
        ("center_of_compliance", [0.0, np.nan, 0.0], r"t\.npz: meta\.center_of_compliance: is no.*; run it again"),
        ("center_of_compliance", [0.0, 0.0], r"meta\.center_of_compliance: is no point"),
        ("frames", {"tip": [0.0, 0.0, np.inf]}, r"meta\.frames\.tip: is no point of three finite numbers"),
        ("limits", {"force_n": "80"}, r"meta\.limits\.force_n: is '80'"),
        ("bodies", [{"geoms": [{"kind": ["box"]}]}], r"meta\.bodies\[0\]\.geoms\[0\]\.kind"),
        ("bodies", [{"geoms": [{"kind": "cylinder", "size": [0.1]}]}], r"geoms\[0\]\.size: is \[0\.1\]"),
        ("bodies", [{"geoms": [{"kind": "box", "size": [0.1, 0.1, np.nan]}]}], r"geoms\[0\]\.size: is"),
        ("bodies", [{"geoms": [{"kind": "plane", "quaternion": [0, 0, 0, 0]}]}], r"geoms\[0\]\.quaternion: is"),
        ("bodies", [{"geoms": [{"kind": "plane", "rgba": [1, 1, 1]}]}], r"geoms\[0\]\.rgba: is"),
        ("bodies", [{"geoms": [{"kind": "mesh", "vertices": [[0, 0, np.nan]]}]}], r"geoms\[0\]\.vertices: are no"),
        ("bodies", [{"geoms": [{"kind": "mesh", "vertices": [[0, 0, 0]], "faces": [[0, 0, 3]]}]}], r"\.faces: are no"),
    ],
)
def test_metadata_that_cannot_be_used_are_refused(read: Callable[..., Trace], key: str, value: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(meta=json.dumps({**META, key: value}))


def test_a_whole_number_beyond_every_float_is_read_as_infinity(read: Callable[..., Trace]) -> None:
    """JSON has no whole numbers. Infinity is what a run that diverged writes itself."""
    assert read(meta=json.dumps({**META, "final_error_m": 10**400})).meta["final_error_m"] == np.inf


@pytest.mark.needs_plugins
def test_a_damaged_trace_is_an_input_error_of_report_and_leaves_no_page(
    read: Callable[..., Trace], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError):
        read(meta=json.dumps({**META, "center_of_compliance": [np.nan, 0.0, 0.0]}))
    page = tmp_path / "page.html"
    assert run(["report", str(tmp_path / "t.npz"), "--out", str(page)]) == 2
    assert "t.npz: meta.center_of_compliance: is no point" in capsys.readouterr().err
    assert not page.exists()
