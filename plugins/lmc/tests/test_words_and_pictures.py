import math
import xml.etree.ElementTree as ElementTree
from functools import cache

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc.describe import describe
from skillframe_lmc.explain import explain
from skillframe_lmc.learner import learn
from skillframe_lmc.projection import Plane
from skillframe_lmc.words import axis_words, direction_words, listed
from skillframe_testkit.suites import SkillConformance

from skillframe.document.file import learned
from skillframe.extend import Document, Illustration, LearnOptions, SkillType
from skillframe.extend.registry import registry
from skillframe.frames import norm, unit

NOISE = syn.Recipe(noise_m=5e-5, noise_n=0.3)
CASES = {
    "valley": syn.valley(45, 0.2, NOISE),
    "single": syn.valley(45, 0.2, NOISE)[:1],
    "levering": [syn.levering(NOISE)],
    "alignment": syn.pair_of_alignments(NOISE),
    "contradiction": [syn.straight([s, 0, -1], 0.06, [0, 0, 0], NOISE) for s in (1.0, -1.0)],
    "still": [syn.straight([0, 0, -1], 0.0004, [0, 0, 40.0], syn.Recipe(speed=1e-4))],
    "screw": [syn.turning([0, 0, 1], 2.0, [0, 0, -0.5], force=[0, 0, 5.0], pitch=-0.01)],
    "environment turns": [syn.turning([0.0, 0.0, 1.0], 1.0, [0.0, 0.0, 0.5])],
}


@cache
def document(case: str) -> Document:
    return learn(CASES[case], LearnOptions())


@cache
def drawn(case: str) -> list[Illustration]:
    return list(explain(document(case)))


class TestLmc(SkillConformance):
    skill_type = "lmc"


@pytest.mark.slow  # the same law in other axes
class TestLmcInTheAxesOfTheStart(SkillConformance):
    skill_type = "lmc"

    def _document(self) -> Document:
        kind: SkillType = registry().skill("lmc")
        return learned(kind, CASES["screw"], LearnOptions(axes="phase_start"))


@pytest.mark.parametrize(
    ("case", "headline"),
    [
        ("valley", "push along -z at 20 mm/s; free along x; holds its orientation"),
        ("alignment", "push along -z at 20 mm/s; free along x; turns freely about y"),
        ("levering", "position free in every direction; turn about +y at 5 degrees/s; holds its orientation otherwise"),
        ("still", "holds its position; holds its orientation"),
        ("screw", "push along -z at 0.873 mm/s; turn about +z at 5 degrees/s; holds its orientation otherwise"),
    ],
)
def test_the_headline_says_what_the_skill_does(case: str, headline: str) -> None:
    words = headline.removesuffix("; holds its orientation otherwise")
    assert describe(document(case))[0] == words


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] * (case in ("single", "contradiction", "screw"))) for case in CASES],
)
def test_every_skill_can_be_told_and_drawn(case: str) -> None:
    found = document(case)
    lines = describe(found)
    assert len(lines) >= 4
    assert all(lines)
    for picture in drawn(case):
        assert ElementTree.fromstring(picture.svg).tag.endswith("svg")
        assert picture.title
        assert picture.caption
        assert "pushs" not in picture.caption


def test_an_open_direction_is_said_in_a_line() -> None:
    assert any("record another demonstration from the other side" in line for line in describe(document("single")))
    assert not any("other side" in line for line in describe(document("valley")))


@pytest.mark.slow
def test_drawing_twice_gives_the_same_text() -> None:
    assert [p.svg for p in explain(document("valley"))] == [p.svg for p in drawn("valley")]


def test_pictures_reach_for_nothing_outside() -> None:
    for picture in drawn("alignment"):
        addresses = [part.split('"')[0] for part in picture.svg.split('href="')[1:]]
        assert all(address.startswith(("#", "data:")) for address in addresses)


def test_the_file_stays_small_however_long_the_demonstrations() -> None:
    import json

    long = [syn.slide(45, 0.2, NOISE, side=s, length=1.0) for s in (1.0, -1.0)] * 5
    assert len(json.dumps(learn(long, LearnOptions()))) < 300_000


def test_directions_near_an_axis_are_named_after_it() -> None:
    assert direction_words(np.array([0.0, 0.1, -0.995])) == "-z"
    assert direction_words(unit(np.array([1.0, 0.0, -1.0]))) == "(0.71, 0.00, -0.71)"
    assert axis_words(np.array([-1.0, 0.0, 0.0])) == "x"
    assert listed(["x", "y", "z"]) == "x, y and z"


@pytest.mark.parametrize("centre", [[0, 0, -1], [1, 0, 0], [0.6, -0.64, 0.48]])
def test_the_projection_keeps_angles_from_its_centre_and_can_be_undone(centre: list[float]) -> None:
    plane = Plane(np.array(centre, dtype=float))
    directions = unit(np.random.default_rng(0).normal(size=(50, 3)))
    points = plane.to_plane(directions)
    assert np.allclose(plane.to_sphere(points), directions, atol=1e-9)
    assert np.allclose(norm(points), np.degrees(np.arccos(np.clip(directions @ plane.centre, -1, 1))), atol=1e-6)
    for tangent, k in ((plane.right, plane.labels[0]), (plane.up, plane.labels[1])):
        assert tangent["xyz".index(k)] > 0.0 or math.isclose(tangent["xyz".index(k)], 0.0)


def test_a_stiffness_of_which_only_rounding_is_left_is_read_as_none() -> None:
    """Three compliant axes leave k (I - sum a a^T), zero but for rounding, which may be just below it."""
    given = learned(registry().skill("lmc"), CASES["valley"], LearnOptions())
    part = {**given["phases"][0]["rotation"], "stiffness": [[2e-15, 0.0, 0.0], [0.0, -4e-15, 1e-15], [0.0, 1e-15, 0.0]]}
    assert describe({**given, "phases": [{**given["phases"][0], "rotation": part}]})


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ([(0.6, 0.8, 0.0), (-0.8, 0.6, 0.0)], "x and y"),
        ([(0.0, 0.05, 1.0), (1.0, 0.0, 0.0)], "x and z"),
        ([(1.0, 0.0, 0.0)], "x"),
        ([(0.6, 0.0, -0.8), (0.0, 1.0, 0.0)], "every direction square to (0.80, 0.00, 0.60)"),
    ],
)
def test_a_free_plane_is_named_by_the_axes_that_span_it_and_not_by_two_odd_ones(axes, said):
    from types import SimpleNamespace

    from skillframe_lmc.describe import _axes

    assert _axes(SimpleNamespace(compliant_axes=np.array(axes))) == said
