"""Marks the tests of the core, which run where no plug-in is loaded and need not run again beside the plug-ins."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items):
    for item in items:
        if HERE in item.path.parents and not any(item.iter_markers("needs_plugins")):
            item.add_marker(pytest.mark.core)
