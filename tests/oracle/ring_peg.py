r"""A small analytic contact plant: a free-flying tool with a filleted round peg over a blind round hole.

It imports nothing from skillframe and shares neither engine nor contact model with it, so that where both agree a
result can be trusted. The peg's fillet is a ring of spheres against plate, rim, wall and bottom; the rim is a ring of
points against the peg's side. A point with depth D and separating velocity u_n along the normal pushes with the law

    f_n = max(0, k (D - h u_n) - c k D u_n),      f_t = -mu f_n u_t / sqrt(|u_t|^2 + v_s^2)

linearised and solved implicitly: (M + h sum J^T B J) v+ = M v + h tau + h sum J^T k D n, four fixed-point rounds for
the active set and the friction's size. k = 3e5 N/m, c = 1 s/m, v_s = 0.1 mm/s (coarser lets jammed pegs creep in).
Gravity and gyroscopic forces are taken to be compensated by the controller, as in the runs it is compared with.

Everything is (C, ...) over C cases. Fixture frame: z up, hole's mouth at the origin. The tool's z axis points down.
"""

from dataclasses import dataclass, field

import numpy as np

STEP, STIFFNESS, DISSIPATION, REGULARISATION = 1e-3, 3e5, 1.0, 1e-4
MARGIN = 2e-4  # points this near are in the list of a step; nothing moves farther in 1 ms
ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class Geometry:
    peg_radius: float = 0.0165
    fillet: float = 0.005
    peg_length: float = 0.080
    hole_radius: float = 0.01675
    depth: float = 0.060
    tip: float = 0.2
    points: int = 64


@dataclass(frozen=True, kw_only=True)
class Tool:
    """Carrier and tool as one body. The inertia is about the common centre of mass, tool axes."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Push:
    """Equation (1) at the tip with a pushed desired point. Matrices are diagonal in base axes, (C, 6)."""

    stiffness: np.ndarray
    damping: np.ndarray
    speed: float = 0.02
    cap: float = 20.0
    ramp: float = 0.05
    direction: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))


def cross_matrix(v):
    x, y, z = np.moveaxis(v, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape[:-1], 3, 3)


def exponential(v):
    """Rodrigues' formula."""
    angle = np.sqrt((v * v).sum(-1))[..., None, None]
    k = cross_matrix(v)
    safe = np.where(angle < 1e-9, 1.0, angle)
    a, b = np.where(angle < 1e-9, 1.0, np.sin(safe) / safe), np.where(angle < 1e-9, 0.5, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * k + b * (k @ k)


def logarithm(rotation):
    w = 0.5 * np.stack([rotation[:, 2, 1] - rotation[:, 1, 2], rotation[:, 0, 2] - rotation[:, 2, 0],
                        rotation[:, 1, 0] - rotation[:, 0, 1]], axis=-1)  # fmt: skip
    sine = np.sqrt((w * w).sum(-1))
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0))
    return w * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)[:, None]


class Contacts:
    """Candidate points of all cases at a posture: where, along which normal, how deep."""

    def __init__(self, geometry):
        self.g = geometry
        azimuth = 2.0 * np.pi * np.arange(geometry.points) / geometry.points
        self.circle = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1)

    def find(self, wrist, rotation):
        """Case index (A,), point (A, 3), normal on the tool (A, 3) and signed depth (A,) of those near enough."""
        parts = [*self._fillet(wrist, rotation), self._rim(wrist, rotation)]
        point, normal, depth = (np.concatenate([part[i] for part in parts], axis=1) for i in range(3))
        case, index = np.nonzero(depth > -MARGIN)
        return case, point[case, index], normal[case, index], depth[case, index]

    def _fillet(self, wrist, rotation):
        g = self.g
        centre = (g.peg_radius - g.fillet) * self.circle + np.array([0.0, 0.0, g.tip - g.fillet])
        ball = wrist[:, None] + centre @ np.swapaxes(rotation, 1, 2)
        radial, z = np.sqrt((ball[..., :2] ** 2).sum(-1)), ball[..., 2]
        outward = np.zeros_like(ball)
        outward[..., :2] = ball[..., :2] / np.maximum(radial, 1e-12)[..., None]
        up = np.broadcast_to([0.0, 0.0, 1.0], ball.shape)
        rim = g.hole_radius * outward
        from_rim = ball - rim
        distance = np.maximum(np.sqrt((from_rim**2).sum(-1)), 1e-12)
        over_plate, below_mouth = radial >= g.hole_radius, z < 0.0
        at_rim = np.where(below_mouth[..., None], -outward, from_rim / distance[..., None])
        normal = np.where(over_plate[..., None], up, at_rim)
        gap = np.where(over_plate, z, np.where(below_mouth, g.hole_radius - radial, distance)) - g.fillet
        yield ball - g.fillet * normal, normal, -gap
        yield ball - g.fillet * up, up, g.fillet - (z + g.depth)

    def _rim(self, wrist, rotation):
        g = self.g
        point = np.broadcast_to(g.hole_radius * self.circle, (len(wrist), g.points, 3))
        in_tool = (point - wrist[:, None]) @ rotation
        radial = np.maximum(np.sqrt((in_tool[..., :2] ** 2).sum(-1)), 1e-12)
        inward = np.zeros_like(in_tool)
        inward[..., :2] = -in_tool[..., :2] / radial[..., None]
        beside = (in_tool[..., 2] < g.tip - g.fillet) & (in_tool[..., 2] > g.tip - g.peg_length)
        depth = np.where(beside, g.peg_radius - radial, -1.0)
        return point, inward @ np.swapaxes(rotation, 1, 2), depth


