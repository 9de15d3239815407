"""The only loop: N trials of one skill in lock-step, from observation to torque, a thousand times a second.

    sensors -> filter -> Observation -> skill.step -> Command -> impedance -> limits -> torque -> plant

One run is N = 1, a campaign's chunk is N = 32 ... 256, and a trial's result does not depend, to the last bit, on which
others run beside it. The controller knows the nominal robot only: where masses or the grasp differ from trial to trial,
its kinematics and dynamics come from a second, nominal batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.kalman import WrenchFilter
from skillframe.control.controller import ImpedanceController, Reading
from skillframe.control.limits import LimitGuard
from skillframe.frames import Float, Pose
from skillframe.recorder import Recorder
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import Limits
from skillframe.skill import Command, Impedance, Observation, Reasons, Skill, Status, no_reasons
from skillframe.trace import Trace
from skillframe.world.convert import held
from skillframe.world.intrusion import LinkIntrusion
from skillframe.world.placement import QUANTITIES, check_quantities, fixture_poses, start_configurations
from skillframe.world.plant import Draws, Kinematics, Plant
from skillframe.world.rates import ratio
from skillframe.world.scene import Scene, State
from skillframe.world.sensors import TARE_TICKS, Sensors, SensorSettings, at_point

__all__ = ["QUANTITIES", "Result", "Setup", "simulate"]

HOLD = Impedance(np.diag([2000.0] * 3 + [100.0] * 3))
RAMP_S = 0.05
SLOW_TICKS = 10  # goals are looked at every 10 ms


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What does not change between the trials of a batch.

    Attributes:
        robot: the nominal robot.
        scene: the task.
        center_of_compliance: (3,) point of the tool frame that the skill sees and steers; (arms, 3) for several arms.
        sensors: noise of the sensors.
        filter_wrench: False hands the raw wrench to the skill and the limits.
        stop_when: ends a trial as done, looked at every 10 ms; None leaves the end to the skill.
    """

    robot: RobotModel
    scene: Scene
    center_of_compliance: Float = field(default_factory=lambda: np.zeros(3))
    sensors: SensorSettings = field(default_factory=SensorSettings)
    filter_wrench: bool = True
    stop_when: Callable[[State], NDArray[np.bool_]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of N trials; every array has N rows.

    Attributes:
        success: the scene's goal was reached and no limit was broken.
        failure: why not, in words; "" for a success.
        status: of the skill at its end (`Status`).
        reason: why the trial ended, in words.
        duration_s: simulated seconds.
        peak_force_n: largest true contact force.
        final_error_m, final_error_rad: distance to the goal at the end.
        energy_j: work of the controller on the tool.
        traces: one per trial if asked for.
        interrupted: Ctrl-C came before the end; what was running is closed as it stood.
    """

    success: NDArray[np.bool_]
    failure: Reasons
    status: NDArray[np.int64]
    reason: Reasons
    duration_s: Float
    peak_force_n: Float
    final_error_m: Float
    final_error_rad: Float
    energy_j: Float
    traces: list[Trace] | None = None
    interrupted: bool = False


def simulate(
    skill: Skill,
    setup: Setup,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    duration_s: float = 20.0,
    trace_hz: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Run a skill on len(rngs) trials until each has ended.

    Where a second arm holds the scene's fixture, a coordinator runs both arms, and a skill runs the first while the
    second stands still (`skillframe.arms`).

    Args:
        skill: what to run; `start` is called once.
        setup: robot, scene and settings.
        draws: quantities of `QUANTITIES` per trial, each (N,); absent ones are nominal.
        rngs: one generator per trial; sensors and skill draw from children of it.
        duration_s: simulated seconds after which a trial is stopped.
        trace_hz: rate of the traces; None keeps none.
        progress: called every 10 ms of simulated time with the seconds simulated.

    Raises:
        UnknownName: a quantity that nothing reads.
        UnreachablePose: the robot cannot reach a start.
        SkillframeError: rates that do not divide.
    """
    if held(setup.robot, setup.scene) or np.ndim(setup.center_of_compliance) > 1:
        from skillframe.arms import simulate_arms

        return simulate_arms(skill, setup, draws, rngs, duration_s=duration_s, trace_hz=trace_hz, progress=progress)
    check_quantities(draws, setup.robot)
    if setup.robot.spec.actuation:
        from skillframe.machine import simulate_machine

        return simulate_machine(skill, setup, draws, rngs, duration_s=duration_s, trace_hz=trace_hz, progress=progress)
    with np.errstate(invalid="ignore", over="ignore"):  # a diverging trial is the limits' business, not a warning
        loop = Loop(skill, setup, draws, rngs, trace_hz)
        loop.tare()
        loop.run(duration_s, progress)
        return loop.result()


def _joint_limits(robot: RobotModel) -> Limits:
    """The robot's limits; a free-flying tool has no joints whose torque rate could be limited."""
    limits = robot.spec.limits
    return replace(limits, torque_rate_nm_s=None) if robot.spec.base == "free" else limits


class Loop:
    """The state of one batch while it runs.

    What is measured and commanded has a row per trial; `skillframe.arms` runs it with a row per trial and arm.
    """

    def __init__(
        self, skill: Skill, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator], trace_hz: float | None
    ) -> None:
        robot, scene, count = setup.robot, setup.scene, len(rngs)
        self.skill, self.setup, self.count = skill, setup, count
        self.rate = rate = robot.spec.control.rate_hz
        self.dt = 1.0 / rate
        children = [rng.spawn(2) for rng in rngs]
        self.skill_rngs = [pair[1] for pair in children]
        fixture = fixture_poses(robot, draws, count)
        self.plant = Plant(robot, scene, count, fixture, draws, timestep=self.dt)
        varied = any(key.startswith("grasp.") or key in ("robot.mass_scale", "robot.payload") for key in draws)
        self.nominal = Plant(robot, scene, count, fixture, {}, timestep=self.dt) if varied else self.plant
        self.plant.reset(self._configurations(draws))
        self.intrusion = LinkIntrusion(self.plant)
        self._prepare_rows()
        self.sensors = self._sensors([pair[0] for pair in children], draws)
        self.filter = WrenchFilter(dt=self.dt).steady()
        self.controller = ImpedanceController(self.rows)
        self.guard = LimitGuard(_joint_limits(robot), self.rows, self.dt)
        self.active = np.arange(count)
        self.reason, self.status = no_reasons(count), np.zeros(count, dtype=np.int64)
        self.limited = np.zeros(count, dtype=bool)
        self.duration, self.peak = np.zeros(count), np.zeros(count)
        self.goal, self.errors, self.energy = np.zeros(count, dtype=bool), np.zeros((count, 2)), np.zeros(count)
        self.recorder = None if trace_hz is None else self._recorder(ratio(rate, trace_hz, "control", "the trace"))
        self.interrupted = False

    def _configurations(self, draws: Draws) -> Float:
        return start_configurations(self.setup.robot, self.setup.scene, draws, self.count)

    def _prepare_rows(self) -> None:
        self.coc, self.rows = np.asarray(self.setup.center_of_compliance, dtype=float), self.count

    def _sensors(self, rngs: Sequence[np.random.Generator], draws: Draws) -> Sensors:
        return Sensors(self.setup.sensors, self.plant, rngs, draws)

    def _recorder(self, every: int) -> Recorder:
        return Recorder(self.plant, every, self.coc)

    def tare(self) -> None:
        """Hold still before the start, let the readings settle, and take their mean as the sensor's bias."""
        kinematics = self._kinematics()
        hold = Pose(kinematics.pose.position.copy(), kinematics.pose.rotation.copy()).at(self.coc)
        still = np.zeros((self.rows, 6))
        command = Command(hold, still, HOLD, still, self.status, no_reasons(self.rows))
        total = still.copy()
        for _ in range(TARE_TICKS):
            kinematics = self._kinematics()
            pose, wrench = self.sensors.sample(kinematics.pose)
            total += wrench
            torque, _ = self._torque(command, self._reading(kinematics, pose.at(self.coc)), 1.0)
            self._drive(torque)
        self.sensors.set_tare(total / TARE_TICKS, self._kinematics().pose.rotation)

    def run(self, duration_s: float, progress: Callable[[float], None] | None) -> None:
        """Tick until every trial has ended or the time is up."""
        ticks = round(duration_s / self.dt)
        tick = 0
        try:
            for tick in range(ticks):
                self._tick(tick)
                if not len(self.active):
                    return
                if progress is not None and tick % SLOW_TICKS == 0:
                    progress(tick * self.dt)
        except KeyboardInterrupt:
            self.interrupted = True
            self._end(self.active, tick * self.dt, "interrupted", True)
        if len(self.active):
            self._end(self.active, ticks * self.dt, f"time limit: {duration_s:g} s of simulated time are over", False)

    def _tick(self, tick: int) -> None:
        time = tick * self.dt
        kinematics = self._kinematics()
        tool, raw = self.sensors.sample(kinematics.pose)
        wrench = at_point(self._filtered(raw, tick), tool.rotation, self.coc)
        reading = self._reading(kinematics, tool.at(self.coc))
        observation = Observation(np.full(self.rows, time), self.dt, reading.pose, reading.twist, wrench)
        command = self._ask(tick, observation)
        torque, law = self._torque(command, reading, min(1.0, time / RAMP_S))
        np.maximum(self.peak, self.plant.contact_force(), out=self.peak)  # of ended trials it no longer changes
        if self.recorder is not None:
            self.recorder.record(tick, time, observation, command, law)
        self._stop_where_due(tick, time, observation, command, tool.position, law)
        if len(self.active):
            self._drive(torque)

    def _ask(self, tick: int, observation: Observation) -> Command:
        if tick == 0:
            self.skill.start(observation, self.skill_rngs)
        return self.skill.step(observation)

    def _drive(self, torque: Float) -> None:
        self.plant.step(torque, self.active)

    def _filtered(self, raw: Float, tick: int) -> Float:
        if not self.setup.filter_wrench:
            return raw
        if tick == 0:
            self.filter.start(raw * 0.0)
        return self.filter.step(raw)

    def _kinematics(self) -> Kinematics:
        if self.nominal is not self.plant:
            qpos, qvel = self.plant.state
            self.nominal.set_state(qpos, qvel, self.active)
        return self.nominal.kinematics(self.coc)

    def _reading(self, kinematics: Kinematics, measured: Pose) -> Reading:
        twist = (kinematics.jacobian @ kinematics.velocity[..., None])[..., 0]
        return Reading(measured, twist, kinematics.jacobian, kinematics.bias, kinematics.velocity, self._mass_matrix)

    def _mass_matrix(self) -> Float:
        return self.nominal.mass_matrix()

    def _torque(self, command: Command, reading: Reading, ramp: float) -> tuple[Float, Float]:
        """Generalised forces (N, nv), held to the torque rate, and the law's wrench (N, 6)."""
        torque, law = self.controller.torque(command, reading, ramp)
        return self.guard.rate_limited(torque), law

    def _stop_where_due(
        self, tick: int, time: float, observation: Observation, command: Command, position: Float, law: Float
    ) -> None:
        twist, wrench = observation.twist, observation.wrench
        for i, cause in self._violations(position, twist, wrench, law):
            self._end(np.array([i]), time, f"{cause} (at {time:.3f} s)", True)
        if tick % SLOW_TICKS == 0 and len(self.active):
            for i, cause in self.intrusion.causes(self.plant, self.active):
                self._end(np.array([i]), time, f"{cause} (at {time:.3f} s)", True)
        if command.status.any():
            for i in self.active[command.status[self.active] != Status.RUNNING]:
                self.status[i] = command.status[i]
                self._end(np.array([i]), time, str(command.reason[i]) or "the skill ended", False)
        if self.setup.stop_when is not None and tick % SLOW_TICKS == 0 and len(self.active):
            done = self.setup.stop_when(self.plant.tip_state())
            rows = self.active[done[self.active]]
            self.status[rows] = Status.SUCCESS
            self._end(rows, time, "done", False)

    def _violations(self, position: Float, twist: Float, wrench: Float, law: Float) -> list[tuple[int, str]]:
        """Trials that broke a limit, each with the cause in words."""
        return self.guard.violations(position, twist, wrench, law, self.active)

    def _energy(self, rows: NDArray[np.int64]) -> Float:
        return self.guard.energy[rows]

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool) -> None:
        """Close trials: judge them by the scene's goal as they stand now, and stop stepping them."""
        if not len(rows):
            return
        state = self.plant.tip_state()
        self.goal[rows] = self.setup.scene.goal(state)[rows]
        self.errors[rows] = np.stack(self.setup.scene.goal_error(state), axis=-1)[rows]
        self.energy[rows] = self._energy(rows)
        self.duration[rows], self.limited[rows] = time, limit
        if limit:
            self.status[rows] = Status.FAILURE
        for i in rows:
            self.reason[i] = reason
        self.active = np.setdiff1d(self.active, rows)
        if self.recorder is not None:
            self.recorder.close(rows)

    def result(self) -> Result:
        """The outcome of every trial."""
        success = self.goal & ~self.limited & (self.status != Status.FAILURE)
        failure = no_reasons(self.count)
        for i in np.flatnonzero(~success):
            failure[i] = self.reason[i] if self.limited[i] else f"goal not reached: {self.reason[i]}"
        traces = None
        if self.recorder is not None:
            traces = [
                self.recorder.trace(i, self._meta(i, bool(success[i]), str(failure[i]))) for i in range(self.count)
            ]
        return Result(
            success=success, failure=failure, status=self.status, reason=self.reason, duration_s=self.duration,
            peak_force_n=self.peak, final_error_m=self.errors[:, 0], final_error_rad=self.errors[:, 1],
            energy_j=self.energy, traces=traces, interrupted=self.interrupted,
        )  # fmt: skip

    def _meta(self, i: int, success: bool, failure: str) -> dict[str, Any]:
        scene = self.setup.scene
        return {
            "robot": self.setup.robot.spec.name, "world": scene.name, "params": scene.params,
            "center_of_compliance": self.coc.tolist(), "frames": {k: list(v) for k, v in scene.tool.frames.items()},
            "hand": scene.tool.hand, "success": success, "failure": failure, "reason": str(self.reason[i]),
            "status": Status(int(self.status[i])).name, "duration_s": float(self.duration[i]),
            "peak_force_n": float(self.peak[i]), "final_error_m": float(self.errors[i, 0]),
            "final_error_rad": float(self.errors[i, 1]), "analytic": scene.analytic,
            "events": [[time, text] for time, text in self.skill.journal(i)],
            "limits": asdict(_joint_limits(self.setup.robot)),
        }  # fmt: skip
