from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import frame_at, frame_of, read_frame, with_center
from skillframe.errors import InputError, UnknownName
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

ORIGIN = [0.0, 0.0, 0.0]


def demonstrations(*meta: dict[str, Any]) -> list[Demonstration]:
    """The first example demonstration with other metadata each."""
    one = replace(example_demonstrations()[0], meta={}, source="demo.npz")
    return [replace(one, meta=each) for each in meta]


def test_without_options_everything_is_at_the_tool_point_in_base_axes() -> None:
    assert frame_of(demonstrations({}), LearnOptions()) == {
        "learned_at": ORIGIN, "work_at": ORIGIN, "center_of_compliance": ORIGIN, "axes": "base", "frames": {},
    }  # fmt: skip


def test_points_that_any_demonstration_names_are_known_whatever_the_order() -> None:
    one, two = demonstrations({"frames": {"tip": [0, 0, 0.2]}}, {"frames": {"wrist": [0.0, 0.0, -0.1]}})
    for pair in ([one, two], [two, one]):
        frame = frame_of(pair, LearnOptions(at="tip", hand="wrist", axes="phase_start"))
        assert frame["learned_at"] == frame["center_of_compliance"] == [0.0, 0.0, 0.2]
        assert frame["work_at"] == [0.0, 0.0, -0.1]
        assert frame["axes"] == "phase_start"
        assert frame["frames"] == {"tip": [0.0, 0.0, 0.2], "wrist": [0.0, 0.0, -0.1]}


@pytest.mark.parametrize(
    ("own", "option", "work_at"),
    [
        (None, None, [0.0, 0.0, 0.2]),  # the learning point
        ("wrist", None, [0.0, 0.0, -0.1]),
        ([0, 0.01, 0], None, [0.0, 0.01, 0.0]),
        ("wrist", "0,0,0.05", [0.0, 0.0, 0.05]),
    ],
)
def test_the_hand_is_the_option_or_the_demonstrations_own_or_the_learning_point(
    own: object, option: str | None, work_at: list[float]
) -> None:
    meta = {"frames": {"tip": [0.0, 0.0, 0.2], "wrist": [0.0, 0.0, -0.1]}, "hand": own}
    assert frame_of(demonstrations(meta), LearnOptions(at="tip", hand=option))["work_at"] == work_at


def test_of_several_hands_the_first_ones_counts() -> None:
    pair = demonstrations({"hand": [0.0, 0.0, 0.1]}, {"hand": [0.0, 0.0, 0.3]})
    assert frame_of(pair, LearnOptions())["work_at"] == [0.0, 0.0, 0.1]


@pytest.mark.parametrize(
    ("meta", "options", "said"),
    [
        ({}, {"axes": "bse"}, "--axes: 'bse' is neither base nor phase_start"),
        ({"frames": {"tip": ORIGIN}}, {"at": "tpi"}, "unknown point 'tpi'; did you mean 'tip'"),
        ({}, {"hand": "wrist"}, "unknown point 'wrist'"),
        ({"hand": [0.0, 0.0, 0.1]}, {"hand": ""}, "unknown point ''"),
        ({"hand": "wrist"}, {}, "demo.npz: hand: unknown point 'wrist'"),
        ({"hand": [0.0, 1.0]}, {}, r"demo.npz: hand: is no point: \[0.0, 1.0\]; give \[x, y, z\] in metres"),
        ({"frames": {"tip": "x"}}, {}, "demo.npz: frames.tip: is no point: 'x'"),
        ({"frames": {"tip": [0.0, 0.0, float("nan")]}}, {}, "demo.npz: frames.tip: is no point"),
    ],
)
def test_what_is_no_point_or_no_axes_is_refused_in_words(meta: dict[str, Any], options: Any, said: str) -> None:
    with pytest.raises((InputError, UnknownName), match=said):
        frame_of(demonstrations(meta), LearnOptions(**options))


def test_nothing_is_learned_from_no_demonstration() -> None:
    with pytest.raises(InputError, match="no demonstration given; name at least one file"):
        frame_of([], LearnOptions())


def test_what_is_written_is_read_back_from_json() -> None:
    block = frame_at([0.0, 0.0, 0.2], axes="phase_start", hand=(0.1, 0.0, 0.0), frames={"tip": (0.0, 0.0, 0.2)})
    frame = read_frame(json.loads(json.dumps({"frame": block})))
    np.testing.assert_array_equal(frame.learned_at, [0.0, 0.0, 0.2])
    np.testing.assert_array_equal(frame.work_at, [0.1, 0.0, 0.0])
    np.testing.assert_array_equal(frame.points["tip"], [0.0, 0.0, 0.2])
    assert frame.from_start
    np.testing.assert_array_equal(frame.moved, ORIGIN)


def test_another_centre_is_told_apart_from_the_learning_point_and_the_document_stays() -> None:
    document = {"frame": frame_at([0.0, 0.0, 0.2], axes="base")}
    moved = read_frame(with_center(document, [0.0, 0.0, 0.25]))
    np.testing.assert_allclose(moved.moved, [0.0, 0.0, 0.05], atol=1e-15)
    np.testing.assert_array_equal(moved.learned_at, [0.0, 0.0, 0.2])
    assert document == {"frame": frame_at([0.0, 0.0, 0.2], axes="base")}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"work_at": None}, "frame.work_at: should be a list"),
        ({"learned_at": [0.0, 0.0]}, r"frame.learned_at: should be a point \[x, y, z\] of the tool frame in metres"),
        ({"center_of_compliance": [0.0, 0.0, True]}, "frame.center_of_compliance: should be a point"),
        ({"axes": "tool"}, "frame.axes: unknown axes 'tool'"),
        ({"frames": {"tip": [0.0]}}, "frame.frames.tip: should be a point"),
    ],
)
@pytest.mark.parametrize("where", ["", "a.json"])
def test_a_broken_block_is_refused_by_its_key(change: dict[str, Any], said: str, where: str) -> None:
    document = {"frame": {**frame_at(ORIGIN, axes="base"), **change}}
    with pytest.raises(InputError, match=f"^{where + ': ' if where else ''}{said}"):
        read_frame(document, where)


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_every_learner_writes_the_block_alike() -> None:
    one = example_demonstrations()[0]
    one = replace(one, meta={**one.meta, "hand": [0, 0, -0.1], "frames": {"tip": [0, 0, 0.01]}})
    options = LearnOptions(at="tip", settings={})
    blocks = {}
    for kind in ("lmc", "replay", "dmp", "gmr", "search"):
        learn = registry().skill(kind).learn
        assert learn is not None
        blocks[kind] = learn([one], options)["frame"]
    assert all(block == frame_of([one], options) for block in blocks.values()), blocks
    assert json.dumps(blocks["gmr"], sort_keys=True) == json.dumps(blocks["lmc"], sort_keys=True)
