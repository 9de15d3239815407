"""A tool that comes down at 5 cm/s with 700 kg behind it stays where it lands, as far as its sensors let it."""

import pytest

from tests.figures.crane_contact import precise, pressed

pytestmark = pytest.mark.slow


def test_the_crane_that_ships_stays_on_wood():
    """1e6 N/m. True forces, every millisecond."""
    assert pressed(1e6, mass=1.02, friction=0.8).lost == 0.0


@pytest.mark.figures
def test_one_with_encoders_of_twenty_bits_stays_on_five_times_that():
    assert pressed(5e6, robot=precise()).lost == 0.0
