"""For every test, of the core and of plug-ins: what needs plug-ins is skipped where none may load."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator

import hypothesis
import pytest

from skillframe.extend.registry import registry

# A law that holds slowly on a loaded machine still holds; speed has its benchmarks.
hypothesis.settings.register_profile("skillframe", deadline=None)
hypothesis.settings.load_profile("skillframe")

# A shell starts what runs in the background deaf to Ctrl-C, and the programs that tests interrupt would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# No test cuts the power, and waiting for the disk takes the tests of campaigns longer than their work.
os.fsync = lambda descriptor: None


def pytest_collection_finish() -> None:
    """Leave what was imported and collected out of garbage collections: a million objects that stay."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what is marked `needs_plugins` where `SKILLFRAME_PLUGINS` is empty."""
    if os.environ.get("SKILLFRAME_PLUGINS") != "":
        return
    skip = pytest.mark.skip(reason="SKILLFRAME_PLUGINS is empty: no plug-in is loaded")
    for item in items:
        if item.get_closest_marker("needs_plugins"):
            item.add_marker(skip)


@pytest.fixture
def fresh_registry() -> Iterator[None]:
    """The process's registry is loaded afresh in this test, and again after it."""
    registry.cache_clear()
    yield
    registry.cache_clear()
