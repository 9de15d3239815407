"""Hydraulic machines in the one loop: the executor's tick, with cylinders as co-simulated FMUs between law and plant.

    encoders, pressures -> filters -> force estimate -> Observation -> skill.step -> Command
        -> hydraulic law -> valve commands -> FMUs and plant, coupled by `cosim`

Before the skill starts the machine swings in the air for some seconds, an explicit step in which friction and payload
are identified; from then on they are held. There is no force sensor: what the skill sees as wrench is the estimate from
chamber pressures, and the pose is that of the filtered encoders. The machine moves its tool in a plane; the attitude of
the tool follows from its joints and is not commanded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Ended
from skillframe.cosim.coupling import coupling_numbers, require_stable
from skillframe.cosim.master import CosimSettings, Master
from skillframe.errors import InputError
from skillframe.frames import Float, Pose
from skillframe.machine.checks.feasibility import require_feasible
from skillframe.machine.checks.holding import require_held
from skillframe.machine.columns import EnergyBill, columns, supply_pressures
from skillframe.machine.coupled import CoupledPlant
from skillframe.machine.cylinder.bank import banks, instance_parameters
from skillframe.machine.force.calibration import CALIBRATION_S, SETTLE_S, hold_what_was_found, swing
from skillframe.machine.force.compiled import CompiledEstimator
from skillframe.machine.force.findings import findings
from skillframe.machine.force.load import BelievedLoad
from skillframe.machine.force.momentum import Estimate, ForceSettings
from skillframe.machine.force.residual_noise import residual_noise
from skillframe.machine.force.valve import ValveIdentification, ValveSettings
from skillframe.machine.law.hydraulic import Demand, HydraulicGains, Measured, Reference, plane_task
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.law.vdc_actuator import cylinders
from skillframe.machine.sensors import MachineSensors
from skillframe.robot.chain import ClosedChain
from skillframe.robot.driven import fast_filters
from skillframe.run.executor import RAMP_S, Loop, Result, Setup
from skillframe.run.recorder import Recorder
from skillframe.signals.delay import CommandDelay
from skillframe.skill import Command, Observation, Skill
from skillframe.world.placement import check_quantities, start_poses
from skillframe.world.plant import Draws, Kinematics

__all__ = ["MachineLoop", "simulate_machine"]

IMPEDANCE_RATE, LEAST_DAMPING = 2.0, 5e4  # 1/s and N s/m; D where a skill leaves it open, from teleoperation trials
VALVES_S = 0.5
"""So often the swing's rows are fitted again for overlap and supply pressure of the valves (ours)."""
AT_STOP, WILD = 0.99, 0.5
"""Opening of a valve at its stop, and the share of the swing for which one may be (ours; at 150 bar and with friction
by a third too large it is 0.18, of a sound crane 0, and of one whose gains are ten times too large 0.97)."""
RESIDUAL_LIMIT, RESIDUAL_ENERGY, RESIDUAL_TICKS = 1e-2, 200.0, 100
"""Relative bond residual that ends a trial, once so many joules were exchanged; looked at every 100 ticks."""


