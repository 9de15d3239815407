"""Every test of FMUs builds into a cache of its own session and keeps its own list of allowed files."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from skillframe.actuation.inspection import inspect_fmu
from skillframe.actuation.library import find_fmu
from skillframe.actuation.toolchain import find_compiler


@pytest.fixture(scope="package", autouse=True)
def own_cache(tmp_path_factory):
    before = {name: os.environ.get(name) for name in ("XDG_CACHE_HOME", "XDG_CONFIG_HOME")}
    for name in before:
        os.environ[name] = str(tmp_path_factory.mktemp(name.lower()))
    yield
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


@pytest.fixture(scope="package")
def compiler():
    if find_compiler() is None:
        pytest.skip("no C compiler")


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
    from skillframe.actuation.actuator import ActuatorSpec
    from skillframe.actuation.library import fmu_folders
    from skillframe.actuation.reference import ReferenceBank
    from skillframe.actuation.table import read_table

    def make(sets):
        table = read_table(fmu_folders()["hydraulic_cylinder"])
        bank = ReferenceBank([ActuatorSpec(fmu="hydraulic_cylinder", parameters=p) for p in sets], table)
        bank.u[:, 1] = 0.3
        return bank

    return make
