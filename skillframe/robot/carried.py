r"""Another payload than declared: its inertia, and gravity of one more kilogram in the grip, for many machines at once.

The link that robot.toml's `[payload]` names hangs on independent joints only. With the joints' axes \(a_j\) and origins
\(o_j\) in base from the product of exponentials, and the link's centre of mass c,

    g_j = -g . dc/dz_j,     dc/dz_j = a_j x (c - o_j)  (turns),   a_j  (slides),

per kilogram, on the side of the equation of motion where gravity stands, M_z zdd + C_z zd + g_z = tau.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.payload import published_inertia, with_payload

if TYPE_CHECKING:
    from skillframe.robot.loops import ClosedChain


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
    joint = robot.model.frames[robot.model.getFrameId(payload.link)].parentJoint
    empty, full = (
        load_model(with_payload(robot.spec, mass)).model.inertias[joint].toDynamicParameters()
        for mass in (0.0, payload.rating)
    )
    per_kilogram = (full - empty) / max(payload.rating, 1e-9)
    return str(robot.model.names[joint]), [
        pin.Inertia.FromDynamicParameters(empty + float(mass) * per_kilogram) for mass in masses
    ]


class _Joint(NamedTuple):
    """Placement (3, 3), (3,) in its parent; axis (3,); column of z; does it slide?"""

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
        InputError: no payload is declared, or it hangs on a cylinder.
    """

    def __init__(self, chain: ClosedChain) -> None:
        spec, model = chain.robot.spec, chain.model
        where = f"{spec.folder / 'robot.toml'}: payload"
        if spec.payload is None:
            raise InputError(where, "the robot declares no payload", "add [payload] with link, mass and rating")
        frame = model.frames[model.getFrameId(spec.payload.link)]
        self._joints = []
        for j in list(model.supports[frame.parentJoint])[1:]:
            if model.names[j] not in chain.independent:
                text = f"link {spec.payload.link!r} hangs on {model.names[j]}, which a loop moves"
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

    def gravity(self, z: Float) -> Float:
        """(N, n) generalised forces of gravity per kilogram [N/kg or Nm/kg] at minimal coordinates (N, n)."""
        rotation: Float = np.broadcast_to(np.eye(3), (len(z), 3, 3))
        origin: Float = np.zeros((len(z), 3))
        passed = []
        for joint in self._joints:
            origin = origin + rotation @ joint.position
            rotation = rotation @ joint.rotation
            axis = rotation @ joint.axis
            passed.append((joint, axis, origin))
            way = z[:, joint.column, None]
            if joint.slides:
                origin = origin + way * axis
            else:
                rotation = rotation @ _turn(joint.axis, way[..., None])
        centre = origin + rotation @ self._com
        result = np.zeros((len(z), self._freedoms))
        for joint, axis, place in passed:
            moved = axis if joint.slides else _cross(axis, centre - place)
            result[:, joint.column] = -(moved @ self._gravity)
        return result


def _turn(axis: Float, angle: Float) -> Float:
    """Rotation matrices (N, 3, 3) about one axis (3,) by angles (N, 1, 1), Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Float = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)
    return result


def _cross(a: Float, b: Float) -> Float:
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
