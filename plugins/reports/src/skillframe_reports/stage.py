"""Scene of a trace: body meshes, stationary bodies, cameras and cuts.

The close view shows the tool's tip from the front right. Nearby fixtures are cut along the vertical plane through the
final tip that faces the viewer (normal -y of base). The cut of a fixture in another arm's gripper moves with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from skillframe.execution import Trace
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate, unit
from skillframe_reports.shapes import Mesh, merge, mesh_of, section

FIXTURE = "fixture"
"""Name of the fixture's body in a trace."""
FIELD_OF_VIEW = np.radians(32.0)
CLOSE = 0.13
"""Distance from the tip [m] of things in the close view."""


class Camera(NamedTuple):
    """Camera that looks at `target` (3,) from `distance` [m] at these angles [rad], z up."""

    target: Float
    distance: float
    azimuth: float = float(np.radians(-62.0))
    elevation: float = float(np.radians(24.0))
    field_of_view: float = float(FIELD_OF_VIEW)

    @property
    def backward(self) -> Float:
        """Unit vector (3,) from the target to the eye."""
        c = np.cos(self.elevation)
        return np.array([c * np.cos(self.azimuth), c * np.sin(self.azimuth), np.sin(self.elevation)])

    @property
    def eye(self) -> Float:
        """Position (3,) of the eye [m]."""
        eye: Float = self.target + self.distance * self.backward
        return eye


@dataclass(frozen=True)
class Stage:
    """The drawn bodies of one trace.

    Attributes:
        names: of the bodies.
        whole: meshes per body, in the body's frame, one per geometry (planes included).
        flat: whether each body is a plane.
        position, quaternion: (T, B, 3), (T, B, 4) poses.
        tip: (T, 3) the tool's tip; the centre of compliance if unknown.
        wanted: (T, 3) its desired position.
    """

    names: tuple[str, ...]
    whole: tuple[tuple[Mesh, ...], ...]
    flat: tuple[bool, ...]
    position: Float
    quaternion: Float
    tip: Float
    wanted: Float

    @cached_property
    def still(self) -> tuple[bool, ...]:
        """Whether each body is stationary."""
        moved = np.ptp(self.position, axis=0).max(axis=-1)
        turned = np.ptp(self.quaternion, axis=0).max(axis=-1)
        return tuple(bool(m < 1e-6 and t < 1e-6) for m, t in zip(moved, turned, strict=True))

    @cached_property
    def meshes(self) -> tuple[Mesh, ...]:
        """One mesh per body, in its frame."""
        return tuple(merge(parts) for parts in self.whole)

    def placed(self, body: int, frame: int) -> Mesh:
        """Return a body's mesh in base at a frame."""
        return self.meshes[body].placed(self.position[frame, body], self.quaternion[frame, body])

    @cached_property
    def tool(self) -> int | None:
        """The body named "tool", else the moving one nearest the tip."""
        moving = [b for b, still in enumerate(self.still) if not still and len(self.meshes[b].vertices)]
        named = [b for b in moving if self.names[b].rsplit("/", 1)[-1] == "tool"]
        near = sorted(moving, key=lambda b: float(norm(self.placed(b, -1).vertices - self.tip[-1]).min()))
        return next(iter([*named, *near]), None)

    @cached_property
    def close(self) -> Camera:
        """Close view of the surroundings of the tip at the start and end."""
        parts = [self.tip[[0, -1]]]
        for body in range(len(self.names)):
            if body == self.tool or (self.still[body] and not self.flat[body]):
                for frame in (0, -1):
                    vertices = self.placed(body, frame).vertices
                    parts.append(vertices[norm(vertices - self.tip[frame]) < CLOSE])
        seen = np.concatenate(parts)
        low, high = seen.min(axis=0), seen.max(axis=0)
        radius = float(np.clip(0.5 * norm(high - low), 0.03, 0.6))
        return Camera(0.5 * (low + high), 1.05 * radius / np.sin(0.5 * FIELD_OF_VIEW))

    @cached_property
    def far(self) -> Camera:
        """View of the whole scene."""
        solid = [b for b in range(len(self.names)) if not self.flat[b] and len(self.meshes[b].vertices)]
        bodies = solid or list(range(len(self.names)))
        return fitted(
            np.concatenate([self.placed(b, frame).vertices for b in bodies for frame in (0, -1)]),
            Camera(np.zeros(3), 1.0, elevation=float(np.radians(18.0))),
        )

    @cached_property
    def cut(self) -> tuple[Mesh | None, ...]:
        """Cut mesh per body in its frame, or None."""
        return tuple(self._cut_body(b) for b in range(len(self.names)))

    def _cut_body(self, body: int) -> Mesh | None:
        if (
            not ((self.still[body] or self.names[body] == FIXTURE) and not self.flat[body])
            or self.tool is None
            or not len(self.meshes[body].vertices)
        ):
            return None
        world = self.placed(body, -1).vertices
        outside = np.maximum(world.min(axis=0) - self.tip[-1], self.tip[-1] - world.max(axis=0))
        if outside.max() > CLOSE:
            return None
        back = np.swapaxes(matrix_from_quaternion(self.quaternion[-1, body]), -1, -2)
        point = rotate(back, self.tip[-1] - self.position[-1, body])
        return merge([section(mesh, point, rotate(back, np.array([0.0, -1.0, 0.0]))) for mesh in self.whole[body]])


