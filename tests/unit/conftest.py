"""Marks the tests of the core, which run where no plug-in is loaded and need not run again beside the plug-ins."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items):
    for item in items:
        if HERE in item.path.parents and not any(item.iter_markers("needs_plugins")):
            item.add_marker(pytest.mark.core)


def pytest_ignore_collect(collection_path, config):
    """Where the core's tests are not asked for, files that hold nothing else are not even imported."""
    if config.option.markexpr.startswith("not core") and collection_path.match("test_*.py"):
        return True if "needs_plugins" not in collection_path.read_text(encoding="utf-8") else None
    return None
