"""FMUs of our cylinder and banks of it, for every test of actuators."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from skillframe.fmu.build import find_fmu
from skillframe.fmu.inspection import inspect_fmu
from tests import fmu_cache

compiler, own_cache = fmu_cache.compiler, fmu_cache.own_cache


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def cylinder(request, own_cache, compiler):
    """Facts of our cylinder, in either version of the standard."""
    return inspect_fmu(find_fmu("hydraulic_cylinder", version=request.param))


@pytest.fixture(scope="package")
def cylinder2(own_cache, compiler):
    return inspect_fmu(find_fmu("hydraulic_cylinder", version=2))


@pytest.fixture
def reference():
    """Makes a bank of the Python reference with one cylinder per parameter set, at mid stroke."""
    from skillframe_hydraulics.cylinder.reference import ReferenceBank

    from skillframe.fmu.actuator import ActuatorSpec
    from skillframe.fmu.build import fmu_folders
    from skillframe.fmu.table import read_table

    def make(sets):
        table = read_table(fmu_folders()["hydraulic_cylinder"])
        bank = ReferenceBank([ActuatorSpec(fmu="hydraulic_cylinder", parameters=p) for p in sets], table)
        bank.u[:, 1] = 0.3
        return bank

    return make
