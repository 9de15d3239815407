"""Compiled loops (ticks.c) of motors, limits, inner loop and admittance: same bits as numpy, in a third of the time.

The classes that own the arrays call it. Without a compiler each does the same in numpy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.build import Record, library
from skillframe.frames import Float, Pose
from skillframe.signals import SteadyWrenchFilter
from skillframe.skill import Command

SOURCE = Path(__file__).with_name("ticks.c")
Fields = Mapping[str, NDArray[Any] | int | float]


def compiled(name: str, fields: Fields, *more: type) -> Callable[..., int] | None:
    """Return a function of ticks.c bound to `fields`, in the order of its struct, or None without a compiler.

    `more` are the types of further arguments.
    """
    built = library(SOURCE)
    return None if built is None else Record(fields).bound(built, name, *more)


class LawSettings(NamedTuple):
    """Settings of `CompiledAdmittance`: h [s], push (force, torque), squares of the contact thresholds."""

    step: float
    push: tuple[float, float]
    quiet: Float


class _Apart:
    """Pose errors of N trials, as `skillframe.frames.pose_error`."""

    def __init__(self, count: int, built: ctypes.CDLL) -> None:
        self.error: Float = np.zeros((count, 6, 1))
        """Positions [m], then rotation vectors (N, 6, 1)."""
        self._turn, (self._desired, self._at, self._axis) = np.zeros((count, 3, 3)), np.zeros((3, count, 3))
        self._sine, self._cosine, self._angle = np.zeros((3, count))
        record = Record({
            "turn": self._turn, "desired": self._desired, "at": self._at, "angle": self._angle, "sine": self._sine,
            "cosine": self._cosine, "axis": self._axis, "error": self.error, "count": count,
        })  # fmt: skip
        self._turned, self._apart = record.bound(built, "turned"), record.bound(built, "apart")

    def found(self, desired: Pose, measured: Pose) -> bool:
        """Compute the error. Returns False if a rotation is near pi, where numpy has to do it."""
        self._desired[:], self._at[:] = desired.position, measured.position
        np.matmul(desired.rotation, measured.rotation.mT, out=self._turn)
        self._turned()
        np.add.reduce(self._axis * self._axis, axis=-1, out=self._sine)
        np.sqrt(self._sine, out=self._sine)
        np.arctan2(self._sine, self._cosine, out=self._angle)
        return not self._apart()


class CompiledImpedance:
    """Wrenches of N trials by equation (1) of `skillframe.control.controller`."""

    def __init__(self, count: int, built: ctypes.CDLL) -> None:
        self._apart = _Apart(count, built)
        self._wanted, self._twist, self._forward, self._law = np.zeros((4, count, 6))
        self._off, self._spring, self._braked = np.zeros((3, count, 6, 1))
        record = Record({
            "wanted": self._wanted, "twist": self._twist, "forward": self._forward, "spring": self._spring,
            "braked": self._braked, "off": self._off, "law": self._law, "numbers": 6 * count,
        })  # fmt: skip
        self._find_off, self._find_law = (record.bound(built, name, ctypes.c_double) for name in ("off", "sprung"))

    def wrench(self, command: Command, pose: Pose, twist: Float, damping: Float, ramp: float) -> Float | None:
        """Wrenches (N, 6) as a new array, or None where a rotation is near pi."""
        if not self._apart.found(command.pose, pose):
            return None
        self._wanted[:], self._twist[:], self._forward[:] = command.twist, twist, command.feedforward
        self._find_off(ramp)
        np.matmul(command.impedance.stiffness, self._apart.error, out=self._spring)
        np.matmul(damping, self._off, out=self._braked)
        self._find_law(ramp)
        return self._law.copy()


def compiled_impedance(count: int) -> CompiledImpedance | None:
    """Return a `CompiledImpedance`, or None without a compiler."""
    built = library(SOURCE)
    return None if built is None else CompiledImpedance(count, built)


class CompiledAdmittance:
    """Drive and force of N trials by equation (2) of `skillframe.control.admittance`, without its gain."""

    def __init__(self, count: int, settings: LawSettings, built: ctypes.CDLL) -> None:
        self.drive, self.force = np.zeros((2, count, 6))
        """Limited drive (N, 6), and its sum with damping and contact wrench."""
        self._apart = _Apart(count, built)
        self._twist, self._forward, self._wrench = np.zeros((3, count, 6))
        self._wanted, self._spring, self._braked = np.zeros((3, count, 6, 1))
        self._squares, self._felt = np.zeros((2, count, 2))
        self._halves = self.drive.reshape(-1, 2, 3), self._wrench.reshape(-1, 2, 3)
        record = Record({
            "twist": self._twist, "wanted": self._wanted, "forward": self._forward, "spring": self._spring,
            "braked": self._braked, "wrench": self._wrench, "squares": self._squares, "felt": self._felt,
            "push": np.array(settings.push, dtype=float), "quiet": settings.quiet, "error": self._apart.error,
            "drive": self.drive, "force": self.force, "step": settings.step, "count": count,
        })  # fmt: skip
        self._ahead, self._pushed = record.bound(built, "ahead"), record.bound(built, "pushed")
        self._driven = record.bound(built, "driven", ctypes.c_double)

    def strayed(self, desired: Pose, pose: Pose, twist: Float) -> bool:
        """Compute the error left after a step at a twist (N, 6). Returns False if a rotation is near pi."""
        if not self._apart.found(desired, pose):
            return False
        self._twist[:] = twist
        self._ahead()
        return True

    def find(self, command: Command, wrench: Float, ramp: float, gains: tuple[Float, Float, Float]) -> None:
        """Compute drive and force, with stiffness and damping of the desired and of the actual twist as `gains`."""
        stiffness, wanted, damping = gains
        self._forward[:], self._wrench[:] = command.feedforward, wrench
        np.matmul(wanted, command.twist[..., None], out=self._wanted)
        np.matmul(stiffness, self._apart.error, out=self._spring)
        np.matmul(damping, self._twist[..., None], out=self._braked)
        self._driven(ramp)
        drive, felt = self._halves
        np.add.reduce(drive * drive, axis=-1, out=self._squares)
        np.add.reduce(felt * felt, axis=-1, out=self._felt)
        self._pushed()


def compiled_admittance(count: int, settings: LawSettings) -> CompiledAdmittance | None:
    """Return a `CompiledAdmittance`, or None without a compiler."""
    built = library(SOURCE)
    return None if built is None else CompiledAdmittance(count, settings, built)


class CompiledSteps:
    """Joint velocities of N arms with n joints away from their limits (`skillframe.control.joint_steps`)."""

    def __init__(
        self, home: Float, limits: tuple[Float, Float, Float, Float], posture: float, step: float, built: ctypes.CDLL
    ) -> None:  # fmt: skip
        count, joints = home.shape
        self._command, self._measured, self._speed = np.zeros((3, count, joints))
        self._spare, self._answer = np.zeros((2, count, joints, 1))
        self._twist = np.zeros((count, 6))
        self._left, self._made = np.zeros((2, count, 6, 1))
        velocity, lower, upper, leash = (np.array(part, dtype=float) for part in limits)
        record = Record({
            "home": np.array(home), "command": self._command, "measured": self._measured, "twist": self._twist,
            "made": self._made, "answer": self._answer, "velocity": velocity, "lower": lower, "upper": upper,
            "leash": leash, "spare": self._spare, "left": self._left, "speed": self._speed, "posture": posture,
            "step": step, "count": count, "joints": joints,
        })  # fmt: skip
        self._back, self._rest, self._speeds = (record.bound(built, name) for name in ("spare", "left", "speeds"))

    def speed(
        self, twist: Float, jacobian: Float, inverse: Float, command: Float, measured: Float
    ) -> Float | None:  # fmt: skip
        """Joint velocities (N, n) as a new array, or None where a joint may be at a limit."""
        self._twist[:], self._command[:], self._measured[:] = twist, command, measured
        self._back()
        np.matmul(jacobian, self._spare, out=self._made)
        self._rest()
        np.matmul(inverse, self._left, out=self._answer)
        return None if self._speeds() else self._speed.copy()


def compiled_steps(
    home: Float, limits: tuple[Float, Float, Float, Float], posture: float, step: float
) -> CompiledSteps | None:  # fmt: skip
    """Return a `CompiledSteps`, or None without a compiler."""
    built = library(SOURCE)
    return None if built is None else CompiledSteps(home, limits, posture, step, built)


class CompiledFilter:
    """The converged wrench filter (`skillframe.signals`) of N rows, with its result moved to another point."""

    def __init__(self, count: int, filter_: SteadyWrenchFilter, built: ctypes.CDLL) -> None:
        self._measured, self._value, self._slope, self._moved = np.zeros((4, count, 6))
        self._lever = np.zeros((count, 3))
        value, slope = (np.array(part, dtype=float) for part in filter_.gain[:2])
        self._filtered = Record({
            "measured": self._measured, "lever": self._lever, "gain": value, "slope_gain": slope, "value": self._value,
            "slope": self._slope, "moved": self._moved, "step": filter_.dt, "count": count,
        }).bound(built, "filtered")  # fmt: skip

    def start(self, wrench: Float) -> None:
        """Start at a measured wrench (N, 6) with zero slope."""
        self._value[:], self._slope[:] = wrench, 0.0

    def step(self, wrench: Float, lever: Float) -> Float:
        """Filter a measurement (N, 6). Returns the wrench (N, 6) at a point `lever` (N, 3) away, as a new array."""
        self._measured[:], self._lever[:] = wrench, lever
        self._filtered()
        return self._moved.copy()


def compiled_filter(count: int, filter_: SteadyWrenchFilter | None) -> CompiledFilter | None:
    """Return a `CompiledFilter`, or None without a filter or a compiler."""
    built = None if filter_ is None else library(SOURCE)
    return None if built is None or filter_ is None else CompiledFilter(count, filter_, built)
