"""A straight push, written by hand: for parts that were only shown how they come out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from skillframe.extend import Document
from skillframe.frames import Float

PUSH_N, STIFF_N_M, SPEED_M_S = 12.0, 1500.0, 0.02
"""Largest push, stiffness along it, speed."""
ACROSS, ALONG = 40.0, 120.0  # damping [Ns/m]
TURN_NM_RAD, TURN_DAMPING = 3.0, 0.3
PLACES = ("center_of_compliance", "learned_at", "work_at")


def straight_push(tool: Mapping[str, Any], way: Float) -> Document:
    """Body of an LMC document: a push along a unit vector (3,) in base axes, compliant across it and in rotation.

    `tool` are the points of the tool by name, with "tip".
    """
    frames = {name: list(point) for name, point in tool.items()}
    along = np.outer(way, way)
    translation = {
        "desired_direction": way.tolist(), "speed": SPEED_M_S, "fully_compliant": False,
        "stiffness": (STIFF_N_M * along).tolist(), "compliant_axes": np.linalg.svd(along)[0][:, 1:].T.tolist(),
        "damping": (ACROSS * np.eye(3) + (ALONG - ACROSS) * along).tolist(),
    }  # fmt: skip
    rotation = {
        "desired_direction": None, "speed": 0.0, "fully_compliant": False, "compliant_axes": [],
        "stiffness": (TURN_NM_RAD * np.eye(3)).tolist(), "damping": (TURN_DAMPING * np.eye(3)).tolist(),
    }  # fmt: skip
    # Contact force that ends a run [N]
    stop = {"lead_force_n": PUSH_N, "force_limit_n": 80.0, "time_limit_s": 60.0, "travel_limit_m": 0.3}
    phase = {
        "pitch": None, "stop": stop, "translation": {**translation, "evidence": {}},
        "rotation": {**rotation, "evidence": {}},
    }  # fmt: skip
    return {"frame": {"axes": "base", "frames": frames, **dict.fromkeys(PLACES, frames["tip"])}, "phases": [phase]}
