"""A trial's own supply pressure decides what its cylinders can hold."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skillframe_hydraulics.checks.feasibility import require_held

from skillframe.errors import InputError
from skillframe.robot.spec import load_robot

ACTUATION = load_robot("hiab_xs031").actuation
AREA_A = math.pi / 4 * 0.080**2
AREA_B = AREA_A - math.pi / 4 * 0.045**2
RETURN, RELIEF = 10e5, 250e5  # Pa; port relief is the FMU's default


def held(lift, supply):
    require_held(ACTUATION, np.array([[lift, 0.0, 0.0]]), np.full((1, 3), supply), "crane")


@given(st.floats(40e5, 300e5), st.booleans())
def test_a_load_is_held_up_to_what_the_areas_and_both_pressures_give(supply, push):
    borne = min(supply, RELIEF)
    most = AREA_A * borne - AREA_B * RETURN if push else -(AREA_B * borne - AREA_A * RETURN)
    held(0.999 * most, supply)
    with pytest.raises(InputError, match=f"lift_piston would have to {'push' if push else 'pull'} .* kN that"):
        held(1.001 * most, supply)


def test_only_the_trial_that_cannot_be_held_is_named_with_its_pressure():
    supply = np.array([[190e5] * 3, [100e5] * 3])
    require_held(ACTUATION, np.full((1, 3), 3e3), supply[:1], "crane")
    with pytest.raises(InputError, match=r"^crane: lift_piston would .* 55.0 kN, more than the 46.8 kN that 100 bar"):
        require_held(ACTUATION, np.array([[55e3, 0.0, 0.0]] * 2), supply, "crane")
