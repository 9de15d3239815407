r"""Grooves slid down in formulas, and the files that other people's tools would write of it.

Nothing is imported from skillframe. A tool is pushed along d, wavering, against one wall of a groove with the outward
normal n. With N = -d.n and the tangential part t = d + N n it sticks if |t| <= mu N; else it slides along t and feels

    F = f (N n - mu N t / |t|)                                                                                (1)

for a push of size f. A push is feasible if on both walls it slides towards the bottom, (2); in the plane across the
groove that is a tilt from straight down by less than the wall's slope - atan mu.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

RATES = (50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)
NAMES = ("t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz")
AIM_TIME = 0.5  # s over which a person's aim stays


def rotation_of(q):
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def any_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


@dataclass
class Groove:
    """Two walls of any slopes in any attitude, and how they are shown."""

    seed: int
    slopes: np.ndarray = field(init=False)
    friction: float = field(init=False)

    def __post_init__(self):
        self.rng = np.random.default_rng([777, self.seed])
        while True:
            self.slopes, self.friction = np.deg2rad(self.rng.uniform(20.0, 60.0, 2)), self.rng.uniform(0.0, 0.5)
            if self.slopes.min() - np.arctan(self.friction) > np.deg2rad(6.0):
                break
        self.attitude = rotation_of(any_quaternion(self.rng))
        left, right = self.slopes
        local = [[np.sin(left), 0.0, np.cos(left)], [-np.sin(right), 0.0, np.cos(right)]]
        downhill = [[np.cos(left), 0.0, -np.sin(left)], [-np.cos(right), 0.0, -np.sin(right)]]
        self.normals, self.downhill = np.array(local) @ self.attitude.T, np.array(downhill) @ self.attitude.T
        self.down = -self.attitude[:, 2]
        self.rate = float(self.rng.choice(RATES))
        self.noise = self.rng.uniform(0.02, 1.0)

    def feasible(self, push):
        """(2)."""
        for normal, downhill in zip(self.normals, self.downhill, strict=True):
            load = max(0.0, -push @ normal)
            slide = push + load * normal
            if np.linalg.norm(slide) <= self.friction * load or slide @ downhill <= 0.0:
                return False
        return True

    def gives_way(self, push, axis):
        """Whether a tool that is free along one axis follows both walls downhill: w = push + c axis with w.n = 0."""
        for normal, downhill in zip(self.normals, self.downhill, strict=True):
            way = push - (push @ normal) / (axis @ normal) * axis
            if way @ downhill < np.cos(np.deg2rad(45.0)) * np.linalg.norm(way):
                return False
        return True

    def show(self):
        """Two recordings, a wall each: clock, tool point, attitude, force and torque of the environment on the tool."""
        speed, force = self.rng.uniform(0.015, 0.06), self.rng.uniform(6.0, 20.0)
        aim, approach = np.deg2rad(self.rng.uniform(1.0, 8.0)), float(self.rng.choice([0.0, 0.01, 0.02]))
        return [self._recording(normal, speed, force, aim, approach) for normal in self.normals]

    def _recording(self, normal, speed, force, aim, approach):
        rng, dt, length = self.rng, 1.0 / self.rate, self.rng.uniform(0.025, 0.06)
        place, path, forces, went, wander = np.zeros(3), [], [], 0.0, aim * self.rng.normal(size=3)
        keep = np.exp(-dt / AIM_TIME)
        while went < approach + length and len(path) < 30.0 * self.rate:
            wander = keep * wander + aim * np.sqrt(1.0 - keep**2) * rng.normal(size=3)
            push = (self.down + wander) / np.linalg.norm(self.down + wander)
            step, felt = (speed * push, np.zeros(3)) if went < approach else self._contact(push, normal, speed, force)
            place, went = place + step * dt, went + np.linalg.norm(step) * dt
            path.append(place)
            forces.append(felt)
        count = len(path)
        time = rng.uniform(0.0, 100.0) + np.arange(count) * dt
        if rng.random() < 0.3:
            time = time + rng.uniform(-0.2, 0.2, count) * dt
        return {
            "time": time,
            "position": rng.uniform(-1.0, 1.0, 3) + np.array(path) + 2e-5 * rng.normal(size=(count, 3)),
            "quaternion": any_quaternion(rng),
            "force": np.array(forces) + self.noise * rng.normal(size=(count, 3)),
            "torque": self.noise / 15.0 * rng.normal(size=(count, 3)),
        }

    def _contact(self, push, normal, speed, force):
        """(1)."""
        load = -push @ normal
        if load <= 0.0:
            return speed * push, np.zeros(3)
        slide = push + load * normal
        size = np.linalg.norm(slide)
        if size <= self.friction * load:
            return np.zeros(3), -force * push
        return speed * slide / size, force * load * (normal - self.friction * slide / size)


def unconditioned(recording, noise, rng):
    """The same as the sensor alone has it: with a bias of some newtons, after a second of rest in free air."""
    step, turn = float(np.median(np.diff(recording["time"]))), rotation_of(recording["quaternion"])
    rest = round(1.0 / step)
    time = recording["time"][0] + step * np.arange(rest + len(recording["time"]))
    place = np.vstack([np.repeat(recording["position"][:1], rest, axis=0), recording["position"]])
    loads = {}
    for name, bias, scatter in (("force", 3.0, noise), ("torque", 0.2, noise / 15.0)):
        quiet = scatter * rng.normal(size=(rest, 3))
        loads[name] = np.vstack([quiet, recording[name]]) + turn @ (bias * rng.normal(size=3))
    return {**recording, "time": time, "position": place, **loads}


def any_style(rng):
    """How a lab writes its files: format, axes, point and sign of its sensor, and the looks of its text."""
    teacher = rng.random() < 0.3
    return {
        "ending": str(rng.choice([".csv", ".npz"])),
        "sign": "teacher" if teacher else None,
        "frame": rng.choice([None, "base", "tool"]),
        "point": rng.uniform(-0.2, 0.2, 3).tolist() if rng.random() < 0.4 else [0.0, 0.0, 0.0],
        "load": None if teacher or rng.random() < 0.7 else (rng.uniform(0.3, 2.0), rng.uniform(-0.1, 0.1, 3).tolist()),
        "flips": rng.random() < 0.3,
        "shuffled": rng.random() < 0.5,
        "separator": str(rng.choice([",", ";", "\t"])),
        "end": str(rng.choice(["\n", "\r\n"])),
        "mark": b"\xef\xbb\xbf" if rng.random() < 0.2 else b"",
        "millimetres": rng.random() < 0.2,
    }


def write(recording, folder: Path, name: str, style, rng) -> Path:
    """A recording as a file of this style. Its metadata say what the contract leaves open."""
    path = folder / f"{name}{style['ending']}"
    force, torque, said = _as_sensed(recording, style)
    count = len(recording["time"])
    quaternion = np.tile(recording["quaternion"], (count, 1))
    if style["flips"]:
        quaternion *= rng.choice([-1.0, 1.0], (count, 1))
    scale = 1e3 if style["millimetres"] and path.suffix == ".csv" else 1.0
    arrays = np.column_stack([recording["time"], scale * recording["position"], quaternion, force, torque])
    columns = dict(zip(NAMES, arrays.T, strict=True))
    if path.suffix == ".npz":
        meta = {"format": "skillframe.demonstration", "version": 1, **({"wrench": said} if said else {})}
        np.savez_compressed(path, meta=json.dumps(meta), **columns)
        return path
    _write_text(path, columns, style, rng)
    if said:
        path.with_name(f"{name}.meta.toml").write_text(
            "".join(f"wrench.{key} = {json.dumps(value)}\n" for key, value in said.items())
        )
    return path


def _as_sensed(recording, style):
    """Force and torque as the sensor has them, and the words for it."""
    turn, said = rotation_of(recording["quaternion"]), {}
    lever = turn @ np.array(style["point"])
    force, torque = recording["force"], recording["torque"] - np.cross(lever, recording["force"])
    if any(style["point"]):
        said["point"] = ",".join(map(repr, style["point"]))
    if style["sign"] == "teacher":
        force, torque, said["sign"] = -force, -torque, "teacher"
    if style["load"] is not None:
        mass, centre = style["load"]
        weight = np.array([0.0, 0.0, -9.81 * mass])
        force, torque = force + weight, torque + np.cross(turn @ np.array(centre) - lever, weight)
        said |= {"includes_tool_weight": True, "tool_mass": mass, "tool_com": centre}
    if style["frame"] == "tool":
        force, torque = force @ turn, torque @ turn
    if style["frame"] is not None:
        said["frame"] = str(style["frame"])
    return force, torque, said


def _write_text(path, columns, style, rng):
    names = list(columns)
    if style["shuffled"]:
        first = [name for name in names if name[0] != "q"]
        rng.shuffle(first)
        names = [*first[:4], "qx", "qy", "qz", "qw", *first[4:], "gripper"]
        columns = {**columns, "gripper": np.full(len(columns["t"]), 0.04)}
    rows = [style["separator"].join(f"{columns[name][i]:.9g}" for name in names) for i in range(len(columns["t"]))]
    text = style["end"].join([style["separator"].join(names), *rows, ""])
    path.write_bytes(style["mark"] + text.encode())
