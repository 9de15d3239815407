"""What a watch leaves alone while the swing has not found the supply's pressure."""

import numpy as np

from plugins.hydraulics.tests.test_watch import PERIOD, C, Oil, balanced


def test_a_supply_above_the_declared_one_is_no_fault_while_the_swing_has_not_found_it():
    """215 bar where 190 are declared, with a prior of 30: at 186 bar in the chamber 2.7 times the flow goes in."""
    for pressure, sound in ((215e5, True), (450e5, False)):
        oil = Oil(swing=True, unsure=3e6)
        oil.p[0] = 186e5
        way = PERIOD * C.edge * 0.2 * np.sqrt(pressure - oil.p[0]) / C.area_a
        assert (balanced(0.2, oil=oil, way=way)[0] == []) == sound
    oil = Oil(swing=True)  # found, and no longer unsure
    oil.p[0] = 186e5
    assert balanced(0.2, oil=oil, way=PERIOD * C.edge * 0.2 * np.sqrt(29e5) / C.area_a)[0]
