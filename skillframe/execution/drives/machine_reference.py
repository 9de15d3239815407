"""From a skill's command to what the law of a hydraulic machine follows: its part in the machine's plane."""

from __future__ import annotations

import numpy as np

from skillframe.frames import Float
from skillframe.machine.law.hydraulic import Reference
from skillframe.skill import Command, Observation

IMPEDANCE_RATE, LEAST_DAMPING = 2.0, 5e4  # 1/s and N s/m; D where a skill leaves it open, from teleoperation trials


def plane_reference(
    command: Command, seen: Observation, ramp: float, plane: slice, joint: Float
) -> tuple[Reference, Float]:
    """What the law follows, and equation (1)'s wrench (N, 6) for limits and trace.

    Args:
        command: what the skill wants, as the drive is told.
        seen: what the skill saw.
        ramp: 0 ... 1 fades velocity and feed-forward in.
        plane: the two axes of base that the machine moves its tool along.
        joint: (N, n - 2) where the other joints are held.
    """
    stiffness = _in_plane(command.impedance.stiffness, plane)
    if command.impedance.damping is None:
        largest = np.linalg.eigvalsh(stiffness)[..., -1]
        damping = np.maximum(largest / IMPEDANCE_RATE, LEAST_DAMPING)[..., None, None] * np.eye(2)
    else:
        damping = _in_plane(command.impedance.damping, plane)
    velocity, push = ramp * command.twist[:, plane], ramp * command.feedforward[:, plane]
    law = np.zeros((len(seen.time), 6))
    error = (command.pose.position - seen.pose.position)[:, plane]
    law[:, plane] = push + _times(stiffness, error) + _times(damping, velocity - seen.twist[:, plane])
    still = np.zeros(joint.shape)
    return Reference(command.pose.position[:, plane], velocity, stiffness, damping, push, joint, still), law


def _in_plane(matrix: Float, plane: slice) -> Float:
    """(N, 2, 2) of (N, 6, 6), or (2, 2) of one (6, 6) for all, which spreads where it is used."""
    part: Float = matrix[..., plane, plane]
    return part


def _times(matrix: Float, vector: Float) -> Float:
    result: Float = (matrix @ vector[..., None])[..., 0]
    return result
