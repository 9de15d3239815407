"""Drive of several arms, each with its own sensors, filter, impedance controller, limits and trace.

Only the coordinator connects them. Batch row = trial * arms + arm, so each arm is controlled as it would be alone. The
first arm holds the scene's tool, the second its fixture.

Runs a skill for one arm on the first of several arms, while the others stand still.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.execution.drive import Setup, Shares, Trials
from skillframe.execution.drives.torque import Gauge, TorqueDrive, encoders_of, varied_plants
from skillframe.execution.executor import simulate
from skillframe.execution.recorder import Recorder
from skillframe.execution.result import ArmsResult, Result
from skillframe.execution.trace import Trace
from skillframe.frames import Float, Pose, norm, rotation_vector
from skillframe.handover import ShapeCheck
from skillframe.skill import Broken, Command, Impedance, Observation, Skill
from skillframe.world.plant import Draws, Kinematics
from skillframe.world.sensors import Sensors

__all__ = ["ArmsDrive", "SeveralArms"]


class SeveralArms:
    """The arms of N robots as rows of one `skillframe.execution.drives.torque.Limb`.

    Attributes:
        arms: their number.
        views: the plant as each arm sees it.
        points: (arms, 3) centres of compliance.
        path: (N, arms, joints) distance that each joint moved.
    """

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        self.count = len(rngs)
        self.plant, self.nominal = varied_plants(setup, draws, self.count)
        self.views = self.plant.arms()
        self._encoders = encoders_of(setup, self.plant)
        self.nominal_views = self.nominal.arms() if self.nominal is not self.plant else self.views
        self.dofs: Sequence[NDArray[np.int64]] | None = [view.dofs for view in self.views]
        self.arms = len(self.views)
        if len({len(view.dofs) for view in self.views}) > 1:
            raise SkillframeError(f"robot {setup.robot.spec.name}: its arms differ in their number of joints")
        self.points = np.broadcast_to(np.asarray(setup.center_of_compliance, dtype=float), (self.arms, 3))
        self.point, self.rows = np.tile(self.points, (self.count, 1)), self.count * self.arms
        self.dt = 1.0 / setup.robot.spec.control.tick_hz
        self.path = np.zeros((self.count, self.arms, len(self.views[0].dofs)))
        self.sensors: Gauge = _ArmSensors(self, setup, rngs, draws)

    def by_arm(self, parts: Sequence[Float]) -> Float:
        """Stack one (N, ...) per arm to (N, arms, ...), in C order, or rounding would depend on N."""
        result = np.empty((self.count, self.arms, *parts[0].shape[1:]))
        for arm, part in enumerate(parts):
            result[:, arm] = part
        return result

    def as_rows(self, parts: Sequence[Float]) -> Float:
        """Stack one (N, ...) per arm to (N arms, ...)."""
        stacked = self.by_arm(parts)
        return stacked.reshape(self.rows, *stacked.shape[2:])

    def kinematics(self, active: Trials) -> Kinematics:
        """Kinematics of the nominal robots at the plant's joints."""
        views = self.views
        if self.nominal is not self.plant:
            qpos, qvel = self.plant.state if self._encoders is None else self._encoders.state
            self.nominal.set_state(qpos, qvel, active)
            views = self.nominal_views
        found = [view.kinematics(point) for view, point in zip(views, self.points, strict=True)]
        return Kinematics(
            Pose(self.as_rows([k.pose.position for k in found]), self.as_rows([k.pose.rotation for k in found])),
            self.as_rows([k.jacobian[..., v.dofs] for k, v in zip(found, views, strict=True)]),
            self.as_rows([k.bias[:, v.dofs] for k, v in zip(found, views, strict=True)]),
            self.as_rows([k.velocity[:, v.dofs] for k, v in zip(found, views, strict=True)]),
        )

    def mass_matrix(self) -> Float:
        """Mass matrices (rows, joints, joints) of the nominal robots."""
        whole = self.nominal.mass_matrix()
        return self.as_rows([whole[:, view.dofs][:, :, view.dofs] for view in self.views])

    def joint_positions(self) -> Float:
        """Joint positions (rows, joints)."""
        positions = self.plant.joint_positions
        return self.as_rows([positions[:, view.dofs] for view in self.views])

    def push(self, torque: Float, active: Trials) -> list[Broken]:
        """Step the plant under joint torques (rows, joints)."""
        whole = np.zeros((self.count, self.plant.model.nv))
        _, velocity = self.plant.state
        for arm, view in enumerate(self.views):
            whole[:, view.dofs] = torque[arm :: self.arms]
            self.path[active, arm] += np.abs(velocity[:, view.dofs])[active] * self.dt
        self.plant.step(whole, active)
        if self._encoders is not None:
            self._encoders.sample(*self.plant.state)
        return []

    def turns(self) -> Float:
        """Orientations of the tools (N, arms, 3, 3), base axes."""
        return self.by_arm([view.tool_pose().rotation for view in self.views])


