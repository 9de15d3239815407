"""Sound recordings of one slide, drawn by seed: nothing is wrong with any of them, so that a warning is a false one.

A tool points down, more or less, comes down on a plane, presses, slides under friction and leaves. Rates are 20 Hz to
1 kHz. By turns a slide has a hand's unsteady force, a sensor of coarse resolution, a tool's weight that was tared in
the first attitude, a touch before it, a hard landing that rings, a pause, a press that is not followed by a slide.
What is true of a slide although it is sound (its tared weight) is said beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from skillframe.frames import Float

HEADER = "t,px,py,pz,{},fx,fy,fz,tx,ty,tz"
ATTITUDES = ("qx,qy,qz,qw", "rvx,rvy,rvz")
GRAVITY = 9.81


class Slide(NamedTuple):
    """One recording.

    Attributes:
        header: names of its columns.
        rows: (T, n) values, the wrench that of the environment on the tool, at the tool point.
        frame: axes of the wrench, "base" or "tool".
        down: (3,) direction of the push in base.
        weight: of the tool, tared in the first attitude [N]; 0 for none.
        turned: largest angle from the first attitude [rad].
        touches: [start, stop] of each contact [s].
        kind: in words.
    """

    header: str
    rows: Float
    frame: str
    down: Float
    weight: float
    turned: float
    touches: list[tuple[float, float]]
    kind: str

    def write(self, path: str) -> None:
        """As a table of numbers with a header."""
        np.savetxt(path, self.rows, delimiter=",", header=self.header, comments="", fmt="%.9g")


def eased(u: Float) -> Float:
    """From 0 to 1 with rest at both ends (least jerk)."""
    v = np.clip(u, 0.0, 1.0)
    return np.asarray(v**3 * (10.0 - 15.0 * v + 6.0 * v**2))


def slow_noise(rng: np.random.Generator, time: Float, memory: float, width: int) -> Float:
    """(T, width) of unit variance that forgets within `memory` seconds."""
    coarse = np.arange(time[0] - memory, time[-1] + 2.0 * memory, 0.5 * memory)
    values = rng.normal(size=(len(coarse), width))
    smooth = values[:-2] * 0.5 + values[1:-1] * 0.7 + values[2:] * 0.5
    return np.stack([np.interp(time, coarse[1:-1], column) for column in smooth.T], axis=1)


def slide(seed: int) -> Slide:
    """The slide of a seed."""
    rng = np.random.default_rng([seed, 38])
    flags = {name: bool(rng.random() < p) for name, p in (
        ("hand", 0.5), ("coarse", 0.3), ("tared", 0.25), ("touch", 0.4), ("hard", 0.3), ("pause", 0.3), ("press", 0.2),
        ("tool axes", 0.5), ("rotation vector", 0.3), ("turns in the air", 0.5),
    )}  # fmt: skip
    rate = float(np.exp(rng.uniform(np.log(20.0), np.log(1000.0))))
    normal = Rotation.from_rotvec(np.r_[rng.uniform(-0.3, 0.3, 2), 0.0]).apply([0.0, 0.0, 1.0])
    along = np.cross(normal, Rotation.from_rotvec([0, 0, rng.uniform(0, 6.28)]).apply([1.0, 0.0, 0.0]))
    along /= np.linalg.norm(along)
    rest, fall, still, go = rng.uniform(0.5, 1.2), rng.uniform(1.2, 3.0), rng.uniform(0.1, 0.8), rng.uniform(1.5, 4.0)
    first = rest + fall + (1.6 if flags["touch"] else 0.0)
    leave = first + still + go + (rng.uniform(0.3, 1.0) if flags["pause"] else 0.0)
    time = np.arange(0.0, leave + rng.uniform(0.8, 1.5), 1.0 / rate)
    height, way, rise = rng.uniform(0.05, 0.2), rng.uniform(0.03, 0.15) * (not flags["press"]), rng.uniform(0.02, 0.1)
    if flags["touch"]:  # down, a touch of 0.3 s, up by 10 mm, down again
        up = height * (1.0 - eased((time - rest) / fall)) + 0.01 * (
            eased((time - rest - fall - 0.3) / 0.5) - eased((time - first + 0.6) / 0.6)
        )
        touches = [(rest + fall, rest + fall + 0.32), (first, leave)]
    else:
        up, touches = height * (1.0 - eased((time - rest) / fall)), [(first, leave)]
    if flags["hard"]:  # at full speed until it lands first
        u = np.clip((time - rest) / fall, 0.0, 1.0)
        up = up + height * (eased((time - rest) / fall) - u**2 * (2.0 - u))
    up = up + rise * eased((time - leave) / 0.8)
    start = first + still
    moved = way * eased((time - start) / go)
    if flags["pause"]:
        half, wait = start + 0.5 * go, leave - start - go
        moved = 0.5 * way * (eased((time - start) / (0.5 * go)) + eased((time - half - wait) / (0.5 * go)))
    wander = slow_noise(rng, time, 0.4, 3) * (2e-3 if flags["hand"] else 0.0)
    free = np.clip(up / 0.02, 0.0, 1.0)[:, None]
    place = np.array([0.4, 0.1, 0.05]) + np.outer(moved, along) + np.outer(up, normal) + wander * free
    press, friction, quick = rng.uniform(4.0, 40.0), rng.uniform(0.1, 0.5), rng.uniform(0.03, 0.3)
    load = np.zeros(len(time))
    for begin, end in touches:
        load = np.maximum(load, np.clip((time - begin) / quick, 0.0, 1.0) * np.clip((end - time) / quick, 0.0, 1.0))
    if flags["hand"]:
        load = load * (1.0 + 0.15 * slow_noise(rng, time, 0.3, 1)[:, 0])
    if flags["hard"]:
        since = np.clip(time - touches[0][0], 0.0, None)
        ring = np.exp(-since / rng.uniform(0.005, 0.04)) * np.cos(2.0 * np.pi * rng.uniform(20.0, 120.0) * since)
        load = load + rng.uniform(0.3, 1.5) * ring * (time >= touches[0][0])
    load = press * np.clip(load, 0.0, None)
    speed = np.gradient(moved, time)
    force = np.outer(load, normal) - np.outer(friction * load * np.tanh(speed / 0.002), along)
    angle = np.radians(rng.uniform(0.0, 60.0))
    turning = eased((time - rest) / fall) if flags["turns in the air"] or flags["press"] else eased((time - start) / go)
    axis = rng.normal(size=3)
    facing = Rotation.from_euler("xz", [180.0 + rng.uniform(-15, 15), rng.uniform(-180, 180)], degrees=True)
    attitude = Rotation.from_rotvec(np.outer(angle * turning, axis / np.linalg.norm(axis))) * facing
    torque = np.cross(attitude.apply([0.0, 0.0, rng.uniform(0.0, 0.03)]), force)
    wrench = np.concatenate([force, torque], axis=1)
    weight = GRAVITY * rng.uniform(0.2, 1.5) if flags["tared"] else 0.0
    gravity = np.tile([0.0, 0.0, -weight], (len(time), 1))
    wrench += np.concatenate([gravity, np.cross(attitude.apply([0.0, 0.0, 0.06]), gravity)], axis=1)
    local = np.concatenate([attitude.inv().apply(wrench[:, :3]), attitude.inv().apply(wrench[:, 3:])], axis=1)
    noise = float(np.exp(rng.uniform(np.log(0.02), np.log(0.4)))) * np.repeat([1.0, 0.03], 3)
    if weight:
        local -= local[0]
    local += rng.normal(size=local.shape) * noise
    if flags["coarse"]:
        step = rng.choice([0.01, 0.05, 0.2]) * np.repeat([1.0, 0.02], 3)
        local = np.round(local / step) * step
    if not flags["tool axes"]:
        local = np.concatenate([attitude.apply(local[:, :3]), attitude.apply(local[:, 3:])], axis=1)
    place = place + rng.normal(size=place.shape) * rng.choice([1e-6, 2e-5, 1e-4])
    shown = attitude.as_rotvec() if flags["rotation vector"] else attitude.as_quat()
    return Slide(
        HEADER.format(ATTITUDES[flags["rotation vector"]]), np.column_stack([time, place, shown, local]),
        "tool" if flags["tool axes"] else "base", -normal, weight, float(angle), touches,
        f"{rate:.0f} Hz, " + ", ".join(name for name, there in flags.items() if there),
    )  # fmt: skip
