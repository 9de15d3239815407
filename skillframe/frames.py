r"""Rotations, poses and wrenches over arrays with any leading dimensions.

Conventions, used everywhere: SI units; quaternions x, y, z, w; spatial vectors linear part first; a pose maps tool
coordinates to base, \(x_{base} = R\,x_{tool} + p\); a wrench is what the environment exerts on the tool, taken at a
point and expressed in base axes. All is plain numpy, since a scipy `Rotation` costs 50-70 us and `np.cross` 16 us, more
than a whole control law.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
"""An array of double-precision numbers; docstrings give its shape."""
_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])
_BESIDE_DIAGONAL, _SKEWED = np.array([1, 2, 3, 5, 6, 7]), np.array([2, 1, 2, 0, 1, 0])
_SKEW_SIGNS = np.array([-1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
_LOWER, _UPPER = np.array([7, 2, 3]), np.array([5, 6, 1])  # of the antisymmetric part of a flat 3 x 3 matrix


class Pose(NamedTuple):
    """A pose of a frame in base, or a batch of them.

    Attributes:
        position: (..., 3) origin [m].
        rotation: (..., 3, 3) rotation matrix, columns are the frame's axes in base.
    """

    position: Float
    rotation: Float

    def at(self, offset: Float) -> Pose:
        """The pose of a point fixed in this frame: origin moved by `offset` (..., 3) in frame axes."""
        return Pose(self.position + rotate(self.rotation, offset), self.rotation)

    def compose(self, other: Pose) -> Pose:
        """This pose times another: `other` is given in this frame, the result in base."""
        return Pose(self.position + rotate(self.rotation, other.position), self.rotation @ other.rotation)

    def inverse(self) -> Pose:
        """The pose of base in this frame."""
        back = np.swapaxes(self.rotation, -1, -2)
        return Pose(-rotate(back, self.position), back)


def rotate(rotation: Float, vector: Float) -> Float:
    """Rotate vectors (..., 3) by matrices (..., 3, 3)."""
    result: Float = (rotation @ vector[..., None])[..., 0]
    return result


def cross(a: Float, b: Float) -> Float:
    """Cross product of (..., 3) arrays, ten times faster than `np.cross` on small ones."""
    result: Float = a.take(_NEXT, -1) * b.take(_AFTER, -1) - a.take(_AFTER, -1) * b.take(_NEXT, -1)
    return result


def skew(v: Float) -> Float:
    """Matrix (..., 3, 3) of the cross product with v (..., 3)."""
    result = np.zeros((*v.shape[:-1], 9))
    result[..., _BESIDE_DIAGONAL] = v.take(_SKEWED, -1) * _SKEW_SIGNS
    return result.reshape(*v.shape[:-1], 3, 3)


def dot(a: Float, b: Float) -> Float:
    """Scalar products over the last axis, summed in order.

    `np.vecdot` uses BLAS, whose rounding depends on processor and memory alignment, so that a trial would not be
    bit-identical in another batch.
    """
    result: Float = np.add.reduce(a * b, axis=-1)
    return result


def norm(v: Float) -> Float:
    """Euclidean norm over the last axis."""
    result: Float = np.sqrt(dot(v, v))
    return result


def unit(v: Float) -> Float:
    """Unit vectors over the last axis, zero for zero."""
    length = norm(v)[..., None]
    result: Float = v / np.where(length > 0.0, length, 1.0)
    return result


def rotation_vector(rotation: Float) -> Float:
    """Logarithm of rotation matrices (..., 3, 3) as rotation vectors (..., 3), angle in [0, pi].

    Stable near 0 and near pi, where the axis is taken from the symmetric part.
    """
    flat = rotation.reshape(*rotation.shape[:-2], 9)
    w: Float = 0.5 * (flat.take(_LOWER, -1) - flat.take(_UPPER, -1))
    sine = norm(w)
    cosine = 0.5 * (flat[..., 0] + flat[..., 4] + flat[..., 8] - 1.0)
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    result: Float = w * factor[..., None]
    near_pi = (sine < 1e-4) & (cosine < 0.0)
    if np.count_nonzero(near_pi):
        result[near_pi] = _rotation_vector_near_pi(rotation[near_pi], w[near_pi], angle[near_pi])
    return result


def _rotation_vector_near_pi(rotation: Float, w: Float, angle: Float) -> Float:
    """Axis from (R + R^T)/2 = cos I + (1 - cos) a a^T, its sign from the antisymmetric part."""
    cosine = np.cos(angle)[..., None, None]
    outer = (0.5 * (rotation + np.swapaxes(rotation, -1, -2)) - cosine * np.eye(3)) / (1.0 - cosine)
    column = np.argmax(np.einsum("...ii->...i", outer), axis=-1)
    axis = unit(np.take_along_axis(outer, column[..., None, None], axis=-1)[..., 0])
    sign = np.where((axis * w).sum(-1) < 0.0, -1.0, 1.0)
    return axis * (sign * angle)[..., None]


_UPRIGHT = np.eye(3)


def rotation_matrix(vector: ArrayLike) -> Float:
    """Exponential of rotation vectors (..., 3): Rodrigues' formula, exact to rounding for every angle."""
    v = np.asarray(vector, dtype=float)
    if not np.count_nonzero(v):  # no rotation, the most frequent case in the loop
        still = np.empty((*v.shape[:-1], 3, 3))
        still[...] = _UPRIGHT
        return still
    angle = norm(v)
    small = angle < 1e-6
    if np.count_nonzero(small):
        safe = np.where(small, 1.0, angle)
        a = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
        b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    k = skew(v)
    result: Float = _UPRIGHT + a[..., None, None] * k + b[..., None, None] * (k @ k)
    return result


