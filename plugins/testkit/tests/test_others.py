"""The checks of worlds, formats and segmenters have teeth too."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from skillframe_testkit.checks import check_reader, check_segmenter, check_world
from skillframe_testkit.checks.readers import differences
from skillframe_testkit.suites import ReaderConformance, WorldConformance, example_demonstrations

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend import ReaderType, SegmenterType, WorldType
from skillframe.extend.registry import load_registry

CORE = load_registry()
VALLEY = CORE.world("valley")


class TestTheValleyThroughTheSuite(WorldConformance):
    world = "valley"


class TestTheNativeFormThroughTheSuite(ReaderConformance):
    reader = "npz"


def altered(**changes):
    return replace(VALLEY, build=lambda params: replace(VALLEY.build(params), **changes))


def tool(**changes):
    return replace(VALLEY.build(VALLEY.params()).tool, **changes)


@dataclass
class Loose:
    slope: float = 0.5


def count_up(start=[0.0]):  # noqa: B006 - it is to differ from call to call
    start[0] += 1.0
    return start[0]


@pytest.mark.parametrize(
    ("world", "said"),
    [
        (altered(name="vale"), "calls itself 'vale'"),
        (altered(friction=-0.1), "friction is -0.1"),
        (altered(start_quaternion=(0.0, 0.0, 0.0, 2.0)), "quaternion of start is not of unit length"),
        (altered(tool=tool(frames={})), "no frame 'tip'"),
        (altered(tool=tool(hand="elbow")), "hand 'elbow' is not one of its frames"),
        (altered(tool=tool(mass=0.0)), "no body has mass"),
        (altered(tool=tool(inertia=(1.0, 1.0, 3.0))), "no body has mass"),
        (altered(goal=lambda state: True), "goal gave array(True) for 3 trials"),
        (altered(goal=lambda state: np.zeros(3)), "goal gives float64, expected bool"),
        (altered(goal=lambda state: np.ones(3, dtype=bool)), "the goal is reached at the start"),
        (altered(goal_error=lambda state: (np.zeros(3), np.full(3, np.nan))), "goal_error[1]"),
        (replace(VALLEY, build=lambda p: replace(VALLEY.build(p), friction=count_up())), "building twice"),
        (replace(VALLEY, params=Loose), "params is not frozen"),
        (replace(VALLEY, params=dict), "not a dataclass"),
        (replace(VALLEY, build=lambda p: 1 / 0), "scene: raised ZeroDivisionError"),
    ],
)
def test_a_world_that_is_wrong_is_told_in_words(world, said):
    assert isinstance(world, WorldType)
    assert any(said in problem for problem in check_world(world)), check_world(world)


MEMORY = {}


def remember(demonstration, path):
    MEMORY[path] = demonstration
    path.write_text("kept in memory")


def recall(path, options):
    if path not in MEMORY:
        raise InputError(path, "was never written")
    return MEMORY[path]


def reader(**changes):
    values = {"name": "memory", "summary": "", "suffixes": (".mem",), "read": recall, "write": remember}
    return ReaderType(**{**values, **changes})


def shortened(path, options):
    return recall(path, options).between(0.0, 1.0)


def shifted(path, options):
    d = recall(path, options)
    return Demonstration(
        time=d.time, position=d.position + 1e-6, quaternion=d.quaternion, wrench=d.wrench, meta={**d.meta, "task": "?"}
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"suffixes": ()}, "suffixes are ()"),
        ({"suffixes": ("mem",)}, "suffixes are ('mem',)"),
        ({"read": shortened}, "has shape"),
        ({"read": shifted}, "position differs by 1e-06"),
        ({"read": shifted}, "metadata changed when read back: task"),
        ({"read": lambda path, options: example_demonstrations()[0]}, "missing is read without complaint"),
        ({"read": lambda path, options: 1 / 0}, "raises ZeroDivisionError, not InputError"),
    ],
)
def test_a_format_that_is_wrong_is_told_in_words(changes, said):
    assert any(said in problem for problem in check_reader(reader(**changes)))


def test_a_format_that_returns_what_was_written_conforms():
    assert check_reader(reader()) == []


def test_a_refusal_that_does_not_name_the_file_is_told():
    def shrug(path, options):
        if path not in MEMORY:
            raise InputError("a file", "is no good")
        return MEMORY[path]

    assert any("does not name the file" in problem for problem in check_reader(reader(read=shrug)))


def test_a_demonstration_has_no_differences_from_itself():
    demonstration = example_demonstrations()[0]
    assert list(differences(demonstration, demonstration)) == []


def segmenter(boundaries, labels, rows=2, **more):
    row = {"file": "", "boundaries": boundaries, "labels": labels}
    document = {"phase_model": {}, "demonstrations": [row] * rows, **more}
    return SegmenterType(name="fixed", summary="", fit=lambda demos, phases, settings: document)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (segmenter([1.0], [0, 1], rows=1), "1 entries for 2 demonstrations"),
        (segmenter([0.0], [0, 1]), "not inner times"),
        (segmenter([1.0, 0.5], [0, 1, 0]), "not inner times in increasing order"),
        (segmenter([1.0], [0]), "1 labels for 2 intervals"),
        (segmenter([1.0], [0, 2]), "labels [0, 2] are not below 2"),
        (segmenter([1.0], [0, 1], phase_model=(1,)), "changes when written as JSON"),
        (SegmenterType(name="none", summary="", fit=lambda *a: {}), "there is no 'phase_model'"),
        (SegmenterType(name="chance", summary="", fit=lambda *a: {"x": count_up()}), "twice gives different results"),
        (SegmenterType(name="raises", summary="", fit=lambda *a: 1 / 0), "number of phases found: raised"),
    ],
)
def test_a_segmenter_that_is_wrong_is_told_in_words(found, said):
    assert any(said in problem for problem in check_segmenter(found))


def test_a_segmenter_that_keeps_the_contract_has_no_problems():
    assert check_segmenter(segmenter([1.0], [0, 1])) == []
