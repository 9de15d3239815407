"""References that several tests share: a loaded model, a Runge-Kutta step of a closed chain, third-party recordings."""

import os
from pathlib import Path

import numpy as np
import pinocchio as pin


def attach_payload(model, tool_frame, mass, com, inertia):
    """Copy of a Pinocchio model with a rigid load on a tool frame (id or name of a link).

    Mass [kg], com (3,) [m] and inertia, (3,) diagonal or (3, 3) about it [kg m^2], are in the tool frame.
    """
    name = isinstance(tool_frame, str)
    frame = model.frames[model.getFrameId(tool_frame, pin.FrameType.BODY) if name else tool_frame]
    about_com = np.asarray(inertia, dtype=float)
    about_com = np.diag(about_com) if about_com.ndim == 1 else about_com
    loaded = model.copy()
    load = pin.Inertia(float(mass), np.asarray(com, dtype=float), about_com)
    loaded.appendBodyToJoint(frame.parentJoint, load, frame.placement)
    return loaded


def chain_step(chain, z, zd, force, dt, external=None):
    """One classical Runge-Kutta step of dt [s] of a `ClosedChain` under constant actuator forces."""

    def rate(at, speed):
        return chain.at(at, speed).acceleration(force, external)

    a1 = rate(z, zd)
    v2 = zd + 0.5 * dt * a1
    a2 = rate(z + 0.5 * dt * zd, v2)
    v3 = zd + 0.5 * dt * a2
    a3 = rate(z + 0.5 * dt * v2, v3)
    v4 = zd + dt * a3
    a4 = rate(z + dt * v3, v4)
    return z + dt / 6 * (zd + 2 * v2 + 2 * v3 + v4), zd + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def recordings_dir():
    """Folder of third-party recordings, `$SKILLFRAME_RECORDINGS`, or None if unset or absent."""
    folder = os.environ.get("SKILLFRAME_RECORDINGS", "")
    return Path(folder) if folder and Path(folder).is_dir() else None
