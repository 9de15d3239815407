"""Marks the tests of the core, which run where no plug-in is loaded and need not run again beside the plug-ins."""

import sys
import textwrap
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


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Puts a plug-in's distribution on the path: install("one", code) gives one 1.0 with entry point and module one."""
    monkeypatch.syspath_prepend(tmp_path)
    made = []

    def make(name, code, version="1.0", entry_points=None, metadata=None):
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(code))
        info = tmp_path / f"{name}-{version}.dist-info"
        info.mkdir()
        if metadata is not False:
            (info / "METADATA").write_text(
                metadata or f"Metadata-Version: 2.1\nName: dist-{name}\nVersion: {version}\n"
            )
        (info / "entry_points.txt").write_text(entry_points or f"[skillframe]\n{name} = {name}\n")
        made.append(name)
        monkeypatch.setenv("SKILLFRAME_PLUGINS", ",".join(made))

    yield make
    for name in made:
        sys.modules.pop(name, None)
