"""Drives of a real robot: the controllers of the simulation, with a link in place of the plant.

    link.read -> shadow's kinematics -> Observation -> skill -> Command -> controller -> link.send

The shadow is the simulated robot in its world. It is set to the measured joints in each tick and never stepped, so that
poses, Jacobians, distances to collision and the recorded scene come from the same code as in simulation. Its contact
force is the wrench that the robot's sensor felt.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from skillframe.control import LimitGuard
from skillframe.errors import InputError
from skillframe.execution import HOLD, AdmittanceDrive, Gauge, PacedSkill, Result, Setup, TorqueDrive, Trials
from skillframe.extend import DriveType
from skillframe.frames import Float, Pose, move_wrench, norm, rotate
from skillframe.skill import Broken, Command, Ended, Skill, no_reasons
from skillframe.world import Draws, Kinematics, Plant, fixture_poses
from skillframe_drive.link import ImpedanceLink, Link, RobotState, Spring

TARE_S = 0.2
"""Time of rest over which the force sensor's bias is averaged [s]."""
STILL_RAD = 2e-3
"""Largest motion of a joint while the sensor is tared [rad]: an arm in contact yields by more."""
MOST_MISSED = 25
"""States that may be lost in a run."""


class Shadow(Plant):
    """The simulated robot at the measured joints. Contact is what the robot's sensor felt."""

    felt: Float = np.zeros((1, 6))
    """Wrench (1, 6) at the tool frame's origin, base axes."""

    def contact_force(self) -> Float:
        """Magnitude (1,) of the measured force [N]."""
        return norm(self.felt[:, :3])

    def contact_wrench(self, offset: Float) -> Float:
        """Measured wrench (1, 6) at a point of the tool frame, base axes."""
        return move_wrench(self.felt, rotate(self.tool_pose().rotation, offset))


class RealLimb:
    """The robot at the other end of a link, as a `skillframe.execution.drives.torque.Limb`.

    Attributes:
        link: to the robot.
        state: that it reported last.
        bias: (6,) of the force sensor, base axes.
    """

    dofs: Sequence[NDArray[np.int64]] | None = None
    rows = 1
    plant: Plant
    sensors: Gauge

    def __init__(self, setup: Setup, believed: Draws, link: Link) -> None:
        self.link, self.dt = link, link.period
        fixture = fixture_poses(setup.robot, believed, 1)
        self._shadow = Shadow(setup.robot, setup.scene, 1, fixture, {}, timestep=self.dt, rigid=True)
        self.point = np.asarray(setup.center_of_compliance, dtype=float)
        self.plant, self.sensors = self._shadow, self
        self.state, self.bias = link.read(), np.zeros(6)
        self._arm = self.plant.dofs
        if len(self.state.position) != len(self._arm):
            text = f"has {len(self.state.position)} joints, and robot {setup.robot.spec.name} has {len(self._arm)}"
            raise InputError("the robot at the link", text, "name its own robot.toml in cell.toml")
        self.plant.reset(setup.robot.home[None])
        self._set()

    def kinematics(self, active: Trials) -> Kinematics:
        """Wait for the robot's next state, and return the shadow's kinematics there."""
        self.state = self.link.read()
        self._set()
        found = self.plant.kinematics(self.point)
        self._bias = found.bias
        return found

    def _set(self) -> None:
        position, velocity = (each.copy() for each in self.plant.state)
        position[0, self._arm], velocity[0, self._arm] = self.state.position, self.state.velocity
        self.plant.set_state(position, velocity, np.arange(1))
        self._shadow.felt = (self.state.wrench - self.bias)[None]

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """The pose itself, and the measured wrench (1, 6) without bias."""
        return pose, self._shadow.felt

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """Set the bias to the mean wrench (1, 6) at rest."""
        self.bias = self.bias + mean[0]

    def mass_matrix(self) -> Float:
        """Mass matrix (1, n, n) of the shadow."""
        return self.plant.mass_matrix()

    def joint_positions(self) -> Float:
        """Measured joint positions (1, n) [rad]."""
        return self.plant.joint_positions

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Send torques (1, n) without gravity and Coriolis torques, which the robot adds itself."""
        self.link.send((torque - self._bias)[0, self._arm])
        return []


class _OnLink(TorqueDrive):
    """What both drives share: taring in air, faults of the link, and the end.

    Attributes:
        real: the robot.
        dry: read and compute, but never send.
    """

    real: RealLimb
    dry = False
    armed = False
    noise_n: float | None = None
    """Standard deviation of the force in the tare, root of the sum over its components [N]."""

    def prepare(self) -> list[Broken]:
        """Zero the force sensor at rest. A robot that moves meanwhile touches something, and is refused."""
        limb, active = self.real, np.arange(1)
        limb.link.tare()
        at, still = limb.kinematics(active), np.zeros((1, 6))
        hold = Pose(at.pose.position.copy(), at.pose.rotation.copy()).at(limb.point)
        command = Command(hold, still, HOLD, still, np.zeros(1, dtype=np.int64), no_reasons(1))
        states: list[RobotState] = []
        for tick in range(round(TARE_S / self.dt)):
            self.sense(tick, active)
            self.act(command, 0.0)  # nothing is sent: the first calls are slow, and are made here
            states.append(limb.state)
        if limb.link.fault:
            return [Broken(0, Ended.LINK, limb.link.fault)]
        moved = float(np.ptp([each.position for each in states], axis=0).max())
        mean = np.mean([each.wrench for each in states], axis=0)
        if moved > STILL_RAD:
            force = float(norm(mean[None, :3])[0])
            text = f"the robot moved by {1e3 * moved:.1f} mrad while its force sensor was zeroed, at {force:.1f} N"
            return [Broken(0, Ended.LINK, f"{text}: start in free air, at rest")]
        limb.set_tare((mean - limb.bias)[None], at.pose.rotation)
        self.noise_n = float(norm(np.std([each.wrench[:3] for each in states], axis=0)[None])[0])
        self._restart()
        if why := self._refused():
            return [Broken(0, Ended.LINK, why)]
        if not self.dry:
            limb.link.arm()
            self.armed = True
        return []

    def _restart(self) -> None:
        """Begin control anew at the measured joints."""

    def _refused(self) -> str:
        """Why the robot cannot run the skill, or ""."""
        return ""

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Faults of the link, then the limits of the simulation."""
        link = self.real.link
        if link.fault:
            return [Broken(0, Ended.LINK, link.fault)]
        if link.missed > MOST_MISSED:
            return [Broken(0, Ended.LINK, f"{link.missed} states of the robot were lost")]
        return super().violations(tick, active)

    def end(self, rows: Trials) -> None:
        """Stop the robot."""
        if self.armed and not self.real.link.fault:
            self.real.link.halt()
        self.armed = False

    def outcome(self, result: Result) -> Result:
        """The result, with the noise of the sensor in the trace's metadata."""
        for trace in result.traces or ():
            trace.meta["sensor_noise_n"] = self.noise_n
        return super().outcome(result)

    def notes(self, i: int) -> list[str]:
        """How the link did."""
        link = self.real.link
        sent = "nothing was sent to the robot; " if self.dry else ""
        return [f"{sent}{link.missed} states were lost, the longest gap was {1e3 * link.longest:.0f} ms"]


