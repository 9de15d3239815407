"""For every test, of the core and of plug-ins: what needs plug-ins is skipped where none may load."""

from __future__ import annotations

import gc
import os
import random
import signal
import sys
import textwrap
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


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--shuffle SEED`: no test may lean on what another left behind."""
    parser.addoption("--shuffle", type=int, metavar="SEED", help="files in random order, and the tests of each file")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Shuffle if asked, and skip what is marked `needs_plugins` where `SKILLFRAME_PLUGINS` is empty."""
    if (seed := config.getoption("--shuffle")) is not None:
        rng = random.Random(seed)
        files = {path: rng.random() for path in dict.fromkeys(item.path for item in items)}
        items.sort(key=lambda item: (files[item.path], rng.random()))
    if os.environ.get("SKILLFRAME_PLUGINS") not in ("", "worlds"):
        return
    skip = pytest.mark.skip(reason="SKILLFRAME_PLUGINS leaves out all plug-ins but the worlds")
    for item in items:
        if item.get_closest_marker("needs_plugins"):
            item.add_marker(skip)


@pytest.fixture
def fresh_registry() -> Iterator[None]:
    """The process's registry is loaded afresh in this test, and again after it."""
    registry.cache_clear()
    yield
    registry.cache_clear()


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a distribution on the path: `install("one", code)` gives "one" 1.0 with entry point and module one."""
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
        monkeypatch.setenv("SKILLFRAME_PLUGINS", ",".join(["worlds", *made]))

    yield make
    for name in made:
        sys.modules.pop(name, None)
