"""Searches as exception strategies where another skill has stalled.

It is learned from blind demonstrations if there are any. The default is a light, stiff spiral as wide as the
fixture's error, which rocks the tool and returns in finer passes; its constants were chosen on AutoMate's assemblies.
"""

from __future__ import annotations

from dataclasses import asdict
from math import tan
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.extend import Document, Stalled
from skillframe_search.deadband import STIFFEST, Gains, dead_band
from skillframe_search.learner import learn, plain
from skillframe_search.phase import Dither, Path, Phase, Push, Stiffness, Stop
from skillframe_search.simple import there_and_back
from skillframe_search.smoothing import STEP_S


def strategy(stalled: Stalled) -> Document:
    """Body of a search: learned from blind demonstrations, else the default.

    Raises:
        InputError: settings for a default that has none, or blind demonstrations that hold no search.
    """
    if stalled.blind:
        return learn(stalled.blind, stalled.options)
    if stalled.options.settings:
        raise InputError(
            f"--set {next(iter(stalled.options.settings))}", "the default search on a stall has no such setting",
            "give --set blind recordings to learn a search from, or leave it out",
        )  # fmt: skip
    gains = Gains(4.0, STIFFEST)  # small against friction: 4 N at 4000 N/m and friction 0.5 lag by 0.5 mm
    held = dead_band(stalled.friction, gains)
    near = stalled.radius if stalled.near is None else stalled.near
    # a likely region above this share of the radius is not searched first
    inner = near + held if near < 0.8 * stalled.radius else 0.0
    path = Path(
        kind="spiral", speed=0.04, acceleration=1.0, pitch=6e-4, layers=(0.0,), step=0.004,
        reach=0.02, radius=stalled.radius + held, passes=3, inner=inner,
    )  # fmt: skip
    way = there_and_back(path.pitch, path.radius, path.speed, path.acceleration, path.passes, STEP_S, path.inner)
    drop = 8e-4 + 2.0 * path.radius * tan(stalled.tilt)  # beside the height of a tilted surface across the spiral
    # the dither rocks the tool by 4 degrees against a soft rotation
    phase = Phase(
        push=Push(direction=stalled.way, force=gains.push), searched=("across_1", "across_2"), exploration=None,
        forces=None, path=path, stiffness=Stiffness(translation=gains.stiffness, rotation=3.0, turn=5.0),
        stop=Stop(
            time_s=float(np.ceil(len(way) * STEP_S)), drop_m=drop, touch_n=1.5, approach_speed=0.01, lost_share=0.5,
            force_limit_n=60.0,
        ),
        dither=Dither(tilt_nm=0.2, tilt_hz=4.0, turn_nm=0.3, turn_hz=3.0),
        evidence={"friction": stalled.friction, "dead_band_m": held},
    )  # fmt: skip
    body: dict[str, Any] = plain(asdict(phase))
    return {"frame": stalled.frame, "phases": [body], "settings": {}}