def matrix_from_quaternion(quaternion: ArrayLike) -> Float:
    """Rotation matrices (..., 3, 3) from quaternions (..., 4), x, y, z, w, of any non-zero norm."""
    q = np.asarray(quaternion, dtype=float)
    q = q / norm(q)[..., None]
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    result = np.empty((*q.shape[:-1], 3, 3))
    result[..., 0, 0], result[..., 1, 1], result[..., 2, 2] = (
        1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
    result[..., 0, 1], result[..., 1, 0] = 2 * (x * y - z * w), 2 * (x * y + z * w)
    result[..., 0, 2], result[..., 2, 0] = 2 * (x * z + y * w), 2 * (x * z - y * w)
    result[..., 1, 2], result[..., 2, 1] = 2 * (y * z - x * w), 2 * (y * z + x * w)
    return result


# indices of the off-diagonal elements of 4 q q^T in a flat rotation matrix
_FIRST = np.array([0, 1, 2, 7, 1, 0, 5, 2, 2, 5, 0, 3, 7, 2, 3, 0])
_SECOND = np.array([0, 3, 6, 5, 3, 0, 7, 6, 6, 7, 0, 1, 5, 6, 1, 0])
_SIGN = np.array([1.0, 1, 1, -1, 1, 1, 1, -1, 1, 1, 1, -1, -1, -1, -1, 1])
_FEW = 36
"""Size up to which Python numbers are faster than arrays: four matrices."""


def quaternion_from_matrix(rotation: ArrayLike) -> Float:
    """Unit quaternions (..., 4), x, y, z, w with w >= 0, from rotation matrices (..., 3, 3) (Shepperd's method)."""
    r = np.asarray(rotation, dtype=float)
    flat = r.reshape(*r.shape[:-2], 9)
    lines = [_line_of_quaternion(*row) for row in flat.reshape(-1, 9).tolist()] if flat.size <= _FEW else []
    if not lines or None in lines:
        return _quaternions(r, flat)
    found = unit(np.array(lines)).reshape(*r.shape[:-2], 4)
    few: Float = np.where(found[..., 3:] < 0.0, -found, found)
    return few


def _line_of_quaternion(
    xx: float, xy: float, xz: float, yx: float, yy: float, yz: float, zx: float, zy: float, zz: float
) -> tuple[float, float, float, float] | None:
    """The best conditioned row of 4 q q^T, or None if not finite. Bit-identical to `_quaternions`."""
    trace = xx + yy + zz
    if trace - trace != 0.0:  # NaN or infinite
        return None
    largest = max(xx, yy, zz, trace)
    if xx == largest:
        return 1.0 + 2.0 * xx - trace, xy + yx, xz + zx, zy - yz
    if yy == largest:
        return yx + xy, 1.0 + 2.0 * yy - trace, yz + zy, xz - zx
    if zz == largest:
        return zx + xz, zy + yz, 1.0 + 2.0 * zz - trace, yx - xy
    return zy - yz, xz - zx, yx - xy, 1.0 + trace


def _quaternions(r: Float, flat: Float) -> Float:
    """`quaternion_from_matrix` for many matrices, and for those that are not finite."""
    main = flat[..., ::4]
    trace = (main[..., 0] + main[..., 1] + main[..., 2])[..., None]
    outer = flat.take(_FIRST, axis=-1) + _SIGN * flat.take(_SECOND, axis=-1)  # 4 q q^T, row by row
    outer[..., :15:5] = 1.0 + 2.0 * main - trace
    outer[..., 15:] = 1.0 + trace
    best = np.argmax(np.concatenate([main, trace], axis=-1), axis=-1)  # the best conditioned row
    rows = outer.reshape(-1, 4, 4)
    q = unit(rows[np.arange(len(rows)), best.ravel()]).reshape(*r.shape[:-2], 4)
    result: Float = np.where(q[..., 3:] < 0.0, -q, q)
    return result


def continuous(quaternion: Float) -> Float:
    """Quaternions (T, ..., 4) with the sign of each that is nearer to the one before."""
    flips = np.where((quaternion[1:] * quaternion[:-1]).sum(axis=-1) < 0.0, -1.0, 1.0)
    signs = np.concatenate([np.ones((1, *flips.shape[1:])), np.cumprod(flips, axis=0)])
    result: Float = quaternion * signs[..., None]
    return result


def move_wrench(wrench: Float, shift: Float) -> Float:
    """Wrench (..., 6) at another point, same axes: T' = T - shift x F.

    Args:
        wrench: (..., 6) force then torque.
        shift: (..., 3) new point minus old point, in the wrench's axes [m].
    """
    force = wrench[..., :3]
    torque = wrench[..., 3:] - cross(shift, force)
    return _joined(force, torque)


def move_twist(twist: Float, shift: Float) -> Float:
    """Twist (..., 6) of another point of the same body, same axes: v' = v + w x shift."""
    turning = twist[..., 3:]
    moving = twist[..., :3] + cross(turning, shift)
    return _joined(moving, turning)


def _joined(linear: Float, angular: Float) -> Float:
    if linear.shape != angular.shape:
        linear, angular = np.broadcast_arrays(linear, angular)
    result: Float = np.concatenate([linear, angular], axis=-1)
    return result


def rotate_spatial(rotation: Float, vector: Float) -> Float:
    """Both halves of spatial vectors (..., 6) rotated by (..., 3, 3)."""
    halves = vector.reshape(*vector.shape[:-1], 2, 3) @ np.swapaxes(rotation, -1, -2)
    result: Float = halves.reshape(*halves.shape[:-2], 6)
    return result


def slerp(clock: Float, quaternion: Float, time: Float) -> Float:
    """Quaternions (T', 4) at `time` (T',), interpolated along the shortest rotation between samples (T, 4)."""
    left = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(clock) - 2)
    share = ((time - clock[left]) / (clock[left + 1] - clock[left]))[:, None]
    rotation = matrix_from_quaternion(quaternion)
    first = rotation[left]
    turn = rotation_vector(np.swapaxes(first, -1, -2) @ rotation[left + 1])
    return quaternion_from_matrix(first @ rotation_matrix(share * turn))


def pose_error(desired: Pose, measured: Pose) -> Float:
    """Desired minus measured pose (N, 6): position [m], then the rotation vector of R_d R^T [rad], in base axes."""
    turn = desired.rotation @ np.swapaxes(measured.rotation, -1, -2)
    return np.concatenate([desired.position - measured.position, rotation_vector(turn)], axis=-1)
