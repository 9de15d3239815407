"""Rows of the FMU driver: three cylinders against fmpy's list interface, and one cylinder by itself."""

from __future__ import annotations

import time

import numpy as np

H = 1e-3


def bank(facts, **options):
    """Three cylinders at rest in one bank."""
    from skillframe.fmu.actuator import ActuatorSpec
    from skillframe.fmu.driver import FmuBank

    made = FmuBank([ActuatorSpec(fmu="hydraulic_cylinder")] * 3, [facts] * 3, **options)
    made.u[:, 0], made.u[:, 1] = 0.05, 0.3
    made.start()
    return made


def list_interface(facts):
    """Three instances driven as fmpy's documentation does: lists in, lists out."""
    from skillframe.fmu.bindings import Instance

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


def compared(facts):
    """Least CPU seconds of a step of three cylinders: fmpy's lists, our driver with a compiler and without."""
    fast, plain = bank(facts), bank(facts, compiled=False)
    return side_by_side(
        {"list": list_interface(facts), "c": lambda t: fast.step(t, H), "ctypes": lambda t: plain.step(t, H)}
    )


def swinging(facts, dead_volume):
    """Least CPU seconds of a millisecond of one cylinder at random full-stroke commands, writing its inputs included.

    They are the very ones at which its pressures are within 10 Pa of scipy's Radau in the tests.
    """
    from skillframe.fmu.actuator import ActuatorSpec
    from skillframe.fmu.driver import FmuBank
    from tests.unit.fmu.fmu_fakes import Swing

    volumes = {"dead_volume_a": dead_volume, "dead_volume_b": dead_volume}
    bank = FmuBank([ActuatorSpec(fmu="hydraulic_cylinder", parameters=volumes)], [facts])
    swing, commands = Swing(), [0.0, *np.random.default_rng(0).uniform(-1, 1, 6)]
    inputs = np.array([[commands[k // 20], *swing.at(k * H)] for k in range(140)])
    best = np.inf
    for _ in range(50):
        bank.u[0, :4] = 0.0, *swing.at(0.0)[:2], 0.0
        bank.start()
        begin = time.process_time()
        for k, row in enumerate(inputs):
            bank.u[0, :4] = row
            assert bank.step(k * H, H)
        best = min(best, (time.process_time() - begin) / len(inputs))
    bank.close()
    return best


def rows(show):
    """Print the driver's rows with `run.show`."""
    from skillframe.fmu.build import find_fmu
    from skillframe.fmu.inspection import inspect_fmu

    for version in (2, 3):
        facts = inspect_fmu(find_fmu("hydraulic_cylinder", version=version))
        best = compared(facts)
        for how, bound in (("c", 6.0), ("ctypes", 3.0)):
            what = f"3 cylinders, FMI {version}, fmpy's lists over our driver ({how})"
            show(what, best["list"] / best[how], "x", bound, below=False)
        show(f"1 cylinder, FMI {version}, a millisecond at constant input", 1e6 * best["c"] / 3, "us", 4.0)
        for litres in (3.0, 0.3):
            what = f"1 cylinder, FMI {version}, full strokes, dead volumes of {litres:g} l"
            show(what, 1e6 * swinging(facts, 1e-3 * litres), "us", 4.0)