class PositionOnLink(_OnLink, AdmittanceDrive):
    """A robot that takes joint positions: the admittance controller."""

    def __init__(self, setup: Setup, limb: RealLimb) -> None:
        AdmittanceDrive.__init__(self, setup, limb)
        self.real = limb
        self.motors, self.guard = None, LimitGuard(setup.limits, 1, self.dt, None)  # the robot limits its own motors

    def _restart(self) -> None:
        self._begin()

    def _drive(self) -> None:
        """Nothing: the robot has its own position loop."""

    def advance(self, active: Trials) -> list[Broken]:
        """Send the joint positions."""
        if self.armed:
            self.real.link.send(self._sent[0, self._dofs])
        return []


class TorqueOnLink(_OnLink):
    """A robot that takes joint torques: the impedance controller."""

    def __init__(self, setup: Setup, limb: RealLimb) -> None:
        super().__init__(setup, limb)
        self.real = limb
        self._late = 0  # the delay is in the robot

    def advance(self, active: Trials) -> list[Broken]:
        """Send the torques."""
        return super().advance(active) if self.armed else []


class ImpedanceOnLink(_OnLink):
    """A robot that takes the impedance of its tool, and has the controller itself.

    Attributes:
        skill: that will run; its first command is tried on a copy before anything is sent.
    """

    skill: Skill | None = None

    def __init__(self, setup: Setup, limb: RealLimb) -> None:
        super().__init__(setup, limb)
        self.real = limb
        self._late = 0  # the delay is in the robot

    def _refused(self) -> str:
        """Why the robot cannot take the first command of the skill, which a copy gives."""
        if self.skill is None:
            return ""
        tried, seen, link = deepcopy(self.skill), self.sense(0, np.arange(1)), cast(ImpedanceLink, self.real.link)
        tried.start(seen, [np.random.default_rng(0)])
        self.act(tried.step(seen), 0.0)
        return link.refused(self._spring())

    def act(self, command: Command, ramp: float) -> Float:
        """Compute the wrench of the command, for the robot and for the limits."""
        self._command = command
        return super().act(command, ramp)

    def _spring(self) -> Spring:
        stiffness = np.broadcast_to(self._command.impedance.stiffness, (1, 6, 6))[0]
        at = self._reading
        damping = np.broadcast_to(self.controller.damping_for(self._command.impedance, at), (1, 6, 6))[0]
        return Spring(self._command.pose, at.pose, at.twist[0], stiffness, damping, self._law[0])

    def advance(self, active: Trials) -> list[Broken]:
        """Send the command."""
        if self.armed:
            self.real.link.send(self._spring())
        return []


def drive_type(link: Link, believed: Draws, *, dry: bool = False) -> DriveType:
    """The drive of a connected robot, for `skillframe.execution.drive.Setup.drive`.

    Args:
        link: to the robot.
        believed: where the fixture is believed to be, as quantities of a trial, each (1,).
        dry: read and compute, but never send.
    """
    summary = "a real robot" if not dry else "a real robot that is not sent anything"
    kind = {"position": PositionOnLink, "torque": TorqueOnLink, "impedance": ImpedanceOnLink}[link.takes]
    drives: list[_OnLink] = []

    def make(setup: Setup, draws: Draws, rngs: Any) -> _OnLink:
        made = kind(setup, RealLimb(setup, believed, link))
        made.dry = dry
        drives.append(made)
        return made

    def adapted(skill: Skill, setup: Setup) -> Skill:
        """The skill at the pace of the robot's interface, with a command in every tick."""
        if isinstance(drives[-1], ImpedanceOnLink):
            drives[-1].skill = skill
        return skill if setup.robot.spec.control.interface == "torque" else PacedSkill(skill, 1, setup.pace)

    return DriveType(name="link", summary=summary, make=make, adapted=adapted)