class ArmsDrive:
    """Arms with an impedance controller each. Observations, commands and wrenches are (N, arms, ...)."""

    actuators: tuple[str, ...] = ()

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        require_arms(setup)
        self.limb = SeveralArms(setup, draws, rngs)
        self.rows = TorqueDrive(setup, self.limb)
        self.plant, self.dt = self.limb.plant, self.rows.dt
        self.shape = (self.limb.count, self.limb.arms)
        self.names = tuple(arm.name for arm in setup.robot.spec.arm)[: self.limb.arms]
        self.turned = np.zeros((*self.shape, 3))
        self.start_rotation = self.limb.turns()
        self._recording: _ArmRecording | None = None

    def prepare(self) -> list[Broken]:
        """Hold still and tare all sensors."""
        return self.rows.prepare()

    def sense(self, tick: int, active: Trials) -> Observation:
        """Observation (N, arms, ...)."""
        seen = self.rows.sense(tick, active)
        return Observation(
            seen.time.reshape(self.shape), seen.dt,
            Pose(seen.pose.position.reshape(*self.shape, 3), seen.pose.rotation.reshape(*self.shape, 3, 3)),
            seen.twist.reshape(*self.shape, 6), seen.wrench.reshape(*self.shape, 6),
        )  # fmt: skip

    def act(self, command: Command, ramp: float) -> Float:
        """Apply each arm's command, and return wrenches (N, arms, 6)."""

        def rows(gain: Float) -> Float:
            return np.broadcast_to(gain, (*self.shape, 6, 6)).reshape(-1, 6, 6)

        stiffness, damping = command.impedance
        law = self.rows.act(
            command._replace(
                pose=Pose(command.pose.position.reshape(-1, 3), command.pose.rotation.reshape(-1, 3, 3)),
                twist=command.twist.reshape(-1, 6), feedforward=command.feedforward.reshape(-1, 6),
                impedance=Impedance(rows(stiffness), None if damping is None else rows(damping)),
            ),
            ramp,
        )  # fmt: skip
        return law.reshape(*self.shape, 6)

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Trials in which an arm broke a limit, with the arm's name."""
        arms = self.limb.arms
        found = self.rows.violations(tick, (active[:, None] * arms + np.arange(arms)).ravel())
        return [Broken(row // arms, code, f"arm {self.names[row % arms]!r}: {why}") for row, code, why in found]

    def advance(self, active: Trials) -> list[Broken]:
        """Step the plant."""
        return self.rows.advance(active)

    def end(self, rows: Trials) -> None:
        """Store the rotation of each tool."""
        now = self.limb.turns()
        self.turned[rows] = rotation_vector(now @ np.swapaxes(self.start_rotation, -1, -2))[rows]

    def contact_torque(self) -> Float:
        """Largest contact torque of the arms (N,) [Nm]."""
        parts = zip(self.limb.views, self.limb.points, strict=True)
        largest: Float = np.max([norm(view.contact_wrench(point)[:, 3:]) for view, point in parts], axis=0)
        return largest

    def shares(self) -> Shares:
        """Energy of all arms, and shares of the worst joint of any arm."""
        found = self.rows.shares()
        assert found.range is not None
        assert found.joints is not None
        parts = np.stack([found.torque, found.speed, found.range]).reshape(3, *self.shape)
        worst = np.argmax(np.where(np.isnan(parts), -1.0, parts), axis=-1)[..., None]
        (torque, speed, place), joints = (
            np.take_along_axis(part, worst, axis=-1)[..., 0] for part in (parts, found.joints.reshape(parts.shape))
        )
        return Shares(found.energy.reshape(self.shape).sum(-1), torque, speed, place, joints)

    def notes(self, i: int) -> list[str]:
        """Motors without limits."""
        return self.rows.notes(i)

    def recording(self, every: int) -> _ArmRecording:
        """One recorder per arm."""
        parts = zip(self.limb.views, self.limb.points, strict=True)
        recorders = [Recorder(view, every, point) for view, point in parts]
        self._recording = _ArmRecording(recorders, self.names, self.limb.points)
        return self._recording

    def outcome(self, result: Result) -> ArmsResult:
        """The result with the arms' own values."""
        plain = {f.name: getattr(result, f.name) for f in fields(Result)}
        traces = None if self._recording is None else self._recording.by_arm
        return ArmsResult(
            **plain, arms=self.names, joint_path_rad=self.limb.path, turned_rad=self.turned, arm_traces=traces
        )


class _ArmSensors:
    """One set of sensors per arm, each with its own random generator."""

    def __init__(self, limb: SeveralArms, setup: Setup, rngs: Sequence[np.random.Generator], draws: Draws) -> None:
        self._limb, self._arms = limb, limb.arms
        children = [rng.spawn(limb.arms) for rng in rngs]
        self._sensors = [
            Sensors(setup.sensors, view, [trial[arm] for trial in children], draws)
            for arm, view in enumerate(limb.views)
        ]

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        read = [
            sensors.sample(Pose(pose.position[arm :: self._arms], pose.rotation[arm :: self._arms]))
            for arm, sensors in enumerate(self._sensors)
        ]
        rows = self._limb.as_rows
        measured = Pose(rows([p.position for p, _ in read]), rows([p.rotation for p, _ in read]))
        return measured, rows([wrench for _, wrench in read])

    def set_tare(self, mean: Float, rotation: Float) -> None:
        for arm, sensors in enumerate(self._sensors):
            sensors.set_tare(mean[arm :: self._arms], rotation[arm :: self._arms])


class _ArmRecording:
    """One recorder per arm. `by_arm` has the requested traces by the arm's name."""

    def __init__(self, recorders: Sequence[Recorder], names: Sequence[str], points: Float) -> None:
        self._recorders, self._names, self._points = recorders, names, points
        self.by_arm: list[dict[str, Trace]] = []

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        for arm, recorder in enumerate(self._recorders):
            seen = Observation(
                observation.time[:, arm], observation.dt,
                Pose(observation.pose.position[:, arm], observation.pose.rotation[:, arm]),
                observation.twist[:, arm], observation.wrench[:, arm],
            )  # fmt: skip
            pose = Pose(command.pose.position[:, arm], command.pose.rotation[:, arm])
            recorder.record(tick, time, seen, command._replace(pose=pose), law[:, arm])

    def close(self, rows: Trials) -> None:
        for recorder in self._recorders:
            recorder.close(rows)

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """Return the first arm's trace of trial i, and add those of all arms to `by_arm`."""
        parts = zip(self._names, self._recorders, self._points, strict=True)
        self.by_arm.append({
            name: recorder.trace(i, {**meta, "arm": name, "center_of_compliance": point.tolist()})
            for name, recorder, point in parts
        })  # fmt: skip
        return self.by_arm[-1][self._names[0]]


def adapted(skill: Skill, setup: Setup) -> Skill:
    """A coordinator, which for a skill of one arm is a `FirstArm`."""
    return FirstArm(skill) if np.ndim(setup.center_of_compliance) == 1 else skill


def require_arms(setup: Setup) -> None:
    """Check that there are two arms.

    Raises:
        SkillframeError: the robot has one arm, or the scene no fixture to hold.
    """
    if len(setup.robot.tool_frames) < 2 or setup.scene.holder is None:
        raise SkillframeError(
            f"robot {setup.robot.spec.name} in world {setup.scene.name}: a coordinator needs a robot with two arms and "
            "a world whose fixture can be held; take dual_panda and dual_peg"
        )


STILL = Impedance(np.diag([2000.0] * 3 + [100.0] * 3), np.diag([180.0] * 3 + [8.0] * 3))
"""Impedance of an arm without a task: stiff, and about critically damped."""


class FirstArm(Skill):
    """A coordinator that runs a skill on the first arm while the others hold their poses."""

    def __init__(self, skill: Skill) -> None:
        self._skill = skill

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Store the tools' poses, and start the skill."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        count, arms = observation.time.shape
        self._rest = np.zeros((count, arms, 6))
        self._gains = [np.array(np.broadcast_to(gain, (count, arms, 6, 6))) for gain in STILL if gain is not None]
        self._checked = ShapeCheck(self._skill, (count,))
        self._skill.start(_first(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """The skill's command for the first arm, and the start pose for the others."""
        wanted = self._checked(self._skill.step(_first(observation)))
        stiffness, damping = self._gains
        stiffness[:, 0] = wanted.impedance.stiffness
        if wanted.impedance.damping is not None:
            damping[:, 0] = wanted.impedance.damping
        position = _replaced(self._home.position, wanted.pose.position)
        return Command(
            Pose(position, _replaced(self._home.rotation, wanted.pose.rotation)),
            _replaced(self._rest, wanted.twist),
            Impedance(stiffness, None if wanted.impedance.damping is None else damping),
            _replaced(self._rest, wanted.feedforward),
            wanted.status,
            wanted.reason,
        )


def _first(observation: Observation) -> Observation:
    pose = Pose(observation.pose.position[:, 0], observation.pose.rotation[:, 0])
    return Observation(observation.time[:, 0], observation.dt, pose, observation.twist[:, 0], observation.wrench[:, 0])


def _replaced(arms: Float, first: Float) -> Float:
    result = arms.copy()
    result[:, 0] = first
    return result


def simulate_arms(
    coordinator: Skill,
    setup: Setup,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    duration_s: float = 30.0,
    trace_hz: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> ArmsResult:
    """Run a coordinator on len(rngs) trials until each has ended. Arguments as of `executor.simulate`.

    With one centre of compliance (3,), `coordinator` is a skill for the first arm, and the others hold still. `start.*`
    displaces the first arm's tool, `fixture.*` the fixture in the second hand.

    Raises:
        SkillframeError: the robot has one arm, or the scene no fixture to hold.
        UnknownName, UnreachablePose: as `simulate`.
    """
    require_arms(setup)
    result = simulate(coordinator, setup, draws, rngs, duration_s=duration_s, trace_hz=trace_hz, progress=progress)
    assert isinstance(result, ArmsResult)
    return result
