"""Electric servos: joints driven by FMUs that take a torque or a position, co-simulated between law and plant.

    impedance -> joint torque -> motors' limits -> torque or target -> FMU -> spring torque -> plant

The law is that of ideal torques (`skillframe.execution.drives.torque`). It reads joint positions at the joints and,
where the FMUs give it, velocities at the motors: damping that acts before the spring is stable where damping behind it
is not. Joints without an FMU are driven ideally.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken
from skillframe.cosim.servos import Servos, actuator_specs, open_servos, servos, start_parameters
from skillframe.execution.drive import Shares, Trials
from skillframe.execution.drives.actuated import Actuated
from skillframe.execution.drives.recording import WithColumns
from skillframe.execution.drives.torque import Gauge, OneArm, TorqueDrive
from skillframe.execution.recorder import Recorder
from skillframe.execution.result import Result
from skillframe.execution.setup import Setup
from skillframe.fmu.unmapped import unmapped
from skillframe.frames import Float
from skillframe.signals.delay import CommandDelay
from skillframe.skill import Command, Observation
from skillframe.world.plant import Draws, Kinematics

NOT_RECORDED = ("force_mean", "work")


class ServoLimb:
    """An arm whose joints are driven by FMUs: a `skillframe.execution.drives.torque.Limb`.

    Args:
        setup: robot, scene and settings.
        draws: quantities per trial.
        rngs: one generator per trial, for the sensors.

    Raises:
        InputError: a servo cannot be driven as robot.toml says.
        StepTooLarge: the control rate is too low for a spring and what it carries.
    """

    dofs: Sequence[NDArray[np.int64]] | None = None

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        spec = setup.robot.spec
        self.servos: Servos = servos(spec)
        self.arm = OneArm(setup, draws, rngs)
        self.plant, self.rows, self.point = self.arm.plant, self.arm.rows, self.arm.point
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
        """Of the nominal robots where the plant's joints are now, with the velocities of the motors."""
        seen = self.arm.kinematics(active)
        velocity = seen.velocity.copy()
        joints = velocity.take(self.driven, axis=1)
        if self._speeds is not None:
            joints = np.where(self._known, self.bank.y[:, self._speeds].reshape(self._shape), joints)
            velocity[:, self.driven] = joints
        self._velocity = joints
        return seen._replace(velocity=velocity)

    def mass_matrix(self) -> Float:
        """(N, nv, nv) of the nominal robots, with the rotors."""
        matrix = self.arm.mass_matrix()
        matrix[:, self.driven, self.driven] += self.servos.inertia
        return matrix

    def joint_positions(self) -> Float:
        """(N, nv)."""
        return self.arm.joint_positions()

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """A tick under generalised forces (N, nv): what FMUs drive through them, the rest ideally."""
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
    """One arm under an impedance law, its joints driven by servos as FMUs.

    Args:
        setup, draws, rngs: as of `ServoLimb`.
    """

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        spec = setup.robot.spec
        self.limb = ServoLimb(setup, draws, rngs)
        self.law = TorqueDrive(setup, self.limb)
        self.plant, self.dt, self.actuators = self.limb.plant, self.law.dt, self.limb.joints
        rows = unmapped(actuator_specs(spec), [a.unused for a in spec.actuation], spec.folder)
        self._unmapped = [text for row in rows for text in row._replace(outputs=()).sentences]

    def prepare(self) -> list[Broken]:
        """Hold still and tare. Trials whose FMU refuses to start do not run."""
        failed = self.limb.actuated.failed(np.arange(self.plant.count))
        return [*failed, *self.law.prepare()]

    def sense(self, tick: int, active: Trials) -> Observation:
        """As with ideal torques, the twist from the motors' velocities."""
        return self.law.sense(tick, active)

    def act(self, command: Command, ramp: float) -> Float:
        """The law's torques, held to the motors' limits."""
        return self.law.act(command, ramp)

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """The robot's limits, and the energy that the coupling makes."""
        return [*self.law.violations(tick, active), *self.limb.actuated.violations(tick, active)]

    def advance(self, active: Trials) -> list[Broken]:
        """One coupled step. Trials whose FMU failed, each with its sentence."""
        return self.law.advance(active)

    def end(self, rows: Trials) -> None:
        """Their FMUs are not stepped any more."""
        self.limb.actuated.end(rows)

    def contact_torque(self) -> Float:
        """(N,) [Nm]."""
        return self.law.contact_torque()

    def shares(self) -> Shares:
        """Of the URDF's effort and velocity."""
        return self.law.shares()

    def notes(self, i: int) -> list[str]:
        """Whose motors count as unlimited, what stands in for FMUs, and inputs of theirs that nobody writes."""
        return [*self.law.notes(i), *self.limb.bank.notes, *self._unmapped]

    def recording(self, every: int) -> WithColumns:
        """A recorder with what the servos were told and every output that is mapped and there."""
        k, names, y = len(self.actuators), self.limb.bank.outputs, self.limb.bank.y
        there = np.asarray(np.isfinite(y.reshape(-1, k, len(names))).all(axis=1).any(axis=0))
        given = [name for name, is_there in zip(names, there, strict=True) if is_there and name not in NOT_RECORDED]
        self._recorded = [(name, names.index(name)) for name in given]
        columns = dict.fromkeys(("servo_command", *(f"servo_{name}" for name in given)), (k,))
        return WithColumns(Recorder(self.plant, every, self.limb.point, machine=columns), self._columns)

    def outcome(self, result: Result) -> Result:
        """As it is."""
        return result

    def _columns(self) -> dict[str, Float]:
        y, shape = self.limb.bank.y, self.limb.told.shape
        return {"servo_command": self.limb.told} | {
            f"servo_{name}": y[:, column].reshape(shape) for name, column in self._recorded
        }
