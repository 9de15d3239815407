r"""Another payload than declared: its inertia, and gravity of one more kilogram in the grip, for many machines at once.

The link that robot.toml's `[payload]` names is moved by independent joints only. With the joints' axes \(a_j\) and
origins \(o_j\) in base from the product of exponentials, and the link's centre of mass c,

    g_j = -g . dc/dz_j,     dc/dz_j = a_j x (c - o_j)  (turns),   a_j  (slides),

per kilogram, on the side of the equation of motion where gravity stands, M_z zdd + C_z zd + g_z = tau.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.payload import published_inertia, with_payload

if TYPE_CHECKING:
    import casadi as ca

    from skillframe.robot.chain import ClosedChain


def loaded_inertias(robot: RobotModel, masses: Float) -> tuple[str, list[pin.Inertia]]:
    """Joint that moves the payload, and the inertia of all that moves with it for payloads of masses (N,) [kg].

    Inertia's ten parameters are linear in the payload (`payload`), so two models give all of them.

    Raises:
        InputError, UnknownName: as `with_payload`.
    """
    for mass in masses:
        with_payload(robot.spec, float(mass))
    payload = robot.spec.payload
    assert payload is not None
    joint = robot.model.frames[robot.model.getFrameId(payload.link, pin.FrameType.BODY)].parentJoint
    empty, full = (
        load_model(with_payload(robot.spec, mass)).model.inertias[joint].toDynamicParameters()
        for mass in (0.0, payload.rating)
    )
    per_kilogram = (full - empty) / max(payload.rating, 1e-9)
    return str(robot.model.names[joint]), [
        pin.Inertia.FromDynamicParameters(empty + float(mass) * per_kilogram) for mass in masses
    ]


class _Joint(NamedTuple):
    """Placement (3, 3), (3,) in its parent, axis (3,), column of z, and whether it slides."""

    rotation: Float
    position: Float
    axis: Float
    column: int
    slides: bool


class CarriedLoad:
    """Gravity of the payload of a closed chain.

    Args:
        chain: its robot declares a payload.

    Raises:
        InputError: no payload is declared, or a cylinder moves it.
    """

    def __init__(self, chain: ClosedChain) -> None:
        spec, model = chain.robot.spec, chain.model
        where = f"{spec.folder / 'robot.toml'}: payload"
        if spec.payload is None:
            raise InputError(where, "the robot declares no payload", "add [payload] with link, mass and rating")
        frame = model.frames[model.getFrameId(spec.payload.link, pin.FrameType.BODY)]
        self._joints = []
        for j in list(model.supports[frame.parentJoint])[1:]:
            if model.names[j] not in chain.independent:
                text = f"link {spec.payload.link!r} is moved by {model.names[j]}, which a loop moves"
                raise InputError(where, text, "name a link of the main chain")
            placement, axis = model.jointPlacements[j], np.array(model.joints[j].createData().S, dtype=float).ravel()
            slides = not axis[3:].any()
            column = chain.independent.index(model.names[j])
            direction = axis[:3] if slides else axis[3:]
            self._joints.append(
                _Joint(np.array(placement.rotation), np.array(placement.translation), direction, column, slides)
            )
        self._com: Float = np.array(frame.placement.act(np.array(published_inertia(spec).com)))
        self._gravity: Float = np.array(model.gravity.linear)
        self._freedoms = len(chain.independent)
        self._function = self._expressed()
        self._ready: tuple[Float, Float, Callable[[], None]] | None = None

    def gravity(self, z: Float) -> Float:
        """(N, n) generalised forces of gravity per kilogram [N/kg or Nm/kg] at minimal coordinates (N, n)."""
        given, result, run = self._prepared(len(z))
        given[...] = z
        run()
        return result.copy()

    def _prepared(self, count: int) -> tuple[Float, Float, Callable[[], None]]:
        """Arrays in and out for so many machines, and what computes one from the other. The last one is kept."""
        if self._ready is None or len(self._ready[0]) != count:
            given, result = np.zeros((count, self._freedoms)), np.zeros((count, self._freedoms))
            one = self._function
            self._buffer, run = (one if count == 1 else one.map(count, "serial")).buffer()
            self._buffer.set_arg(0, given.data)
            self._buffer.set_res(0, result.data)
            self._ready = given, result, run
        return self._ready

    def _expressed(self) -> ca.Function:
        """Gravity (n,) of coordinates (n,), the module's formula, fifty times faster than calls of numpy."""
        import casadi as ca

        z = ca.SX.sym("z", self._freedoms)
        rotation, origin, passed = ca.SX.eye(3), ca.SX.zeros(3), []
        for joint in self._joints:
            origin = origin + rotation @ joint.position
            rotation = rotation @ joint.rotation
            axis = rotation @ joint.axis
            passed.append((joint, axis, origin))
            if joint.slides:
                origin = origin + z[joint.column] * axis
            else:
                rotation = rotation @ _turn(joint.axis, z[joint.column])
        centre = origin + rotation @ self._com
        result = ca.SX.zeros(self._freedoms)
        for joint, axis, place in passed:
            moved = axis if joint.slides else ca.cross(axis, centre - place)
            result[joint.column] = -ca.dot(moved, ca.SX(self._gravity))
        return ca.Function("carried", [z], [ca.densify(result)])


def _turn(axis: Float, angle: ca.SX) -> ca.SX:
    """Rotation matrix about an axis (3,) by an angle, Rodrigues' formula."""
    import casadi as ca

    k = ca.skew(ca.SX(axis))
    return ca.SX.eye(3) + ca.sin(angle) * k + (1.0 - ca.cos(angle)) * (k @ k)
