"""Several arms in the one loop: a coordinator sees (N, arms, ...) and answers with a command for every arm.

Each arm has its own sensors, filter, impedance law, limits and trace, and knows nothing of the others; between them
stands the coordinator alone. The loop is the executor's, with a row per trial and arm (row = trial * arms + arm), so an
arm is controlled exactly as it would be alone. The first arm holds the scene's tool, the second its fixture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken, Ended
from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose, norm, rotation_vector
from skillframe.handover import ShapeCheck
from skillframe.run.executor import Loop, Result, Setup
from skillframe.run.recorder import Recorder
from skillframe.run.trace import Trace
from skillframe.skill import Command, Impedance, Observation, Skill
from skillframe.world.placement import check_quantities
from skillframe.world.plant import Draws, Kinematics
from skillframe.world.sensors import Sensors

__all__ = ["ArmsResult", "FirstArm", "simulate_arms"]

STILL = Impedance(np.diag([2000.0] * 3 + [100.0] * 3), np.diag([180.0] * 3 + [8.0] * 3))
"""How an arm without a task holds its tool; ours: stiff, about critically damped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmsResult(Result):
    """What became of N trials of several arms; `traces` of the base class are the first arm's.

    Attributes:
        arms: their names.
        joint_path_rad: (N, arms, joints) way each joint went.
        turned_rad: (N, arms, 3) rotation vector of each tool since the start, base axes.
        arm_traces: per trial a trace for every arm, by name, if asked for.
    """

    arms: tuple[str, ...]
    joint_path_rad: Float
    turned_rad: Float
    arm_traces: list[dict[str, Trace]] | None = None


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
    """Run a coordinator on len(rngs) trials until each has ended; arguments as `skillframe.run.executor.simulate`.

    With one centre of compliance (3,) instead of one per arm, `coordinator` is a skill for one arm, and the others hold
    still. `start.*` displaces the first arm's tool, `fixture.*` the fixture in the second arm's hand.

    Raises:
        SkillframeError: the robot has one arm, or the scene nothing for a second one to hold.
        UnknownName, UnreachablePose: as `simulate`.
    """
    check_quantities(draws, setup.robot)
    if len(setup.robot.tool_frames) < 2 or setup.scene.holder is None:
        raise SkillframeError(
            f"robot {setup.robot.spec.name} in world {setup.scene.name}: a coordinator needs a robot with two arms and "
            "a world whose fixture can be held; take dual_panda and dual_peg"
        )
    with np.errstate(invalid="ignore", over="ignore"):  # as in `simulate`
        if np.ndim(setup.center_of_compliance) == 1:
            coordinator = FirstArm(coordinator)
        loop = _ArmsLoop(coordinator, setup, draws, rngs, trace_hz)
        loop.tare()
        loop.run(duration_s, progress)
        return loop.arms_result()


