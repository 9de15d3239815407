"""The FMU driver over long use: no growth over a thousand runs."""

import ctypes
import gc
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from skillframe.fmu.build import find_compiler, find_fmu
from skillframe.fmu.inspection import inspect_fmu
from tests.benchmarks.driver import H, bank

pytestmark = [pytest.mark.slow, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def facts(request):
    return inspect_fmu(find_fmu("hydraulic_cylinder", version=request.param))


@pytest.fixture
def own_temporary_folder(tmp_path, monkeypatch):
    """A folder for temporary files that no other process of the machine writes to."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))


class _Heap(ctypes.Structure):
    """What glibc's `mallinfo2` fills in."""

    _fields_ = [
        *[(name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd")],
        *[(name, ctypes.c_size_t) for name in ("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")],
    ]


def in_use():
    """Bytes that `malloc` has given out, and blocks that Python has.

    Not resident pages: those also hold what the process' other tests left free, which hides a leak and looks like one.
    """
    gc.collect()  # with many other objects about, Python lets cycles wait long
    account = ctypes.CDLL(None).mallinfo2
    account.restype = _Heap
    heap = account()
    return np.array([heap.uordblks + heap.hblkhd, sys.getallocatedblocks()])


def footprint():
    """Temporary files, open files and mapped libraries."""
    gc.collect()  # what earlier tests of this process left behind goes now, not in between
    libraries = sum(".so" in line for line in Path("/proc/self/maps").read_text().splitlines())
    return len(list(Path(tempfile.gettempdir()).iterdir())), len(list(Path("/proc/self/fd").iterdir())), libraries


def growth(run, runs, generations=5):
    """Least growth of (bytes, Python's blocks) over several generations of runs, after one to warm up.

    A leak grows in every generation; a table of Python's (of interned names, 1 MB and more) doubles in one.
    """
    marks = []
    for _ in range(generations + 1):
        for _ in range(runs):
            run()
        marks.append(in_use())
    return np.diff(marks, axis=0).min(axis=0)


@pytest.mark.usefixtures("own_temporary_folder")
def test_a_thousand_runs_grow_no_memory_files_or_temporary_folders(facts):
    b = bank(facts)

    def run():
        b.u[:] = [0.05, 0.3, 0.0, 0.0]
        b.start()
        b.save()
        for k in range(20):
            assert b.step(k * H, H)
        b.restore()

    run()
    before = footprint()
    byte_count, blocks = growth(run, 200)
    assert footprint() == before
    # a leak of one state (1 kB) per run and instance would be 600 kB, of one object of Python's 200 blocks
    assert byte_count < 60_000
    assert blocks < 100
    b.close()


@pytest.mark.usefixtures("own_temporary_folder")
def test_opening_and_closing_banks_leaves_nothing_behind(facts):
    bank(facts).close()
    before = footprint()
    byte_count, blocks = growth(lambda: bank(facts).close(), 100)
    assert footprint() == before
    # a leak of one state (1 kB) per instance would be 300 kB, of one object of Python's per bank 100 blocks
    assert byte_count < 30_000
    assert blocks < 50
