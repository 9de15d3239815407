"""Skill files edited by hand, of every kind that is learned: they run, or one sentence says what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from skillframe_testkit.suites import example_demonstrations

from skillframe.cli.main import run
from skillframe.document.file import learned
from skillframe.extend.registry import registry
from tests.oracle import edits

pytestmark = pytest.mark.needs_plugins
KINDS = ("lmc", "policy", "search", "replay", "dmp", "gmr", "seds", "dual_arm")
FOUND = {
    "a travel without end": ("lmc", ("phases", 0, "stop", "travel_limit_m"), 1e300),
    "a demonstration that is a word": ("policy", ("demonstrations",), ["x"]),
    "demonstrations that are a number": ("policy", ("demonstrations",), 2.5),
    "rows of different length": ("policy", ("phase_model", "successors"), [[1, 2], [3]]),
    "a covariance that is lost": ("search", ("phases", 0, "forces", "covariances"), []),
    "a covariance of no spread": ("search", ("phases", 0, "forces", "covariances", 0, 0), [0.0] * 7),
    "a mean that is lost": ("search", ("phases", 0, "forces", "means"), []),
    "time that is a number": ("replay", ("trajectory", "time"), 1.0),
    "a place that is nothing": ("replay", ("trajectory", "position", 0, 0), None),
    "a motion of ages": ("dmp", ("phases", 0, "stop", "time"), 1e90),
}  # fmt: skip


@pytest.fixture(scope="module")
def document() -> Any:
    made: dict[str, Any] = {}

    def make(kind: str) -> Any:
        if kind not in made:
            demonstrations = example_demonstrations()
            body = learned(registry().behaviour(kind), demonstrations[: 1 if kind == "replay" else None])
            made[kind] = json.loads(json.dumps(body))
        return made[kind]

    return make


@pytest.fixture
def judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Show and run a document. Each ends with 0 or 1, or with 2 and one sentence."""

    def judge(document: Any) -> list[int]:
        path, codes = tmp_path / "edited.json", []
        path.write_text(json.dumps(document))
        where = (
            ["--world", "dual_peg", "--robot", "dual_panda"]
            if document.get("type") == "dual_arm"
            else ["--world", "free", "--robot", "free_tool"]
        )
        running = ["run", str(path), *where, "--duration", "0.02", "--out", str(tmp_path / "t.npz")]
        for command in (["show", str(path)], running):
            capsys.readouterr()
            codes.append(run(command))
            said = capsys.readouterr().err
            assert codes[-1] in (0, 1, 2), said
            assert codes[-1] != 2 or (said.startswith("error: ") and said.count("\n") == 1 and len(said) < 600), said
            if codes[-1] == 2:
                break
        return codes

    return judge


@pytest.mark.parametrize("how", FOUND)
def test_an_edit_that_once_broke_the_program_is_refused(document: Any, judged: Any, how: str) -> None:
    kind, path, value = FOUND[how]
    assert judged(edits.edited(document(kind), path, value))[-1] == 2


@pytest.mark.parametrize("key", ["version", "type_version"])
@pytest.mark.parametrize("value", [0, -1])
def test_a_version_below_the_first_is_refused(document: Any, judged: Any, key: str, value: int) -> None:
    assert judged({**document("lmc"), key: value}) == [2]


def test_a_skill_file_with_a_byte_order_mark_is_read(document: Any, tmp_path: Path) -> None:
    path = tmp_path / "skill.json"
    path.write_text("\ufeff" + json.dumps(document("lmc")))
    assert run(["show", str(path)]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_of_any_edit_comes_a_run_or_a_sentence(document: Any, judged: Any, kind: str) -> None:
    assert judged(document(kind))[0] == 0
    refused = 0
    for path, value, changed in edits.some(document(kind), 60, seed=5):
        try:
            refused += judged(changed)[-1] == 2
        except Exception as error:
            pytest.fail(f"{path} <- {value!r}: {error!r}")
    assert refused > 10  # edits are noticed at all
