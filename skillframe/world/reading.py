"""Jacobian, wrist sensor and quaternions in C (reading.c), bit-identical to the NumPy code and faster.

Without a compiler the NumPy code runs.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.build import Record, library
from skillframe.frames import Float, Pose, quaternion_from_matrix, unit

if TYPE_CHECKING:
    from skillframe.world.layout import Layout

SOURCE = Path(__file__).with_name("reading.c")


class CompiledJacobian:
    """Jacobians (N, 6, nv) of points of an arm's tool frame, from views of MuJoCo's arrays."""

    def __init__(
        self, layout: Layout, anchor: Float, axis: Float, matrix: Float, tool: Pose, built: ctypes.CDLL
    ) -> None:  # fmt: skip
        count, nv = len(anchor), int(layout.model.nv)
        self._rotation = tool.rotation
        self._turned, self._out = np.zeros((count, 3, 1)), np.zeros((count, 6, nv))
        if layout.free:
            self._out[:, [0, 1, 2], [0, 1, 2]] = 1.0
        hinges, hinge_dofs, slides, slide_dofs = (
            _numbers(part)
            for part in (layout.hinges, layout.hinge_dofs, layout.slides, layout.slide_dofs)
        )  # fmt: skip
        record = Record({
            "anchor": anchor, "axis": axis, "matrix": matrix, "position": tool.position, "turned": self._turned,
            "jacobian": self._out, "hinges": hinges, "hinge_dofs": hinge_dofs, "slides": slides,
            "slide_dofs": slide_dofs, "anchor_step": _step(anchor), "axis_step": _step(axis),
            "matrix_step": _step(matrix), "position_step": _step(tool.position), "trials": count,
            "n_hinges": len(hinges), "n_slides": len(slides), "nv": nv,
            "base": int(layout.model.jnt_bodyid[0]) if layout.free else -1,
        })  # fmt: skip
        self._jacobian = record.bound(built, "jacobian")

    def at(self, offset: Float) -> Float:
        """Jacobian of the point `offset` (3,) or (N, 3), in tool axes, as a new array in base axes."""
        np.matmul(self._rotation, offset[..., None], out=self._turned)
        self._jacobian()
        return self._out.copy()


class CompiledWrist:
    """Force-torque sensors of N trials.

    Args:
        sensor: (N, 6) of the simulator, a view.
        noise: (B, N, 12) samples, which their owner writes.
        bias: (N, 6), which its owner writes.
        weight: (3,) of the tool.
        center: (3,) of its mass.
        built: reading.c.
    """

    def __init__(
        self, sensor: Float, noise: Float, bias: Float, weight: Float, center: Float, built: ctypes.CDLL
    ) -> None:  # fmt: skip
        count = len(sensor)
        self._raw, self._wrench, self._lever = np.zeros((count, 2, 3)), np.zeros((count, 2, 3)), np.zeros((count, 3, 1))
        self._center = center[:, None]
        record = Record({
            "sensor": sensor, "noise": noise, "bias": bias, "weight": weight, "lever": self._lever,
            "raw": self._raw, "wrench": self._wrench, "sensor_step": _step(sensor), "trials": count,
        })  # fmt: skip
        self._felt, self._weightless = record.bound(built, "felt", ctypes.c_int64), record.bound(built, "weightless")

    def wrench(self, sample: int, rotation: Float) -> Float:
        """Wrench (N, 6) with a noise sample and without tool weight, for measured rotations (N, 3, 3)."""
        self._felt(sample)
        np.matmul(self._raw, rotation.mT, out=self._wrench)
        np.matmul(rotation, self._center, out=self._lever)
        self._weightless()
        return self._wrench.reshape(-1, 6).copy()


class Quaternions:
    """Unit quaternions of twice `count` rotations, as `skillframe.frames.quaternion_from_matrix`, in C."""

    def __init__(self, count: int) -> None:
        self._rotation, self._row = np.zeros((2, count, 3, 3)), np.zeros((2, count, 4))
        built = library(SOURCE)
        record = Record({"rotation": self._rotation, "row": self._row, "count": 2 * count})
        self._rows = None if built is None else record.bound(built, "quaternions")

    def of(self, first: Float, second: Float) -> Float:
        """(2, N, 4) x, y, z, w of rotations (N, 3, 3)."""
        self._rotation[0], self._rotation[1] = first, second
        if self._rows is None or self._rows():
            return quaternion_from_matrix(self._rotation)
        found = unit(self._row)
        quaternions: Float = np.where(found[..., 3:] < 0.0, -found, found)
        return quaternions


def compiled_jacobian(
    layout: Layout, anchor: Float, axis: Float, matrix: Float, tool: Pose
) -> CompiledJacobian | None:  # fmt: skip
    """A `CompiledJacobian`, or None without joints or compiler."""
    built = library(SOURCE) if layout.model.njnt else None
    return None if built is None else CompiledJacobian(layout, anchor, axis, matrix, tool, built)


def compiled_wrist(sensor: Float, noise: Float, bias: Float, weight: Float, center: Float) -> CompiledWrist | None:
    """A `CompiledWrist`, or None without a compiler."""
    built = library(SOURCE)
    return None if built is None else CompiledWrist(sensor, noise, bias, weight, center, built)


def _numbers(part: slice | NDArray[np.int64]) -> NDArray[np.int64]:
    chosen = np.arange(part.start, part.stop) if isinstance(part, slice) else part
    return np.ascontiguousarray(chosen, dtype=np.int64)


def _step(array: Float) -> int:
    return int(array.strides[0]) // 8