class FirstArm(Skill):
    """A coordinator that runs a skill for one arm on the first, while the others hold their tools where they are."""

    def __init__(self, skill: Skill) -> None:
        self._skill = skill

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Remember where the tools are, and start the skill."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        count, arms = observation.time.shape
        self._rest = np.zeros((count, arms, 6))
        self._gains = [np.array(np.broadcast_to(gain, (count, arms, 6, 6))) for gain in STILL if gain is not None]
        self._checked = ShapeCheck(self._skill, (count,))
        self._skill.start(_first(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """The skill's command for the first arm, standing still for the others."""
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
    """What the first arm sees, (N, ...)."""
    pose = Pose(observation.pose.position[:, 0], observation.pose.rotation[:, 0])
    return Observation(observation.time[:, 0], observation.dt, pose, observation.twist[:, 0], observation.wrench[:, 0])


def _replaced(arms: Float, first: Float) -> Float:
    """(N, arms, ...) with the first arm's part replaced."""
    result = arms.copy()
    result[:, 0] = first
    return result


class _ArmsLoop(Loop):
    """The executor's loop with a row per trial and arm."""

    def __init__(
        self, skill: Skill, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator], trace_hz: float | None
    ) -> None:
        super().__init__(skill, setup, draws, rngs, trace_hz)
        self.nominal_views = self.nominal.arms() if self.nominal is not self.plant else self.views
        self.path = np.zeros((self.count, self.arms, len(self.views[0].dofs)))
        self.turned = np.zeros((self.count, self.arms, 3))
        self.start_rotation = self._by_arm([view.tool_pose().rotation for view in self.views])

    def _prepare_rows(self) -> None:
        self.views = self.plant.arms()
        self.arms = len(self.views)
        self.names = tuple(arm.name for arm in self.setup.robot.spec.arm)[: self.arms]
        if len({len(view.dofs) for view in self.views}) > 1:
            raise SkillframeError(f"robot {self.setup.robot.spec.name}: its arms differ in their number of joints")
        self.points = np.broadcast_to(np.asarray(self.setup.center_of_compliance, dtype=float), (self.arms, 3))
        self.coc, self.rows = np.tile(self.points, (self.count, 1)), self.count * self.arms

    def _by_arm(self, parts: Sequence[Float]) -> Float:
        """(N, arms, ...) out of one (N, ...) per arm; in C order, or rounding would depend on N."""
        result = np.empty((self.count, self.arms, *parts[0].shape[1:]))
        for arm, part in enumerate(parts):
            result[:, arm] = part
        return result

    def _as_rows(self, parts: Sequence[Float]) -> Float:
        stacked = self._by_arm(parts)
        return stacked.reshape(self.rows, *stacked.shape[2:])

    def _sensors(self, rngs: Sequence[np.random.Generator], draws: Draws) -> _ArmSensors:  # type: ignore[override]
        return _ArmSensors(self, rngs, draws)

    def _recorder(self, every: int) -> _ArmRecorders:  # type: ignore[override]
        return _ArmRecorders(
            [Recorder(view, every, point) for view, point in zip(self.views, self.points, strict=True)]
        )

    def _kinematics(self) -> Kinematics:
        views = self.views
        if self.nominal is not self.plant:
            qpos, qvel = self.plant.state
            self.nominal.set_state(qpos, qvel, self.active)
            views = self.nominal_views
        found = [view.kinematics(point) for view, point in zip(views, self.points, strict=True)]
        return Kinematics(
            Pose(self._as_rows([k.pose.position for k in found]), self._as_rows([k.pose.rotation for k in found])),
            self._as_rows([k.jacobian[..., v.dofs] for k, v in zip(found, views, strict=True)]),
            self._as_rows([k.bias[:, v.dofs] for k, v in zip(found, views, strict=True)]),
            self._as_rows([k.velocity[:, v.dofs] for k, v in zip(found, views, strict=True)]),
        )

    def _mass_matrix(self) -> Float:
        whole = self.nominal.mass_matrix()
        return self._as_rows([whole[:, view.dofs][:, :, view.dofs] for view in self.views])

    def _ask(self, tick: int, observation: Observation) -> Command:
        """Hand the arms' rows to the coordinator as (N, arms, ...), and its command back as rows."""
        shape = (self.count, self.arms)
        seen = Observation(
            observation.time.reshape(shape), observation.dt,
            Pose(observation.pose.position.reshape(*shape, 3), observation.pose.rotation.reshape(*shape, 3, 3)),
            observation.twist.reshape(*shape, 6), observation.wrench.reshape(*shape, 6),
        )  # fmt: skip
        wanted = super()._ask(tick, seen)
        return wanted._replace(
            pose=Pose(wanted.pose.position.reshape(-1, 3), wanted.pose.rotation.reshape(-1, 3, 3)),
            twist=wanted.twist.reshape(-1, 6), feedforward=wanted.feedforward.reshape(-1, 6),
            impedance=self._impedance_rows(wanted.impedance),
        )  # fmt: skip

    def _impedance_rows(self, impedance: Impedance) -> Impedance:
        def rows(gain: Float) -> Float:
            return np.broadcast_to(gain, (self.count, self.arms, 6, 6)).reshape(-1, 6, 6)

        return Impedance(rows(impedance.stiffness), None if impedance.damping is None else rows(impedance.damping))

    def _drive(self, torque: Float) -> None:
        whole = np.zeros((self.count, self.plant.model.nv))
        _, velocity = self.plant.state
        for arm, view in enumerate(self.views):
            whole[:, view.dofs] = torque[arm :: self.arms]
            self.path[self.active, arm] += np.abs(velocity[:, view.dofs])[self.active] * self.dt
        self.plant.step(whole, self.active)

    def _violations(self, position: Float, twist: Float, wrench: Float, law: Float) -> list[Broken]:
        rows = (self.active[:, None] * self.arms + np.arange(self.arms)).ravel()
        found = self.guard.violations(position, twist, wrench, law, rows)
        return [
            Broken(row // self.arms, code, f"arm {self.names[row % self.arms]!r}: {why}") for row, code, why in found
        ]

    def _dofs(self) -> list[NDArray[np.int64]]:
        return [view.dofs for view in self.views]

    def _joint_positions(self) -> Float:
        positions = self.plant.joint_positions
        return self._as_rows([positions[:, view.dofs] for view in self.views])

    def _true_torque(self) -> Float:
        of_arms = [norm(v.contact_wrench(p)[:, 3:]) for v, p in zip(self.views, self.points, strict=True)]
        largest: Float = np.max(of_arms, axis=0)
        return largest

    def _energy(self, rows: NDArray[np.int64]) -> Float:
        energy: Float = self.guard.energy.reshape(self.count, self.arms).sum(-1)[rows]
        return energy

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool, code: Ended = Ended.MACHINE) -> None:
        now = self._by_arm([view.tool_pose().rotation for view in self.views])
        self.turned[rows] = rotation_vector(now @ np.swapaxes(self.start_rotation, -1, -2))[rows]
        super()._end(rows, time, reason, limit, code)

    def arms_result(self) -> ArmsResult:
        """The outcome of every trial, with what each arm did."""
        recorder, self.recorder = self.recorder, None
        plain = self.result()
        traces = None
        if isinstance(recorder, _ArmRecorders):
            metas = [self._meta(i, bool(plain.success[i]), str(plain.failure[i])) for i in range(self.count)]
            traces = [recorder.traces(i, self.names, self.points, meta) for i, meta in enumerate(metas)]
        first = None if traces is None else [by_arm[self.names[0]] for by_arm in traces]
        outcome = {f.name: getattr(plain, f.name) for f in fields(Result)} | {"traces": first}
        return ArmsResult(
            **outcome, arms=self.names, joint_path_rad=self.path,
            turned_rad=self.turned, arm_traces=traces,
        )  # fmt: skip


class _ArmSensors:
    """One set of sensors per arm, read as rows; each arm draws from a generator of its own."""

    def __init__(self, loop: _ArmsLoop, rngs: Sequence[np.random.Generator], draws: Draws) -> None:
        self._loop = loop
        children = [rng.spawn(loop.arms) for rng in rngs]
        self._sensors = [
            Sensors(loop.setup.sensors, view, [trial[arm] for trial in children], draws)
            for arm, view in enumerate(loop.views)
        ]

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """As `Sensors.sample`, for rows."""
        arms = self._loop.arms
        read = [
            sensors.sample(Pose(pose.position[arm::arms], pose.rotation[arm::arms]))
            for arm, sensors in enumerate(self._sensors)
        ]
        rows = self._loop._as_rows
        measured = Pose(rows([p.position for p, _ in read]), rows([p.rotation for p, _ in read]))
        return measured, rows([wrench for _, wrench in read])

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """As `Sensors.set_tare`, for rows."""
        arms = self._loop.arms
        for arm, sensors in enumerate(self._sensors):
            sensors.set_tare(mean[arm::arms], rotation[arm::arms])


class _ArmRecorders:
    """One recorder per arm."""

    def __init__(self, recorders: Sequence[Recorder]) -> None:
        self._recorders = recorders

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        """As `Recorder.record`, for rows."""
        arms = len(self._recorders)
        for arm, recorder in enumerate(self._recorders):
            mine = slice(arm, None, arms)
            seen = Observation(
                observation.time[mine], observation.dt,
                Pose(observation.pose.position[mine], observation.pose.rotation[mine]), observation.twist[mine],
                observation.wrench[mine],
            )  # fmt: skip
            wanted = command._replace(pose=Pose(command.pose.position[mine], command.pose.rotation[mine]))
            recorder.record(tick, time, seen, wanted, law[mine])

    def close(self, rows: NDArray[np.int64]) -> None:
        """As `Recorder.close`, for trials."""
        for recorder in self._recorders:
            recorder.close(rows)

    def traces(self, i: int, names: Sequence[str], points: Float, meta: dict[str, object]) -> dict[str, Trace]:
        """The traces of trial i by arm."""
        return {
            name: recorder.trace(i, {**meta, "arm": name, "center_of_compliance": point.tolist()})
            for name, recorder, point in zip(names, self._recorders, points, strict=True)
        }
