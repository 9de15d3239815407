"""Ranges: read off a text, kept by everything that is built, and the unit that a refusal suggests."""

import math
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.config import build, require_ranges, settings_of
from skillframe.config.units import UNITS, Range, range_of, require_within, shown, si, unit_of
from skillframe.errors import InputError

NEAR, LEAN = Range(-3.0, 3.0, "as far as arms reach"), Range(-math.pi / 2, math.pi / 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part.

    Attributes:
        width: of the part [m, 0.5mm to 0.2m].
        lean: of it [rad, -90deg to 90deg].
        pressure: inside [Pa, 1bar to 1000bar].
        share: of it [0 to 1].
        box: corners [m, -2m to 2m].
        places: by name [m, -2m to 2m].
        many: of them [3 to 16].
        free: of a range [N].
    """

    width: float = 0.01
    lean: float | None = 0.0
    pressure: float = 2e5
    share: float = 0.5
    box: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (1.0, 1.0))
    places: dict[str, float] = field(default_factory=dict)
    many: int = 4
    free: float = 1.0


def refusal(values):
    with pytest.raises(InputError) as caught:
        build(Part, values, "part.toml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("typed", "value", "unit", "limits", "said"),
    [
        (5, 5, "m", NEAR, "x: 5 m is beyond -3m to 3m, as far as arms reach; did you mean 5mm?"),
        ("5m", 5.0, "m", NEAR, "x: 5m is beyond -3m to 3m, as far as arms reach; did you mean 5mm?"),
        ("5000mm", 5.0, "m", NEAR, "x: 5000mm is beyond -3m to 3m, as far as arms reach; give -3m to 3m"),
        (1e5, 1e5, "m", NEAR, "did you mean 100000um?"),
        (-40, -40, "rad", LEAN, "x: -40 rad is beyond -90deg to 90deg; did you mean -40deg?"),
        (172, 172, "rad", LEAN, "x: 172 rad is beyond -90deg to 90deg; give -90deg to 90deg"),
        ("172deg", math.radians(172), "rad", LEAN, "x: 172deg is beyond -90deg to 90deg; give -90deg to 90deg"),
        (180, 180, "Pa", Range(1e5, 1e8), "x: 180 Pa is beyond 1bar to 1000bar; did you mean 180bar?"),
        (-0.1, -0.1, "", Range(0.0, 5.0), "x: -0.1 is beyond 0 to 5; give 0 to 5"),
        (math.inf, math.inf, "m", NEAR, "give -3m to 3m"),
        (math.nan, math.nan, "m", NEAR, "x: nan m is beyond"),
    ],
)
def test_a_number_beyond_its_range_is_refused_with_the_likely_unit(typed, value, unit, limits, said):
    with pytest.raises(InputError) as caught:
        require_within(typed, value, unit, limits, "x")
    assert said in str(caught.value)


@given(
    st.floats(-1e9, 1e9), st.sampled_from([(NEAR, "m"), (LEAN, "rad"), (Range(0.0, 1.0), "s"), (Range(1e5, 1e8), "Pa")])
)
def test_a_suggestion_always_lies_within_the_range_and_what_lies_there_is_never_refused(value, kind):
    limits, unit = kind
    try:
        require_within(value, value, unit, limits, "x")
    except InputError as error:
        assert not limits.least <= value <= limits.most
        if error.fix.startswith("did you mean "):
            meant = si(error.fix.removeprefix("did you mean ").removesuffix("?"), unit, "x")
            assert limits.least <= meant <= limits.most
    else:
        assert limits.least <= value <= limits.most


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"width": 8}, "part.toml.width: 8 m is beyond 0.5mm to 0.2m; did you mean 8mm?"),
        ({"width": "30cm"}, "30cm is beyond"),
        ({"lean": 30}, "did you mean 30deg?"),
        ({"lean": "200deg"}, "200deg is beyond -90deg to 90deg"),
        ({"pressure": 180}, "did you mean 180bar?"),
        ({"share": 2.0}, "2 is beyond 0 to 1"),
        ({"box": [[0, 0], [1, "3m"]]}, "part.toml.box[1][1]: 3m is beyond -2m to 2m; did you mean 3mm?"),
        ({"box": [[0, 0], [1, "3N"]]}, "part.toml.box[1][1]: expected a quantity in m, got 3N"),
        ({"places": {"a": 5}}, "part.toml.places.a: 5 m is beyond"),
        ({"many": 2}, "2 is beyond 3 to 16"),
        ({"share": "5mm"}, "expected a number without a unit"),
    ],
)
def test_a_field_is_held_to_the_range_that_its_text_states(values, said):
    assert said in refusal(values)


def test_units_are_read_in_lists_tables_and_optional_fields_as_well():
    made = build(Part, {"width": "8mm", "lean": "30deg", "box": [["1cm", 0], [0.5, "2m"]], "places": {"a": "5mm"},
                        "pressure": "180bar", "free": "2kN"}, "p")  # fmt: skip
    assert made == Part(width=0.008, lean=math.radians(30.0), box=((0.01, 0.0), (0.5, 2.0)), places={"a": 0.005},
                        pressure=18e6, free=2000.0)  # fmt: skip


def test_the_ends_of_a_range_belong_to_it_and_a_field_without_one_takes_any_number():
    assert build(Part, {"width": "0.5mm", "share": 1.0, "many": 16, "free": 1e30}, "p").free == 1e30
    assert build(Part, {"lean": None}, "p").lean is None


def test_what_was_built_by_hand_is_held_to_its_ranges_too():
    require_ranges(Part(), "part")
    require_ranges(None, "nothing")
    with pytest.raises(InputError, match=r"part\.width: 8 m is beyond 0\.5mm to 0\.2m; did you mean 8mm\?"):
        require_ranges(Part(width=8), "part")


def test_a_row_of_settings_has_unit_and_range_in_si():
    rows = {row["name"]: row for row in settings_of(Part)}
    assert (rows["width"]["unit"], rows["width"]["range"]) == ("m", (0.0005, 0.2))
    assert (rows["share"]["unit"], rows["share"]["range"]) == ("", (0.0, 1.0))
    assert (rows["free"]["unit"], rows["free"]["range"]) == ("N", None)


@pytest.mark.parametrize("about", ["of it [m]", "of it", "[N s/m, N m s/rad]", "[1, 2] of it", "between a and b"])
def test_a_text_without_ends_states_no_range(about):
    assert range_of(about) is None


@given(st.floats(-1e6, 1e6), st.sampled_from(sorted({unit for unit, _ in UNITS.values()})))
def test_a_number_is_shown_as_it_could_be_typed_again(value, unit):
    # six digits are shown: half of the last one is 5e-6 of the number
    assert si(shown(value, unit), unit, "x") == pytest.approx(value, rel=5.1e-6, abs=1e-300)
    assert unit_of(f"[{unit}, 1 to 2]") == unit
