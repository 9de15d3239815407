"""The searches as exception strategies: a body for where another skill has stalled.

Where a person has searched blindfolded, `search` is learned from that. Else it is the stated default: a light, stiff
spiral as wide as the fixture is uncertain, that rocks the tool and comes back in finer passes. Its figures were chosen
by hand on AutoMate's assemblies, by what each was worth there (our choice); friction and uncertainty are the user's.
"""

from __future__ import annotations

from dataclasses import asdict
from math import tan
from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.extend.records import Document, Stalled
from skillframe_search.deadband import STIFFEST, Gains, dead_band
from skillframe_search.learner import learn, plain
from skillframe_search.phase import Dither, Path, Phase, Push, Stiffness, Stop
from skillframe_search.simple import there_and_back
from skillframe_search.smoothing import STEP_S

PUSH_N = 4.0  # light, or friction holds the tip: 4 N at 4000 N/m and friction 0.5 is 0.5 mm
PITCH_M, SPEED, ACCELERATION, PASSES = 6e-4, 0.04, 1.0, 3
ROTATION, TURN = 3.0, 5.0  # Nm/rad: soft enough for the dither to rock it by 4 degrees
DITHER = Dither(tilt_nm=0.2, tilt_hz=4.0, turn_nm=0.3, turn_hz=3.0)
STOP = {"touch_n": 1.5, "approach_speed": 0.01, "lost_share": 0.5, "force_limit_n": 60.0}
INNER = 0.8  # where the likely part is not smaller than this of the whole, it is not searched first
DROP_M = 8e-4  # beside what a tilted surface falls from one side of the spiral to the other


def strategy(stalled: Stalled, kind: str) -> Document:
    """The body of a search: learned where there are blind demonstrations, else the stated default.

    Raises:
        InputError: settings for a default that has none, or blind demonstrations that hold no search.
    """
    if stalled.blind and kind == "search":
        return learn(stalled.blind, stalled.options, kind)
    if stalled.options.settings:
        raise InputError(
            f"--set {next(iter(stalled.options.settings))}", f"the {kind} on a stall has no such setting",
            "give --blind recordings to learn a search from, or leave it out",
        )  # fmt: skip
    gains = Gains(PUSH_N, STIFFEST)
    held = dead_band(stalled.friction, gains)
    near = stalled.radius if stalled.near is None else stalled.near
    inner = near + held if near < INNER * stalled.radius else 0.0
    path = Path(
        kind="spiral", speed=SPEED, acceleration=ACCELERATION, pitch=PITCH_M, layers=(0.0,), step=0.004,
        reach=0.02, radius=stalled.radius + held, passes=PASSES, inner=inner,
    )  # fmt: skip
    way = there_and_back(path.pitch, path.radius, path.speed, path.acceleration, path.passes, STEP_S, path.inner)
    drop = DROP_M + 2.0 * path.radius * tan(stalled.tilt)
    phase = Phase(
        push=Push(direction=stalled.way, force=gains.push), searched=("across_1", "across_2"), exploration=None,
        forces=None, path=path, stiffness=Stiffness(translation=gains.stiffness, rotation=ROTATION, turn=TURN),
        stop=Stop(time_s=float(np.ceil(len(way) * STEP_S)), drop_m=drop, **STOP),
        dither=DITHER,
        evidence={"friction": stalled.friction, "dead_band_m": held},
    )  # fmt: skip
    body: dict[str, Any] = plain(asdict(phase))
    return {"frame": stalled.frame, "phases": [body], "settings": {}}
