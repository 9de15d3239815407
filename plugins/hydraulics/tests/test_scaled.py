"""Factors of a machine's cylinders in a campaign: of all, of one, and what has none of them."""

import numpy as np
import pytest
from skillframe_hydraulics.cylinder.bank import instance_parameters

from skillframe.errors import InputError
from skillframe.extend.drives import check_quantities
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

HOLD = np.zeros((2, 3))
NAMES = {"valve_scale": "rated_flow", "bulk_scale": "bulk_modulus", "friction_scale": "viscous_friction"}


def rows(**factors):
    draws = {f"actuator.{name}": np.array(values) for name, values in factors.items()}
    check_quantities(draws, load_model(load_robot("hiab_xs031")))
    return instance_parameters(load_robot("hiab_xs031"), draws, HOLD)


@pytest.mark.parametrize(("factor", "name"), NAMES.items())
def test_a_factor_scales_every_cylinder_and_one_with_a_number_its_own_besides(factor, name):
    plain = [a.parameters[name] for a in load_robot("hiab_xs031").actuation]
    found = rows(**{factor: [1.1, 1.0], f"{factor}_2": [0.5, 2.0]})
    expected = np.outer([1.1, 1.0], plain) * [[1.0, 0.5, 1.0], [1.0, 2.0, 1.0]]
    np.testing.assert_allclose([row[name] for row in found], expected.ravel(), rtol=1e-15)  # a product's rounding


def test_a_factor_leaves_every_other_figure_and_cylinder_alone():
    found = rows(valve_scale_3=[0.9, 0.9])
    assert [sorted(row) for row in found] == [["initial_force"], ["initial_force"], ["initial_force", "rated_flow"]] * 2


def test_a_valve_without_flow_and_a_cylinder_that_is_not_there_are_refused():
    for name in ("valve_scale", "bulk_scale_1"):
        with pytest.raises(InputError, match=f"actuator.{name}: 0 is beyond 0.01 to 100"):
            rows(**{name: [0.0, 1.0]})
    with pytest.raises(InputError, match="panda has no drive with such a quantity"):
        check_quantities({"actuator.valve_scale_1": np.ones(1)}, load_model(load_robot("panda")))
    with pytest.raises(InputError, match="panda_servo has no drive with such a quantity"):
        check_quantities({"actuator.friction_scale_1": np.ones(1)}, load_model(load_robot("panda_servo")))
