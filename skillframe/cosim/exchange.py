"""Macro step of the master in C (exchange.c), for plants and banks with accessible arrays.

It equals `Master._exchange` for actuators with acceleration, work and refresh, without substeps.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.cosim.energy_balance import BondLedger, Float
from skillframe.fmu.actuator import DISCARD, Actuators
from skillframe.fmu.build import build_source


class PlantArrays(NamedTuple):
    """Arrays of a plant of N trials with k driven joints.

    Attributes:
        position, velocity, acceleration: (N, ...) with contiguous rows; load: (N, nv) other forces.
        applied: (N, nv) written forces; still: columns that stay zero.
        places, dofs: (k,) columns of driven joints in positions, and in the other arrays.
        step: [s] of `advance`.
        accelerate: updates accelerations; advance: does a step.
    """

    position: Float
    velocity: Float
    acceleration: Float
    load: Float
    applied: Float
    places: NDArray[np.int64]
    dofs: NDArray[np.int64]
    still: NDArray[np.int64]
    step: float
    accelerate: Callable[[], None]
    advance: Callable[[], None]


class _Exchange(ctypes.Structure):
    """Struct of exchange.c."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in (
            "position", "velocity", "acceleration", "load", "applied", "places", "dofs", "still", "u", "y", "active",
            "force", "after", "ledger", "slots", "go")),
        *((name, ctypes.c_int64) for name in (
            "position_step", "velocity_step", "acceleration_step", "applied_step", "trials", "joints", "freedoms",
            "n_still", "block", "u_width", "y_width", "at_position", "at_velocity", "at_acceleration", "force_column",
            "work_column")),
    ]  # fmt: skip


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    path = build_source(Path(__file__).with_name("exchange.c"))
    if path is None:
        return None
    library, whole, real = ctypes.CDLL(str(path)), ctypes.c_int64, ctypes.c_double
    arguments = {"push": [], "begin": [whole, real, real], "felt": [whole, real], "correct": [whole, real], "end": []}
    for name, given in arguments.items():
        function = getattr(library, name)
        function.argtypes = [ctypes.c_void_p, *given]
        function.restype = ctypes.c_int if name in ("begin", "correct") else None
    return library


class CompiledExchange:
    """Macro step of a plant, an `FmuBank` with a C step, and the forces (count,) on their bonds."""

    def __init__(
        self, plant: PlantArrays, bank: Any, ledger: BondLedger, force: Float, library: ctypes.CDLL
    ) -> None:  # fmt: skip
        self._plant, self._bank, self._ledger, self._library = plant, bank, ledger, library
        self._keep = [force, np.zeros_like(force), *(np.array(x, dtype=np.int64) for x in plant[5:8])]
        _, after, places, dofs, still = self._keep
        arrays = {
            "position": plant.position, "velocity": plant.velocity, "acceleration": plant.acceleration,
            "load": plant.load, "applied": plant.applied, "places": places, "dofs": dofs, "still": still, "u": bank.u,
            "y": bank.y, "active": bank.active, "force": force, "after": after, "ledger": ledger.rows,
        }  # fmt: skip
        told = _Exchange(**{name: array.ctypes.data for name, array in arrays.items()})
        told.slots, _, told.go = bank.native
        for name in ("position", "velocity", "acceleration", "applied"):
            setattr(told, f"{name}_step", arrays[name].strides[0] // 8)
        told.trials, told.joints, told.freedoms = len(plant.position), len(dofs), plant.load.shape[1]
        told.n_still, told.block = len(still), ledger.rows.shape[1]
        told.u_width, told.y_width = bank.u.shape[1], bank.y.shape[1]
        told.at_position, told.at_velocity, told.at_acceleration = map(
            bank.inputs.index, ("position", "velocity", "acceleration")
        )
        told.force_column, told.work_column = map(bank.outputs.index, ("force", "work"))
        self._told, self._at = told, ctypes.c_void_p(ctypes.addressof(told))

    def step(self, time: float, step: float) -> bool:
        """Step from `time` by `step` [s]. Returns False if an actuator failed."""
        at, library, plant, row = self._at, self._library, self._plant, self._ledger.claim()
        library.push(at)
        plant.accelerate()
        worst, fine = library.begin(at, row, time, step), True
        if worst >= DISCARD:
            fine = self._bank.settle(time, worst)
            library.felt(at, row, step)
        plant.advance()
        worst = library.correct(at, row, time)
        if worst >= DISCARD:
            fine = self._bank.settle(time, worst)
            library.end(at)
        return fine


def compiled_exchange(
    plant: Any, bank: Actuators, ledger: BondLedger, force: Float, step: float
) -> CompiledExchange | None:  # fmt: skip
    """A `CompiledExchange`, or None if plant, bank or compiler do not allow it."""
    arrays: PlantArrays | None = plant.arrays() if hasattr(plant, "arrays") else None
    if arrays is None or getattr(bank, "native", None) is None or abs(arrays.step - step) > 1e-12:
        return None
    library = _library()
    return None if library is None else CompiledExchange(arrays, bank, ledger, force, library)
