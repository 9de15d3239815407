"""Fixtures of tests that build FMUs: a cache and an allow-list of their own, and a compiler or a skip."""

import os

import pytest

from skillframe.fmu.build import find_compiler


@pytest.fixture(scope="package", autouse=True)
def own_cache(tmp_path_factory):
    """The cache is that of all tests of one run, of whatever process: each FMU is built once. Allow-lists are not."""
    before = {name: os.environ.get(name) for name in ("XDG_CACHE_HOME", "XDG_CONFIG_HOME")}
    base = tmp_path_factory.getbasetemp()
    os.environ["XDG_CACHE_HOME"] = str((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "built")
    os.environ["XDG_CONFIG_HOME"] = str(tmp_path_factory.mktemp("xdg_config_home"))
    yield
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


@pytest.fixture(scope="package")
def compiler():
    if find_compiler() is None:
        pytest.skip("no C compiler")
