"""Demonstrations of different tools teach nothing together, and every learner says so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend import LearnOptions
from skillframe.extend.reading import write_demonstration
from skillframe.extend.registry import registry

pytestmark = pytest.mark.needs_plugins
KINDS = ["lmc", "replay", "dmp", "gmr", "seds", "search", "seat", "dual_arm"]


@pytest.fixture
def pair(tmp_path: Path) -> Callable[[float], list[str]]:
    def written(apart: float) -> list[str]:
        """Two files whose tools differ by that much at the wrist [m]."""
        paths = [str(tmp_path / "one.npz"), str(tmp_path / "other.npz")]
        for path, demonstration, z in zip(paths, example_demonstrations(), (0.0, apart), strict=True):
            frames = {"wrist": [0.0, 0.0, -0.15 - z], "tip": [0.0, 0.0, 0.0]}
            write_demonstration(replace(demonstration, meta={**demonstration.meta, "frames": frames}), Path(path))
        return paths

    return written


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("apart", [0.1, 1e-5])
def test_two_tools_are_refused_by_every_learner_in_one_sentence(
    kind: str, apart: float, pair: Callable[[float], list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.skill.json"
    assert run(["learn", *pair(apart), "--skill", kind, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "has its point 'wrist' at" in said
    assert "learn from demonstrations of one tool" in said
    assert not out.exists()


@pytest.mark.parametrize("kind", [*(k for k in KINDS if k != "replay"), "policy"])  # replay takes one only
def test_a_learner_called_by_itself_says_the_same_sentence(kind: str) -> None:
    one, other = example_demonstrations()
    other = replace(other, source="other.npz", meta={**other.meta, "frames": {"wrist": [0.0, 0.0, -0.25]}})
    learn = registry().behaviour(kind).learn
    assert learn is not None
    with pytest.raises(InputError) as caught:
        learn([one, other], LearnOptions())
    assert str(caught.value) == (
        "other.npz: has its point 'wrist' at [0.0, 0.0, -0.25], another demonstration at [0.0, 0.0, -0.15]; "
        "learn from demonstrations of one tool"
    )


def test_segment_refuses_two_tools_and_takes_one(pair: Callable[[float], list[str]], tmp_path: Path) -> None:
    assert run(["segment", *pair(0.1), "--out", str(tmp_path / "a.policy.json")]) == 2
    assert run(["segment", *pair(0.0), "--out", str(tmp_path / "a.policy.json")]) == 0


@pytest.mark.parametrize("kind", ["lmc", "dmp", "gmr", "seds"])
@pytest.mark.slow
def test_one_tool_is_learned_from(kind: str, pair: Callable[[float], list[str]], tmp_path: Path) -> None:
    assert run(["learn", *pair(0.0), "--skill", kind, "--out", str(tmp_path / "a.skill.json")]) == 0
