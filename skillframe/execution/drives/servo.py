"""Electric servos: joints driven by co-simulated FMUs with a torque or position input.

    impedance -> joint torque -> motors' limits -> torque or target -> FMU -> spring torque -> plant

The controller is that of `skillframe.execution.drives.torque`, with motor velocities where the FMUs provide them:
damping on the joint's side of the spring is unstable. Joints without an FMU have ideal torques.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.cosim.servos import Servos, actuator_specs, open_servos, servos, start_parameters
from skillframe.execution.drive import Setup, Shares, Trials
from skillframe.execution.drives.actuated import Actuated
from skillframe.execution.drives.torque import Gauge, OneArm, TorqueDrive
from skillframe.execution.recorder import Recorder, WithColumns
from skillframe.execution.result import Result
from skillframe.fmu.opening import unmapped
from skillframe.frames import Float
from skillframe.signals import CommandDelay
from skillframe.skill import Broken, Command, Observation
from skillframe.world.plant import Draws, Kinematics

NOT_RECORDED = ("force_mean", "work")


class ServoLimb:
    """An arm with joints driven by FMUs: a `skillframe.execution.drives.torque.Limb`.

    Raises:
        InputError: a servo does not fit robot.toml.
        StepTooLarge: the control rate is too low for a spring and its load.
    """

    dofs: Sequence[NDArray[np.int64]] | None = None

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        spec = setup.robot.spec
        self.servos: Servos = servos(spec)
        self.arm = OneArm(setup, draws, rngs)
        self.plant, self.rows, self.point, self.dt = self.arm.plant, self.arm.rows, self.arm.point, self.arm.dt
        self.sensors: Gauge = self.arm.sensors
        self.joints = tuple(actuation.joint for actuation in spec.actuation)
        self.bank = open_servos(spec, self.rows)
        self.actuated = Actuated(self.plant, self.joints, self.bank, 1.0 / spec.control.rate_hz)
        self.driven = self.actuated.plant.dofs
        hold = self.plant.kinematics(self.point).bias.take(self.driven, axis=1)
        scale = draws.get("actuator.friction_scale")
        self.actuated.master.start(0.0, 0.0, start_parameters(spec, hold, scale))
        self.actuated.require_stable()
        names = self.bank.outputs
        self._speeds = names.index("motor_velocity") if "motor_velocity" in names else None
        self._shape = (self.rows, len(self.joints))
        self._known: NDArray[np.bool_] = np.zeros(len(self.joints), dtype=bool)
        if self._speeds is not None:
            self._known = np.asarray(np.isfinite(self.bank.y[:, self._speeds].reshape(self._shape)).any(0))
        late = np.asarray(draws.get("actuator.delay", np.zeros(self.rows)))
        ticks = np.round(late * spec.control.rate_hz).astype(np.int64)
        self._delay = CommandDelay(ticks, len(self.joints), held=True)
        self.told = np.zeros(self._shape)
        self._velocity: Float = self.actuated.plant.velocity

    def kinematics(self, active: Trials) -> Kinematics:
        """Kinematics of the nominal robots at the plant's joints, with the motors' velocities."""
        seen = self.arm.kinematics(active)
        velocity = seen.velocity.copy()
        joints = velocity.take(self.driven, axis=1)
        if self._speeds is not None:
            joints = np.where(self._known, self.bank.y[:, self._speeds].reshape(self._shape), joints)
            velocity[:, self.driven] = joints
        self._velocity = joints
        return seen._replace(velocity=velocity)

    def mass_matrix(self) -> Float:
        """Mass matrices (N, nv, nv) of the nominal robots, including rotors."""
        matrix = self.arm.mass_matrix()
        matrix[:, self.driven, self.driven] += self.servos.inertia
        return matrix

    def joint_positions(self) -> Float:
        """Joint positions (N, nv)."""
        return self.arm.joint_positions()

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Step under generalised forces (N, nv), through FMUs where there are some."""
        coupled = self.actuated.plant
        coupled.load[:] = torque
        coupled.load[:, self.driven] = 0.0
        position = coupled.where()[0].reshape(self._shape)
        sent = self.servos.command(torque.take(self.driven, axis=1), position, self._velocity)
        self.told = self._delay.step(sent)
        broken = self.actuated.step(self.told, active)
        self.arm.read_encoders()
        return broken


class ServoDrive:
    """One arm with an impedance controller and servos as FMUs."""

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        spec = setup.robot.spec
        self.limb = ServoLimb(setup, draws, rngs)
        self.law = TorqueDrive(setup, self.limb)
        self.plant, self.dt, self.actuators = self.limb.plant, self.law.dt, self.limb.joints
        rows = unmapped(actuator_specs(spec), [a.unused for a in spec.actuation], spec.folder)
        self._unmapped = [text for row in rows for text in row._replace(outputs=()).sentences]

    def prepare(self) -> list[Broken]:
        """Hold still and tare. Trials whose FMU failed to start do not run."""
        failed = self.limb.actuated.failed(np.arange(self.plant.count))
        return [*failed, *self.law.prepare()]

    def sense(self, tick: int, active: Trials) -> Observation:
        """Observation, with the twist from the motors' velocities."""
        return self.law.sense(tick, active)

    def act(self, command: Command, ramp: float) -> Float:
        """Compute torques within the motors' limits."""
        return self.law.act(command, ramp)

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """The robot's limits, and the energy error of the coupling."""
        return [*self.law.violations(tick, active), *self.limb.actuated.violations(tick, active)]

    def advance(self, active: Trials) -> list[Broken]:
        """Step the coupled plant."""
        return self.law.advance(active)

    def end(self, rows: Trials) -> None:
        """Stop stepping their FMUs."""
        self.limb.actuated.end(rows)

    def contact_torque(self) -> Float:
        """Contact torque (N,) [Nm]."""
        return self.law.contact_torque()

    def shares(self) -> Shares:
        """Shares of the URDF's effort and velocity."""
        return self.law.shares()

    def notes(self, i: int) -> list[str]:
        """Motors without limits, substitutes for FMUs, and their unused inputs."""
        return [*self.law.notes(i), *self.limb.bank.notes, *self._unmapped]

    def recording(self, every: int) -> WithColumns:
        """A recorder with the servos' commands and all available outputs."""
        k, names, y = len(self.actuators), self.limb.bank.outputs, self.limb.bank.y
        there = np.asarray(np.isfinite(y.reshape(-1, k, len(names))).all(axis=1).any(axis=0))
        given = [name for name, is_there in zip(names, there, strict=True) if is_there and name not in NOT_RECORDED]
        self._recorded = [(name, names.index(name)) for name in given]
        columns = dict.fromkeys(("servo_command", *(f"servo_{name}" for name in given)), (k,))
        return WithColumns(Recorder(self.plant, every, self.limb.point, machine=columns), self._columns)

    def outcome(self, result: Result) -> Result:
        """The unchanged result."""
        return result

    def _columns(self) -> dict[str, Float]:
        y, shape = self.limb.bank.y, self.limb.told.shape
        return {"servo_command": self.limb.told} | {
            f"servo_{name}": y[:, column].reshape(shape) for name, column in self._recorded
        }