def simulate_machine(
    skill: Skill,
    setup: Setup,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    duration_s: float = 20.0,
    trace_hz: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Run a skill on a hydraulic machine, len(rngs) trials; arguments as `skillframe.run.executor.simulate`.

    Raises:
        InputError: the machine cannot stand at a start, or a skill steers another point than the tool frame's origin.
        StepTooLarge: the control rate is too low for the load on a cylinder.
        UnknownName, SkillframeError: as `simulate`.
    """
    check_quantities(draws)
    if np.any(np.abs(setup.center_of_compliance) > 1e-9):
        raise InputError(
            f"robot {setup.robot.spec.name}", "a hydraulic machine steers the origin of its tool frame",
            "set the centre of compliance to 0 0 0",
        )  # fmt: skip
    with np.errstate(invalid="ignore", over="ignore"):  # as in `simulate`
        loop = MachineLoop(skill, setup, draws, rngs, trace_hz)
        loop.tare()
        loop.run(duration_s, progress)
        return loop.result()


class MachineLoop(Loop):
    """The executor's loop for N hydraulic machines in lock-step."""

    def __init__(
        self, skill: Skill, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator], trace_hz: float | None
    ) -> None:
        self.chain = ClosedChain(setup.robot)
        self.task = plane_task(self.chain)
        first, second = self.task.axes
        self._plane = slice(first, second + 1, second - first)
        super().__init__(skill, setup, draws, rngs, trace_hz)
        spec = setup.robot.spec
        known = cylinders(spec.actuation, spec.folder / "robot.toml")
        corner, estimate = spec.sensors.corner_hz, ForceSettings()
        noise = residual_noise(self.chain, known, spec.sensors, estimate.corner, self.dt)
        estimate = replace(estimate, sensor_corner=corner, row_noise=tuple(noise.tolist()))
        self.law = CompiledLaw(self.chain, known, HydraulicGains.of(spec), self.count, self.dt)
        self.estimator = CompiledEstimator(self.chain, known, self.count, self.dt, estimate)
        self.valves = ValveIdentification(known, self.count, self.dt, ValveSettings(corner=corner))
        self.coupled = CoupledPlant(self.plant, self.chain.actuated)
        self.bank = banks(spec, self.count)
        self.master = Master(self.coupled, self.bank, CosimSettings(step=self.dt))
        self._pressures = [self.bank.outputs.index(f"pressure_{side}") for side in "ab"]
        self._z = [int(self.plant.model.joint(name).qposadr[0]) for name in self.chain.independent]
        late = np.asarray(draws.get("actuator.delay", np.zeros(self.count)))
        self._delay = CommandDelay(np.round(late / self.dt).astype(np.int64), len(known.area_a))
        self.findings: list[list[str]] = [[] for _ in rngs]
        self._start(draws)

    def _configurations(self, draws: Draws) -> Float:
        """Closed configurations (N, nq) with the tool's point at its start, the other joints as at home."""
        robot, axes = self.setup.robot, self.task.axes
        across = f"start.offset_{'xyz'[({0, 1, 2} - set(axes)).pop()]}"
        if np.any(draws.get(across, 0.0)):
            raise InputError(across, f"{robot.spec.name} moves its tool in a plane, and not across it", "leave it out")
        home = self.chain.minimal(robot.home)
        points = start_poses(robot, self.setup.scene, draws, self.count).position[:, axes]
        rows = []
        for point in points:
            z = self.task.solve(self.chain, np.concatenate([point, home[2:]]), home)
            require_feasible(self.chain, z)
            rows.append(self.chain.configuration(z))
        return np.array(rows)

    def _sensors(self, rngs: Sequence[np.random.Generator], draws: Draws) -> Any:
        n, k = len(self.chain.independent), len(self.chain.actuated)
        self.gauges = MachineSensors(self.setup.robot.spec.sensors, rngs, n, k, self.dt)
        return self.gauges

    def _start(self, draws: Draws) -> None:
        """FMUs in equilibrium with the load, the step judged against it, sensors and law at rest."""
        z = self._true_z()
        hold = self._holding_force(z, draws)
        own = instance_parameters(self.setup.robot.spec, draws, hold)
        supply = supply_pressures(own, self.law.cylinders.supply_pressure, self.count)
        require_held(self.setup.robot.spec.actuation, hold, supply, f"robot {self.setup.robot.spec.name}")
        self.master.start(0.0, 0.0, own)
        self._require_pressures()
        self.bill = EnergyBill(self.bank, supply, self.dt)
        if all(self.bank.capabilities(i).rollback for i in range(len(self.chain.actuated))):
            numbers = coupling_numbers(self.bank, self.coupled.effective_mass(), self.dt)
            require_stable(numbers, self.dt, self.chain.actuated)
        spec = self.setup.robot.spec
        for problem, fix in fast_filters(spec.sensors, spec.gains, spec.control.rate_hz):
            raise InputError(f"robot {spec.name}", problem, fix)
        self.gauges.start(z, *self._true_pressures())
        self.law.start()
        self.load = BelievedLoad(self.law, draws, self.count)
        self.home = self.plant.tool_pose().position[:, self.task.axes].copy()
        self.joint = z[:, 2:].copy()
        nothing = np.zeros((self.count, 2))
        self.estimate = Estimate(nothing, nothing, np.zeros(self.count, dtype=bool), nothing, nothing)
        self.demand = Demand(*(np.zeros((self.count, len(self.chain.actuated))) for _ in range(3)))
        self.estimator.start(self._measured())
        self._end_failed(0.0)

    def _holding_force(self, z: Float, draws: Draws) -> Float:
        """(N, k) piston forces that balance the gravity of each trial's own masses at rest."""
        scale = np.asarray(draws.get("robot.mass_scale", np.ones(self.count)))
        states = [self.chain.at(row, np.zeros(len(row))) for row in z]
        hold = np.array([state.holding_force() for state in states])
        payload = self.setup.robot.spec.payload
        if payload is not None and "robot.payload" in draws:
            more = (draws["robot.payload"] - payload.mass)[:, None] * self.chain.load_gravity(z)
            hold += [np.linalg.solve(state.arms.T, row) for state, row in zip(states, more, strict=True)]
        return np.asarray(scale[:, None] * hold)

    def _true_z(self) -> Float:
        z: Float = self.plant.state[0].take(self._z, axis=1)
        return z

    def _true_pressures(self) -> tuple[Float, Float]:
        a, b = (self.bank.y[:, column].reshape(self.count, -1) for column in self._pressures)
        return a, b

    def _require_pressures(self) -> None:
        for side, pressure in zip("ab", self._true_pressures(), strict=True):
            running = self.bank.active.reshape(pressure.shape).astype(bool)
            for trial, k in np.argwhere(running & ~np.isfinite(pressure))[:1]:
                where = f"robot {self.setup.robot.spec.name}, {self.chain.actuated[k]}"
                text = f"its FMU gives no pressure_{side}, from which the force is estimated (trial {trial})"
                raise InputError(where, text, "map it under outputs of its [[actuation]]")

    def _measured(self) -> Measured:
        gauges = self.gauges
        return Measured(gauges.z, gauges.rate, *gauges.pressures, self.estimate.answered, self.estimate.sigma)

    def tare(self) -> None:
        """Swing in the air and identify friction and payload, then hold what was found."""
        self.estimator.calibrate(True)
        stopped = np.zeros(self.count)
        for tick in range(round((CALIBRATION_S + SETTLE_S) / self.dt)):
            position, velocity, joint, joint_rate = swing(tick * self.dt)
            stiff = LEAST_DAMPING * np.broadcast_to(np.eye(2), (self.count, 2, 2))
            zero = np.zeros((self.count, 2))
            self._sample()
            if tick == 0:
                self._weigh()
            self._estimate(force_counts=False)
            self._look_at_valves(tick)
            self._valve(
                Reference(
                    self.home + position, zero + velocity, 6.0 * stiff, stiff, zero, self.joint + joint,
                    np.zeros_like(self.joint) + joint_rate,
                )
            )  # fmt: skip
            self._drive(self.demand.valve)
            stopped += np.abs(self.demand.valve).max(axis=1) > AT_STOP
            if not len(self.active):
                break
        self._end_wild(stopped / (tick + 1))
        self.estimator.calibrate(False)
        hold_what_was_found(self.law, self.estimator.identification)
        self.findings = findings(self.law, self.load, self.estimator.identification, self.valves)
        self.bill.start()

    def _end_wild(self, share: Float) -> None:
        """End the trials whose valves were at their stops for such shares (N,) of the swing: nothing was identified."""
        for i in self.active[share[self.active] > WILD]:
            text = f"it swings by itself in the air, its valves at their stops for {share[i]:.0%} of the time"
            self._end(np.array([i]), 0.0, f"{text}; lower gains.body, velocity_gain or force_gain in robot.toml", True)

    def _look_at_valves(self, tick: int) -> None:
        """Identify them, and let the law go by what is known so far: what it learns of inertias depends on it."""
        self.valves.step(self.demand.valve, self._seen, self.terms)
        if tick and tick % round(VALVES_S / self.dt) == 0:
            self.valves.solve()
            self.law.deadband[:], self.law.supply[:] = self.valves.compensated, self.valves.supply

    def _sample(self) -> None:
        """Read the sensors, and the model's terms where the machine then is."""
        self.gauges.sample(self._true_z(), *self._true_pressures())
        self._seen = self._measured()
        self.terms = self.law.terms(self._seen)

    def _weigh(self) -> None:
        """At rest, before the swing: go by the load that the pressures hold if it cannot be what was told."""
        if self.load.weigh(self._seen, self.terms):
            self.terms = self.law.terms(self._seen)

    def _estimate(self, force_counts: bool = True) -> None:
        """The force from what was sampled; in the air it is known to be zero."""
        estimate = self.estimator.step(self._seen, self.terms)
        nothing = np.zeros_like(estimate.force)
        self.estimate = (
            estimate if force_counts else estimate._replace(sigma=nothing, feedback=nothing, answered=nothing)
        )

    def _valve(self, reference: Reference) -> None:
        measured = self._seen._replace(z=self.gauges.now, force=self.estimate.answered, sigma=self.estimate.sigma)
        self.demand = self.law.step(measured, reference, self.active)

    def _tick(self, tick: int) -> None:
        time = tick * self.dt
        self._sample()
        self._estimate()
        observation = self._observe(time)
        command = self._ask(tick, observation)
        reference, law = self._reference(command, observation, min(1.0, time / RAMP_S))
        self._valve(reference)
        self._feel(observation.wrench)
        if self.recorder is not None:
            due = self.recorder.due(tick)
            seen, machine = (self._read(observation), self._columns()) if due else (observation, None)
            self.recorder.record(tick, time, seen, command, law, machine)
        self._stop_where_due(tick, time, observation, command, observation.pose.position, law)
        if tick % RESIDUAL_TICKS == 0:
            self._watch_bonds(time)
        if len(self.active):
            self._drive(self.demand.valve, time)

    def _observe(self, time: float) -> Observation:
        """Pose and twist as the encoders say, wrench as the pressures say."""
        tool, plane = self.plant.tool_pose(), self._plane
        position = tool.position.copy()
        position[:, plane] = self.terms.tip + self.gauges.lag * self.terms.tip_rate
        twist, wrench = np.zeros((self.count, 6)), np.zeros((self.count, 6))
        twist[:, plane], wrench[:, plane] = self.terms.tip_rate, self.estimate.feedback
        return Observation(np.full(self.count, time), self.dt, Pose(position, tool.rotation.copy()), twist, wrench)

    def _read(self, observation: Observation) -> Observation:
        """The same with the force as it is now, for the record; a skill that answers the force sees it late."""
        wrench = observation.wrench.copy()
        wrench[:, self.task.axes] = self.estimate.force
        return observation._replace(wrench=wrench)

    def _reference(self, command: Command, seen: Observation, ramp: float) -> tuple[Reference, Float]:
        """What the law follows, and equation (1)'s wrench (N, 6) for limits and trace."""
        plane, count = self._plane, self.count
        stiffness = self._in_plane(command.impedance.stiffness)
        if command.impedance.damping is None:
            largest = np.linalg.eigvalsh(stiffness)[..., -1]
            damping = np.maximum(largest / IMPEDANCE_RATE, LEAST_DAMPING)[..., None, None] * np.eye(2)
        else:
            damping = self._in_plane(command.impedance.damping)
        velocity, push = ramp * command.twist[:, plane], ramp * command.feedforward[:, plane]
        law = np.zeros((count, 6))
        error = (command.pose.position - seen.pose.position)[:, plane]
        law[:, plane] = push + _times(stiffness, error) + _times(damping, velocity - seen.twist[:, plane])
        return Reference(
            command.pose.position[:, plane], velocity, stiffness, damping, push, self.joint, np.zeros_like(self.joint)
        ), law  # fmt: skip

    def _in_plane(self, matrix: Float) -> Float:
        """(N, 2, 2) of (N, 6, 6), or (2, 2) of one (6, 6) for all, which spreads where it is used."""
        part: Float = matrix[..., self._plane, self._plane]
        return part

    def _drive(self, torque: Float, time: float = 0.0) -> None:
        """One coupled step under valve commands (N, k); trials whose FMU failed end with its sentence."""
        self.coupled.active = self.active
        self.bill.step(self.coupled.velocity)
        if not self.master.step(self._delay.step(torque).ravel()):
            self._end_failed(time)

    def _end_failed(self, time: float) -> None:
        """End the trials of which an FMU has failed."""
        k = len(self.chain.actuated)
        for index in range(self.bank.count):
            trial = index // k
            if trial in self.active and (problem := self.bank.problem(index)):
                self._end(np.array([trial]), time, problem, True)

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool, code: Ended = Ended.MACHINE) -> None:
        super()._end(rows, time, reason, limit, code)
        self.bank.active[(rows[:, None] * len(self.chain.actuated) + np.arange(len(self.chain.actuated))).ravel()] = 0

    def _watch_bonds(self, time: float) -> None:
        enough = self.master.exchanged > RESIDUAL_ENERGY
        bad = (enough & (self.master.residual > RESIDUAL_LIMIT)).reshape(self.count, -1)
        for trial in [int(i) for i in self.active if bad[i].any()]:
            bond = int(np.argmax(bad[trial]))
            value = self.master.residual.reshape(self.count, -1)[trial, bond]
            name = self.chain.actuated[bond]
            text = (
                f"co-simulation of {name}: bond residual {value:.2g} is above {RESIDUAL_LIMIT:g}; take a smaller step"
            )
            self._end(np.array([trial]), time, f"{text} (at {time:.3f} s)", True)

    def _recorder(self, every: int) -> Recorder:
        return Recorder(self.plant, every, self.coc, machine=columns(len(self.chain.actuated)))

    def _columns(self) -> dict[str, Float]:
        pressure_a, pressure_b = self.gauges.pressures
        return {
            "pressure_a": pressure_a, "pressure_b": pressure_b, "valve": self.demand.valve,
            "piston_force": self.demand.present - self.estimator.friction(self.terms),
            "piston_force_true": self.master.force.reshape(self.count, -1), "force_sigma": self.estimate.sigma,
            "force_valid": self.estimate.valid.astype(float),
            "energy_supply": self.bill.supply, "energy_pistons": self.bill.pistons,
        }  # fmt: skip

    def _meta(self, i: int, success: bool, failure: str) -> dict[str, Any]:
        meta = super()._meta(i, success, failure)
        notes = [*meta["notes"], *self.law.notes, *self.bank.notes, *self.findings[i]]
        return {**meta, "actuators": list(self.chain.actuated), "notes": notes}

    def _kinematics(self) -> Kinematics:
        return self.plant.kinematics(self.coc)


def _times(matrix: Float, vector: Float) -> Float:
    result: Float = (matrix @ vector[..., None])[..., 0]
    return result
