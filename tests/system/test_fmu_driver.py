"""The FMU driver over long use: cheaper than fmpy's list interface, and no growth over a thousand runs."""

import ctypes
import gc
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from skillframe.actuation.actuator import ActuatorSpec
from skillframe.actuation.bindings import Instance
from skillframe.actuation.driver import FmuBank
from skillframe.actuation.inspection import inspect_fmu
from skillframe.actuation.library import find_fmu
from skillframe.actuation.toolchain import find_compiler
from tests.unit.actuation.fmu_fakes import Swing

pytestmark = [pytest.mark.slow, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
SPEC = ActuatorSpec(fmu="hydraulic_cylinder")
H = 1e-3


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def facts(request):
    return inspect_fmu(find_fmu("hydraulic_cylinder", version=request.param))


def bank(facts, **options):
    made = FmuBank([SPEC] * 3, [facts] * 3, **options)
    made.u[:, 0], made.u[:, 1] = 0.05, 0.3
    made.start()
    return made


def list_interface(facts):
    """Three instances driven as fmpy's documentation does: lists in, lists out."""
    kind = "Real" if facts.fmi_version.startswith("2") else "Float64"
    instances = [Instance(facts, str(i)) for i in range(3)]
    for instance in instances:
        instance.start({}, {0: 0.05, 1: 0.3}, 0.0)
    calls = [(getattr(x._fmu, f"set{kind}"), x._fmu.doStep, getattr(x._fmu, f"get{kind}")) for x in instances]
    refs_in, refs_out = [0, 1, 2, 3], [5, 6, 7, 8, 9, 10, 11, 12]

    def step(time_s):
        for put, go, take in calls:
            put(refs_in, [0.05, 0.3, 0.0, 0.0])
            go(time_s, H)
            take(refs_out)

    return step


def side_by_side(contenders, rounds=25, steps=200):
    """Least CPU time per step of each, taken in turn in one run."""
    best = dict.fromkeys(contenders, np.inf)
    for _ in range(rounds):
        for name, step in contenders.items():
            begin = time.process_time()
            for k in range(steps):
                step(k * H)
            best[name] = min(best[name], (time.process_time() - begin) / steps)
    return best


def test_a_step_of_three_cylinders_is_cheaper_than_fmpys_list_interface(facts):
    compiled, plain = bank(facts), bank(facts, compiled=False)
    assert compiled.compiled
    best = side_by_side(
        {"list": list_interface(facts), "c": lambda t: compiled.step(t, H), "ctypes": lambda t: plain.step(t, H)}
    )
    print(f"{best['list'] / best['c']:.1f}x with a compiler, {best['list'] / best['ctypes']:.1f}x without")
    # the bounds: 6x with a compiler, 3x without, both in one run on one machine
    assert best["list"] / best["c"] > 6.0, best
    assert best["list"] / best["ctypes"] > 3.0, best
    compiled.close()
    plain.close()


@pytest.mark.parametrize("dead_volume", [3e-3, 3e-4])
def test_a_millisecond_of_one_cylinder_costs_less_than_four_microseconds(dead_volume):
    """At random full-stroke commands, the very ones at which its pressures are within 10 Pa of scipy's Radau."""
    spec = ActuatorSpec(
        fmu="hydraulic_cylinder", parameters={"dead_volume_a": dead_volume, "dead_volume_b": dead_volume}
    )
    b = FmuBank([spec], [inspect_fmu(find_fmu("hydraulic_cylinder"))])
    swing, commands = Swing(), [0.0, *np.random.default_rng(0).uniform(-1, 1, 6)]
    inputs = np.array([[commands[k // 20], *swing.at(k * H)] for k in range(140)])
    best = np.inf
    for _ in range(50):
        b.u[0, :4] = 0.0, *swing.at(0.0)[:2], 0.0
        b.start()
        begin = time.process_time()
        for k, row in enumerate(inputs):
            b.u[0, :4] = row
            assert b.step(k * H, H)
        best = min(best, (time.process_time() - begin) / len(inputs))
    print(f"{dead_volume * 1e3:g} l: {best * 1e6:.2f} us a millisecond, writing the inputs from Python included")
    assert best < 4e-6
    b.close()


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
    before, begin = footprint(), time.process_time()
    byte_count, blocks = growth(run, 200)
    each = (time.process_time() - begin) / 1200
    assert footprint() == before
    # a leak of one state (1 kB) per run and instance would be 600 kB, of one object of Python's 200 blocks
    assert byte_count < 60_000
    assert blocks < 100
    assert each < 5e-3  # a run with its 20 steps: the second run's overhead is below 5 ms
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