def summed(case, values, count):
    """Sum rows of `values` by case."""
    result = np.zeros((count, *values.shape[1:]))
    np.add.at(result, case, values)
    return result


def step(velocity, inertia, force, contacts, center, friction):
    """Velocity (C, 6) of the centre of mass after one step. Linear part first, base axes."""
    case, point, normal, depth = contacts
    count = len(velocity)
    unit = np.broadcast_to(np.eye(3), (len(case), 3, 3))
    jacobian = np.concatenate([unit, -cross_matrix(point - center[case])], axis=2)
    across = normal[:, :, None] * normal[:, None, :]
    slope = STIFFNESS * STEP + DISSIPATION * STIFFNESS * np.maximum(depth, 0.0)
    momentum = (inertia @ velocity[..., None])[..., 0] + STEP * force
    new = velocity
    for _ in range(ROUNDS):
        u = (jacobian @ new[case][..., None])[..., 0]
        u_n = (u * normal).sum(-1)
        f_n = np.maximum(STIFFNESS * depth - slope * u_n, 0.0)
        sliding = u - u_n[:, None] * normal
        drag = friction[case] * f_n / np.sqrt((sliding**2).sum(-1) + REGULARISATION**2)
        active = (f_n > 0.0)[:, None, None]
        b = active * (slope[:, None, None] * across + drag[:, None, None] * (np.eye(3) - across))
        push = active[..., 0] * (STIFFNESS * depth)[:, None] * normal
        turned = np.swapaxes(jacobian, 1, 2)
        left = inertia + STEP * summed(case, turned @ b @ jacobian, count)
        right = momentum + STEP * summed(case, (turned @ push[..., None])[..., 0], count)
        new = np.linalg.solve(left, right[..., None])[..., 0]
    return new


def insert(geometry, tool, push, friction, wrist, rotation, duration):
    """Push C tools from their starts. Returns the path of their tips (T, C, 3) and final attitudes (C, 3, 3)."""
    contacts, count = Contacts(geometry), len(wrist)
    velocity, offset = np.zeros((count, 6)), np.array([0.0, 0.0, geometry.tip])
    desired, attitude, path = wrist + rotation @ offset, rotation.copy(), []
    for tick in range(round(duration / STEP)):
        center, tip = wrist + rotation @ tool.center, wrist + rotation @ offset
        desired = desired + push.speed * STEP * push.direction
        lead = ((desired - tip) * push.direction).sum(-1) - push.cap / push.stiffness.max(-1)
        desired = desired - np.maximum(lead, 0.0)[:, None] * push.direction
        error = np.concatenate([desired - tip, logarithm(attitude @ np.swapaxes(rotation, 1, 2))], axis=1)
        twist = velocity.copy()
        twist[:, :3] += np.cross(velocity[:, 3:], tip - center)
        wanted = min(1.0, tick * STEP / push.ramp) * push.speed * np.concatenate([push.direction, np.zeros(3)])
        law = push.stiffness * error + push.damping * (wanted - twist)
        force = law.copy()
        force[:, 3:] += np.cross(tip - center, law[:, :3])
        inertia = np.zeros((count, 6, 6))
        inertia[:, [0, 1, 2], [0, 1, 2]] = tool.mass
        inertia[:, 3:, 3:] = rotation @ tool.inertia @ np.swapaxes(rotation, 1, 2)
        velocity = step(velocity, inertia, force, contacts.find(wrist, rotation), center, friction)
        center = center + STEP * velocity[:, :3]
        rotation = exponential(STEP * velocity[:, 3:]) @ rotation
        wrist = center - rotation @ tool.center
        path.append(wrist + rotation @ offset)
    return np.array(path), rotation
