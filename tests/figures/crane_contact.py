"""The crane in the one loop lands at 5 cm/s on a plate on a spring, presses with its impedance, and slides steadily.

Everything is the machine's own: cylinders as FMUs, noisy sensors, force from pressures, what it identified and learned
in the air before. The plant's truth comes from the trace: positions from its configuration, the force of the contact.

    residual = D (X' - X_d') + K (X - X_d) - f
"""

import dataclasses
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from skillframe_hydraulics.declared import Gains, MachineNoise, with_gains, with_noise
from skillframe_papers.rows import crane_runs

from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.scene import Geom, Sprung
from tests.laws.crane_plants import crane

STIFFNESS, LOAD = 1e5, 8500.0  # K [N/m]; the force that K and the surface's spring make together [N]
DOWN_S, CLEARANCE, LANDING, EASE_S, STILL_S = 3.0, 0.1, 0.05, 0.5, 1.0  # s, m above the plate, m/s, s, s
SLIDE, SLIDING_S, SETTLED_S = 0.1, 5.0, 2.5  # m/s, s, s of sliding after which it is steady
ENCODER = 6e-6  # rad, one step of 20 bits


class Contact(NamedTuple):
    """True (T, 2) base x and z, and the times from which it touches and from which it slides steadily.

    `above`: of the tool's sphere over the plate at rest [m]; `force`: of the plate; `seen`: what the machine took it
    for; `residual`: of the target dynamics with the true force.
    """

    time: np.ndarray
    above: np.ndarray
    force: np.ndarray
    seen: np.ndarray
    residual: np.ndarray
    valve: np.ndarray
    touched: int
    steady: int

    @property
    def share(self):
        """Of the target dynamics' mean residual in the mean force, while it slides steadily."""
        part = slice(self.steady, None)
        return np.hypot(*self.residual[part].mean(axis=0)) / np.hypot(*self.force[part].mean(axis=0))

    @property
    def own_share(self):
        """The same with the force that the machine takes it for."""
        part = slice(self.steady, None)
        own = self.residual + self.force - self.seen
        return np.hypot(*own[part].mean(axis=0)) / np.hypot(*self.force[part].mean(axis=0))

    @property
    def ripple(self):
        """Standard deviation of the normal force then [N]."""
        return self.force[self.steady :, 1].std()

    @property
    def lost(self):
        """Time out of contact after the first touch [s]."""
        return float((self.force[self.touched :, 1] <= 0.0).sum() * (self.time[1] - self.time[0]))

    @property
    def hop(self):
        """Largest height of the tool over the plate at rest after the first touch [m]; below 0 it never left."""
        return self.above[self.touched :].max()


def plate(surface, ratio):
    """A slab on a spring of so many N/m; `ratio`: damping of the slab on it by itself."""
    slab = Geom(kind="box", size=(2.0, 0.5, 0.1), position=(0.0, 0.0, crane_runs.PLATE - 0.1))
    air = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=False)
    part = Sprung(name="plate", geoms=(slab,), axis=(0.0, 0.0, 1.0), stiffness=surface, damping_ratio=ratio)
    return dataclasses.replace(air, sprung=(part,))


def path_over(surface):
    """(path, time at which it begins to slide)."""
    depth = LOAD * (1.0 / STIFFNESS + 1.0 / surface)
    high = crane_runs.PLATE + crane_runs.RADIUS - crane_runs.ABOVE
    slide = DOWN_S + EASE_S / 2 + (CLEARANCE + depth) / LANDING + STILL_S

    def place(time):
        down = max(0.0, time - DOWN_S)
        lower = LANDING * (0.5 * down**2 / EASE_S if down < EASE_S else down - 0.5 * EASE_S)
        since = max(0.0, time - slide)
        way = SLIDE * (0.5 * since**2 if since < 1.0 else since - 0.5)
        reach = crane_runs.blend(time / DOWN_S)[0]
        return np.array([way - 0.25 * reach, 0.0, (high + CLEARANCE) * reach - min(lower, CLEARANCE + depth)])

    def path(time):
        h = 1e-4
        return place(time), (place(time + h) - place(max(time - h, 0.0))) / (h + min(time, h))

    return path, slide


def precise():
    """The crane with encoders of 20 bits, 6e-6 rad, and filters and gains that their noise allows."""
    spec = load_robot("hiab_xs031")
    sensors, gains = MachineNoise(encoder=ENCODER, corner_hz=60.0), Gains(body=1e4, force_corner_hz=50.0)
    return load_model(with_gains(with_noise(spec, sensors), gains))


def pressed(surface, damping=5e4, mass=1.0, friction=1.0, seed=1, ratio=0.5, delay=0.0, robot=None):
    """One run on a surface [N/m] with a damping ratio; mass and friction of the plant over what is believed.

    delay: of the valves [s], beyond their own; robot: the crane that ships if not given.
    """
    path, slide = path_over(surface)
    truth = {"robot.mass_scale": mass, "actuator.friction_scale": friction, "actuator.delay": delay}
    truth = {name: np.array([value]) for name, value in truth.items()}
    gains = crane_runs.Stiffness(STIFFNESS, damping)
    result = crane_runs.run(
        path, gains, plate(surface, ratio), truth, seconds=slide + SLIDING_S, seed=seed, trace_hz=1000.0, robot=robot
    )  # fmt: skip
    return seen_in(result.traces[0], damping, slide)


def seen_in(trace, damping, slide):
    time, axes = trace.time, [0, 2]
    x, wanted = true_path(trace.q), trace.desired_position[:, axes]
    rate, wanted_rate = (np.gradient(p, time, axis=0) for p in (x, wanted))
    force = trace.wrench_true[:, axes]
    residual = damping * (rate - wanted_rate) + STIFFNESS * (x - wanted) - force
    touched, steady = int(np.argmax(force[:, 1] > 0.0)), int(np.argmax(time > slide + SETTLED_S))
    above = x[:, 1] - crane_runs.PLATE - crane_runs.RADIUS
    return Contact(time, above, force, trace.wrench[:, axes], residual, trace.machine["valve"], touched, steady)


def true_path(configurations):
    """(T, 2) of the tool, base x and z."""
    model, frame = crane().model, crane().robot.tool_frames[0]
    data, rows = model.createData(), []
    for q in configurations:
        pin.framesForwardKinematics(model, data, q)
        rows.append(data.oMf[frame].translation[[0, 2]].copy())
    return np.array(rows)
