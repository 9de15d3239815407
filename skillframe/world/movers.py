"""How far a scene's second parts have moved since the start, read from a plant's generalised positions."""

from __future__ import annotations

import mujoco
import numpy as np

from skillframe.frames import Float, norm
from skillframe.world.convert import SPRUNG
from skillframe.world.scene import Mover, Scene


class Travels:
    """Where each mover's coordinates stand.

    Args:
        model: compiled from the scene.
        scene: with its movers.
    """

    def __init__(self, model: mujoco.MjModel, scene: Scene) -> None:
        self._places: list[tuple[Mover, int]] = []
        for part in scene.sprung:
            if isinstance(part, Mover):
                first = SPRUNG + part.name + ("_x" if part.joint == "free" else "")
                self._places.append((part, int(model.joint(first).qposadr[0])))

    def __call__(self, qpos: Float) -> dict[str, Float]:
        """What `State.second` says for configurations (N, nq) in MuJoCo's order: (N,) a quantity [m or rad]."""
        found: dict[str, Float] = {}
        for part, at in self._places:
            if part.joint != "free":
                values: tuple[Float, ...] = (qpos[:, at].copy(),)
            else:
                away, ball = qpos[:, at : at + 3], qpos[:, at + 3 : at + 7]
                values = norm(away), 2.0 * np.arctan2(norm(ball[:, 1:]), np.abs(ball[:, 0]))
            found.update(zip(part.quantities, values, strict=True))
        return found