def fitted(points: Float, view: Camera) -> Camera:
    """Return the camera at a view's angles that shows all points (N, 3) [m] with a margin."""
    back = view.backward
    right = unit(np.cross([0.0, 0.0, 1.0], back))
    axes = np.stack([right, np.cross(back, right), back])
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    slope = np.tan(0.5 * view.field_of_view) * np.array([4.0 / 3.0, 1.0])  # the picture's width over height
    x, y, depth = (seen - middle).T
    reach = float(np.max(depth + 1.12 * np.maximum(np.abs(x) / slope[0], np.abs(y) / slope[1])))
    return view._replace(target=middle @ axes, distance=float(np.clip(reach, 0.2, 40.0)))


def stage_of(trace: Trace) -> Stage | None:
    """Return the stage of a trace, or None without drawn bodies."""
    bodies: list[dict[str, Any]] = trace.meta.get("bodies") or []
    poses = np.asarray(trace.body_position)
    shapes = (len(trace.time), len(bodies), 3), (len(trace.time), len(bodies), 4)
    if not bodies or not len(trace.time) or (poses.shape, np.shape(trace.body_quaternion)) != shapes:
        return None
    whole = tuple(tuple(m for m in map(mesh_of, body.get("geoms", ())) if len(m.faces)) for body in bodies)
    if not any(whole):
        return None
    flat = tuple(any(g.get("kind") == "plane" for g in body.get("geoms", ())) for body in bodies)
    return Stage(
        names=tuple(str(body.get("name", f"body {i}")) for i, body in enumerate(bodies)),
        whole=whole, flat=flat, position=poses.astype(float), quaternion=np.asarray(trace.body_quaternion, dtype=float),
        tip=at_tip(trace, trace.position, trace.quaternion),
        wanted=at_tip(trace, trace.desired_position, trace.desired_quaternion),
    )  # fmt: skip


def at_tip(trace: Trace, position: Float, quaternion: Float) -> Float:
    """Return the tip (T, 3) for poses (T, 3), (T, 4) of the centre of compliance, or the latter if unknown."""
    tip, center = (trace.meta.get("frames") or {}).get("tip"), trace.meta.get("center_of_compliance")
    start = np.asarray(position, dtype=float)
    if tip is None or center is None:
        return start
    offset = np.asarray(tip, dtype=float) - np.asarray(center, dtype=float)
    return start + rotate(matrix_from_quaternion(quaternion), offset)
