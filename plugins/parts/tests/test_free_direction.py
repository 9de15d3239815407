import numpy as np
import pytest
from skillframe_parts.found import lines, values
from skillframe_parts.load import load

from tests.part_meshes import box, round_pair, write


def slot(half, wall=None):
    """A bar of 10 by 20 mm, 12 mm deep in a slot along y that leaves it `half` mm at either end, and its block."""
    bar = box((-5.0, -10.0, -12.0), (5.0, 10.0, 8.0))
    block = box((-15.0, -40.0, -17.0), (15.0, 40.0, 0.0)) - box((-5.2, -10.0 - half, -12.0), (5.2, 10.0 + half, 1.0))
    return bar, block + box((-5.2, *wall[:1], -12.0), (5.2, *wall[1:], -6.0)) if wall else block


def found(folder, parts):
    write(folder, *parts)
    loaded = load(folder / "fixture.toml")
    return values(loaded)["free_direction"], [line for line in lines(loaded) if "slides freely" in line]


def test_a_bar_in_a_long_slot_slides_along_it_and_worlds_says_so(tmp_path):
    along, (said,) = found(tmp_path, slot(3.0))
    assert np.abs(along) == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
    assert "slides freely by 2 mm both ways along (0, 1, 0)" in said


def test_a_tight_slot_at_any_angle_is_found(tmp_path):
    """0.02 mm of play, which lets a bar go 2 mm only within 0.6 degrees of the slot."""
    bar = box((-5.0, -10.0, -12.0), (5.0, 10.0, 8.0)).rotate([0.0, 0.0, 25.0])
    block = box((-25.0, -40.0, -17.0), (25.0, 40.0, 0.0)) - box((-5.02, -13.0, -12.0), (5.02, 13.0, 1.0))
    along, _ = found(tmp_path, (bar, block.rotate([0.0, 0.0, 25.0])))
    assert abs(float(np.dot(along, [-np.sin(np.radians(25.0)), np.cos(np.radians(25.0)), 0.0]))) > np.cos(0.01)


@pytest.mark.parametrize(
    "parts",
    [slot(1.9), round_pair(), slot(3.0, wall=(11.0, 13.0)), slot(3.0, wall=(-13.0, -11.0))],
    ids=["short", "round", "wall", "wall at the other end"],
)
def test_a_part_that_something_holds_within_the_tolerance_slides_nowhere(tmp_path, parts):
    assert found(tmp_path, parts) == (None, [])
