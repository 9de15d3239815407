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

from skillframe.control.contact import TrueContact, over
from skillframe.control.controller import ImpedanceController, Reading
from skillframe.control.endings import Broken, Ended
from skillframe.control.limits import LimitGuard
from skillframe.control.motors import Motors, joint_limits
from skillframe.frames import Float, Pose, norm
from skillframe.handover import SLOW_TICKS, CommandCheck, Fault, asked, shown, unknown_end
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import Limits
from skillframe.run.recorder import Recorder
from skillframe.run.result import Result
from skillframe.signals.kalman import WrenchFilter
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.world.convert import held
from skillframe.world.intrusion import LinkIntrusion
from skillframe.world.placement import check_quantities, fixture_poses, start_configurations
from skillframe.world.plant import Draws, Kinematics, Plant
from skillframe.world.quantities import QUANTITIES
from skillframe.world.rates import ratio
from skillframe.world.scene import Scene, State
from skillframe.world.sensors import TARE_TICKS, Sensors, SensorSettings, at_point

__all__ = ["QUANTITIES", "Result", "Setup", "simulate"]

HOLD = Impedance(np.diag([2000.0] * 3 + [100.0] * 3))
RAMP_S = 0.05


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
    second stands still (`skillframe.run.arms`).

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
        from skillframe.run.arms import simulate_arms

        return simulate_arms(skill, setup, draws, rngs, duration_s=duration_s, trace_hz=trace_hz, progress=progress)
    check_quantities(draws, setup.robot)
    if setup.robot.spec.actuation:
        from skillframe.run.machine import simulate_machine

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

    What is measured and commanded has a row per trial; `skillframe.run.arms` runs it with a row per trial and arm.
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
        self.motors = self._motors()
        self.guard = LimitGuard(_joint_limits(robot), self.rows, self.dt, self.motors)
        self.contact = TrueContact(robot.spec.limits, count, self.dt)
        self.faults: list[Fault] = []
        self.active = np.arange(count)
        self.reason, self.status = no_reasons(count), np.zeros(count, dtype=np.int64)
        self.limited = np.zeros(count, dtype=bool)
        self.duration, self.ended_by = np.zeros(count), no_reasons(count)
        self.filtered, self.torque_share, self.speed_share, self.way = (np.full(count, np.nan) for _ in range(4))
        self.goal, self.errors, self.energy = np.zeros(count, dtype=bool), np.zeros((count, 2)), np.zeros(count)
        self.recorder = None if trace_hz is None else self._recorder(ratio(rate, trace_hz, "control", "the trace"))
        self.interrupted = False

    def _configurations(self, draws: Draws) -> Float:
        return start_configurations(self.setup.robot, self.setup.scene, draws, self.count)

    def _prepare_rows(self) -> None:
        self.coc, self.rows = np.asarray(self.setup.center_of_compliance, dtype=float), self.count

    def _sensors(self, rngs: Sequence[np.random.Generator], draws: Draws) -> Sensors:
        return Sensors(self.setup.sensors, self.plant, rngs, draws)

    def _motors(self) -> Motors | None:
        """Of the joints; cylinders have a law of their own, and a free-flying tool has none."""
        robot, arms = self.setup.robot, self._dofs()
        if robot.spec.actuation or not (limits := joint_limits(robot, self.plant.model, arms)):
            return None
        return Motors(limits, _joint_limits(robot).torque_rate_nm_s, self.rows, self.dt)

    def _dofs(self) -> list[NDArray[np.int64]] | None:
        """Generalised velocities of each arm's rows; None where a row has them all."""
        return None

    def _joint_positions(self) -> Float:
        return self.plant.joint_positions

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
            self._end(self.active, tick * self.dt, "interrupted", True, Ended.INTERRUPTED)
        if len(self.active):
            self._end_broken(self.contact.look(self.active), ticks * self.dt)
            text = f"time limit: {duration_s:g} s of simulated time are over"
            self._end(self.active, ticks * self.dt, text, False, Ended.TIME)

    def _tick(self, tick: int) -> None:
        time = tick * self.dt
        kinematics = self._kinematics()
        tool, raw = self.sensors.sample(kinematics.pose)
        wrench = at_point(self._filtered(raw, tick), tool.rotation, self.coc)
        reading = self._reading(kinematics, tool.at(self.coc))
        observation = Observation(np.full(self.rows, time), self.dt, reading.pose, reading.twist, wrench)
        command = self._ask(tick, observation)
        torque, law = self._torque(command, reading, min(1.0, time / RAMP_S))
        self._feel(wrench)
        if self.recorder is not None:
            self.recorder.record(tick, time, observation, command, law)
        self._stop_where_due(tick, time, observation, command, tool.position, law)
        if len(self.active):
            self._drive(torque)

    def _ask(self, tick: int, observation: Observation) -> Command:
        seen = shown(observation)
        if tick == 0:
            self.check = CommandCheck(self.skill, observation.time.shape)
            asked(self.skill, self.skill.start, seen, self.skill_rngs)
        command = asked(self.skill, self.skill.step, seen)
        self.faults = self.check.faults(command, tick)
        return command

    def _feel(self, wrench: Float) -> None:
        """Take in the true contact of a tick, and the filtered wrench (N, 6) beside it."""
        torque = self._true_torque() if self.contact.wants_torque else None
        self.contact.step(self.plant.contact_force(), wrench, torque)

    def _true_torque(self) -> Float:
        return norm(self.plant.contact_wrench(self.coc)[:, 3:])

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
        """Generalised forces (N, nv) that the motors give, and the law's wrench (N, 6)."""
        torque, law = self.controller.torque(command, reading, ramp)
        if self.motors is not None:
            torque = self.motors.held(torque, reading.velocity, self._joint_positions())
        return torque, law

    def _stop_where_due(
        self, tick: int, time: float, observation: Observation, command: Command, position: Float, law: Float
    ) -> None:
        slow, ending = tick % SLOW_TICKS == 0, np.count_nonzero(command.status)
        self._end_broken([Broken(row, Ended.COMMAND, cause) for row, cause in self.faults], time)
        broken = self._violations(position, observation.twist, observation.wrench, law)
        if broken or slow or ending:
            self._end_broken([*broken, *self.contact.look(self.active)], time)
        if slow and len(self.active):
            touched = self.intrusion.causes(self.plant, self.active)
            self._end_broken([Broken(row, Ended.COLLISION, cause) for row, cause in touched], time)
        if ending:
            for i in self.active[command.status[self.active] != Status.RUNNING]:
                self._end_told(int(i), time, int(command.status[i]), command.reason[i])
        if self.setup.stop_when is not None and slow and len(self.active):
            done = self.setup.stop_when(self.plant.tip_state())
            rows = self.active[done[self.active]]
            self.status[rows] = Status.SUCCESS
            self._end(rows, time, "done", False, Ended.GOAL)

    def _end_broken(self, broken: Sequence[Broken], time: float) -> None:
        """End the trials that broke something, each for the first thing that is named."""
        for row, code, cause in broken:
            if row in self.active:
                self._end(np.array([row]), time, f"{cause} (at {time:.3f} s)", True, code)

    def _end_told(self, i: int, time: float, status: int, reason: object) -> None:
        """End trial i as its skill says."""
        if wrong := unknown_end(status, reason):
            self._end_broken([Broken(i, Ended.COMMAND, wrong)], time)
            return
        self.status[i] = status
        self._end(np.array([i]), time, str(reason) or "the skill ended", False, Ended.SKILL)

    def _violations(self, position: Float, twist: Float, wrench: Float, law: Float) -> list[Broken]:
        """Trials that broke a limit, each with the cause in words."""
        return self.guard.violations(position, twist, wrench, law, self.active)

    def _shares(self) -> tuple[Float, Float]:
        """(N,) of each trial's worst joint: torque over effort, speed over velocity."""
        if self.motors is None:
            return (np.full(self.count, np.nan),) * 2
        torque, speed = (share.reshape(self.count, -1).max(axis=-1) for share in self.motors.shares())
        return torque, speed

    def _energy(self, rows: NDArray[np.int64]) -> Float:
        return self.guard.energy[rows]

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool, code: Ended = Ended.MACHINE) -> None:
        """Close trials: judge them by the scene's goal as they stand now, and stop stepping them."""
        if not len(rows):
            return
        state = self.plant.tip_state()
        self.goal[rows] = self.setup.scene.goal(state)[rows]
        self.errors[rows] = np.stack(self.setup.scene.goal_error(state), axis=-1)[rows]
        if self.setup.scene.way is not None:
            self.way[rows] = self.setup.scene.way.reached(state)[rows]
        self.energy[rows] = self._energy(rows)
        self.duration[rows], self.limited[rows] = time, limit
        torque_share, speed_share = self._shares()
        self.torque_share[rows], self.speed_share[rows] = torque_share[rows], speed_share[rows]
        self.filtered[rows] = self.contact.estimate[rows]
        if limit:
            self.status[rows] = Status.FAILURE
        for i in rows:
            self.reason[i], self.ended_by[i] = reason, code.value
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
            peak_force_n=self.contact.peak, final_error_m=self.errors[:, 0], final_error_rad=self.errors[:, 1],
            energy_j=self.energy, peak_force_filtered_n=self.filtered, peak_force_10ms_n=self.contact.mean,
            peak_torque_share=self.torque_share, peak_speed_share=self.speed_share, ended_by=self.ended_by,
            traces=traces, interrupted=self.interrupted,
        )  # fmt: skip

    def _notes(self, i: int, success: bool) -> list[str]:
        """Sentences about what a result holds and leaves out."""
        mark = over(float(self.contact.peak[i]), self.setup.robot.spec.limits.force_n) if success else ""
        silent = "" if self.motors is None else self.motors.silent()
        return [text for text in (silent, mark) if text]

    def _meta(self, i: int, success: bool, failure: str) -> dict[str, Any]:
        scene = self.setup.scene
        return {
            "robot": self.setup.robot.spec.name, "world": scene.name, "params": scene.params,
            "center_of_compliance": self.coc.tolist(), "frames": {k: list(v) for k, v in scene.tool.frames.items()},
            "hand": scene.tool.hand, "success": success, "failure": failure, "reason": str(self.reason[i]),
            "status": Status(int(self.status[i])).name, "duration_s": float(self.duration[i]),
            "peak_force_n": float(self.contact.peak[i]), "peak_force_filtered_n": float(self.filtered[i]),
            "peak_force_10ms_n": float(self.contact.mean[i]), "peak_torque_share": _known(self.torque_share[i]),
            "peak_speed_share": _known(self.speed_share[i]), "ended_by": self.ended_by[i],
            "notes": self._notes(i, success), "final_error_m": float(self.errors[i, 0]),
            "final_error_rad": float(self.errors[i, 1]), "analytic": scene.analytic,
            "progress": None if scene.way is None else scene.way.told(_known(self.way[i])),
            "events": [[time, text] for time, text in self.skill.journal(i)],
            "limits": asdict(_joint_limits(self.setup.robot)),
        }  # fmt: skip


def _known(figure: float) -> float | None:
    """A figure for a file; None where there is none."""
    return None if np.isnan(figure) else float(figure)
