"""The figures of the code base stay within their bounds, and a bound falls with its figure."""

import pytest

from tests import house

SLACK = 1.03
"""A bound is this much above its figure at most, so that it is lowered where the figure falls."""


@pytest.fixture(scope="module")
def figures():
    return house.figures()


@pytest.mark.parametrize("name", house.bounds())
def test_a_figure_of_the_code_base_is_within_its_bound_and_the_bound_near_it(figures, name):
    value, most = figures[name], house.bounds()[name]
    assert value <= most, f"{name} is {value:,}, at most {most:,}: python -m tests.house"
    near = max(SLACK * value, value + 2)
    assert most <= near, f"{name} is {value:,}: lower its bound of {most:,} in tests/house.toml"


def test_every_figure_has_a_bound(figures):
    assert figures.keys() == house.bounds().keys()
