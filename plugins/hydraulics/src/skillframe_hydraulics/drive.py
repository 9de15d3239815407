"""Drive of hydraulic machines, with cylinders as co-simulated FMUs.

    encoders, pressures -> filters -> force estimate -> Observation -> skill.step -> Command
        -> hydraulic controller -> valve commands -> FMUs and plant, coupled by `cosim`

Before the skill starts, the machine swings in the air for some seconds to identify friction and payload. The skill's
wrench is the estimate from chamber pressures, its pose that of the filtered encoders. The tool moves in a plane or in
space; its orientation follows from the joints and is not commanded.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from skillframe.control import LimitGuard
from skillframe.errors import InputError
from skillframe.execution import Actuated, Recorder, Result, Setup, Shares, Trials, WithColumns
from skillframe.fmu import unmapped
from skillframe.frames import Float, norm
from skillframe.robot import ClosedChain
from skillframe.signals import CommandDelay
from skillframe.skill import Broken, Command, Ended, Observation
from skillframe.world import Draws, Plant, Scene, fixture_poses, start_poses
from skillframe_hydraulics.checks.feasibility import areas, require_feasible, require_held
from skillframe_hydraulics.checks.figures import CYLINDER
from skillframe_hydraulics.checks.pumps import swing_part, unfit_pumps
from skillframe_hydraulics.checks.start import require_start
from skillframe_hydraulics.columns import EnergyBill, columns
from skillframe_hydraulics.cylinder.bank import banks, foreign_specs, instance_parameters
from skillframe_hydraulics.declared import fast_filters, gains_of, noise_of, supplies_of
from skillframe_hydraulics.drive_reference import LEAST_DAMPING, ToolReference
from skillframe_hydraulics.faults import BrokenParts, faults_in, moved_joints, ports
from skillframe_hydraulics.force.calibration import SWING_S, Ringing, StatedSigma, findings, hold_identified, swing
from skillframe_hydraulics.force.compiled import CompiledEstimator
from skillframe_hydraulics.force.load import BelievedLoad
from skillframe_hydraulics.force.momentum import Estimate, ForceSettings
from skillframe_hydraulics.force.residual_noise import residual_noise
from skillframe_hydraulics.force.valve import ValveIdentification, ValveSettings
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic import Demand, Measured, Reference, tool_task
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_hydraulics.law.vdc_reference import ToolTask
from skillframe_hydraulics.lines import lines_of
from skillframe_hydraulics.opening import opened, overlap
from skillframe_hydraulics.sensors import LineGauges, MachineSensors
from skillframe_hydraulics.sharing import FlowSharing
from skillframe_hydraulics.supply import Supplies, needed_by_lines, trial_values
from skillframe_hydraulics.watch import MachineWatch

__all__ = ["MachineDrive"]


class MachineDrive:
    """N hydraulic machines in lock-step.

    Raises:
        InputError: the machine cannot stand at a start or swing there, or its pumps are too small for the swing.
        StepTooLarge: the control rate is too low for the load on a cylinder.
        UnknownName, SkillframeError: as `skillframe.execution.executor.simulate`.
    """

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        self.setup, self.count, self.dt = setup, len(rngs), 1.0 / setup.robot.spec.control.rate_hz
        robot, spec = setup.robot, setup.robot.spec
        self.chain = ClosedChain(robot)
        self.actuators = tuple(self.chain.actuated)
        self.task = tool_task(self.chain)
        self._swing_part = swing_part(self.chain, self.task)
        for slip in unfit_pumps(self.chain, self.task):
            raise InputError(f"robot {spec.name}", slip.problem, slip.fix)
        fixture = fixture_poses(robot, draws, self.count)
        starts = start_poses(robot, setup.scene, draws, self.count).position
        require_start(self.chain, self.task, setup.scene, starts, fixture, self._swing_part)
        self.plant = Plant(robot, setup.scene, self.count, fixture, draws, timestep=self.dt)
        self.plant.reset(closed_configurations(self.chain, self.task, setup.scene, draws, self.count))
        n, k = len(self.chain.independent), len(self.chain.actuated)
        self._axes = len(self.task.axes)
        readings = noise_of(spec)
        self.gauges = MachineSensors(readings, rngs, n, k, self.dt)
        self.guard = LimitGuard(setup.limits, self.count, self.dt)
        self.active = np.arange(self.count)
        known = cylinders(spec.actuation, spec.folder / "robot.toml")
        corner, estimate = readings.corner_hz, ForceSettings()
        noise = residual_noise(self.chain, known, readings, estimate.corner, self.dt)
        estimate = replace(estimate, sensor_corner=corner, row_noise=tuple(noise.tolist()))
        g, unknown = self.gauges, np.zeros((self.count, self._axes))
        seen = g.z, g.rate
        self.law = CompiledLaw(self.chain, known, law_gains(self.chain), self.count, self.dt, seen=seen)
        self._seen = Measured(*seen, g.pressure_a, g.pressure_b, unknown, unknown)
        """Current sensor readings, without force."""
        self.terms = self.law.at
        reads = self._seen, self.law.at
        self.estimator = CompiledEstimator(self.chain, known, self.count, self.dt, estimate, reads=reads)
        self.valves = ValveIdentification(known, self.count, self.dt, ValveSettings(corner=corner))
        broken = faults_in(draws)
        self.bank = banks(spec, self.count, sorted(ports(broken)), lines=needed_by_lines(spec))
        self.faults = (
            BrokenParts(self.chain, self.bank, draws, self.gauges, self.dt, -round(SWING_S / self.dt))
            if broken
            else None
        )
        self.actuated = Actuated(self.plant, self.chain.actuated, self.bank, self.dt)
        self._pressures = [self.bank.outputs.index(f"pressure_{side}") for side in "ab"]
        self._z = [int(self.plant.model.joint(name).qposadr[0]) for name in self.chain.independent]
        late = np.asarray(draws.get("actuator.delay", np.zeros(self.count)))
        self._delay = CommandDelay(np.round(late / self.dt).astype(np.int64), len(known.area_a))
        self.sigma = StatedSigma(self.count, self.dt)
        self.watch = (
            MachineWatch(self.law, self.valves, known, g, readings, moved_joints(self.chain), self.dt)
            if readings.watch
            else None
        )
        self.findings: list[list[str]] = [[] for _ in rngs]
        meant = [a.unused for a in spec.actuation if a.fmu != CYLINDER]
        rows = unmapped(foreign_specs(spec), meant, spec.folder)
        self._unmapped = [text for row in rows for text in row._replace(outputs=()).sentences]
        z: Float = self.plant.state[0].take(self._z, axis=1)
        hold = holding_force(self.chain, z, draws)
        own = instance_parameters(spec, draws, hold)
        supply = trial_values(own, "supply_pressure", known.supply_pressure, self.count)
        self._nominal, self._height = supply, supply - self.law.cylinders.return_pressure
        require_held(spec.actuation, hold, supply, f"robot {spec.name}")
        self.actuated.master.start(0.0, 0.0, own)
        true = [self.bank.y[:, column].reshape(self.count, -1) for column in self._pressures]
        for side, pressure in zip("ab", true, strict=True):
            running = self.bank.active.reshape(pressure.shape).astype(bool)
            for trial, j in np.argwhere(running & ~np.isfinite(pressure))[:1]:
                text = f"its FMU gives no pressure_{side}, from which the force is estimated (trial {trial})"
                where = f"robot {spec.name}, {self.chain.actuated[j]}"
                raise InputError(where, text, "map it under outputs of its [[actuation]]")
        self.supplies: Supplies | None = None
        if supplies_of(spec):
            begin = overlap(known.openings, trial_values(own, "deadband", known.deadband, self.count))
            self.supplies = Supplies(lines_of(spec), self.bank, supply, begin, self.dt)
            self._line_gauges = LineGauges(readings, rngs, self.supplies.pressure, self.dt)
            self._sharing = FlowSharing(supplies_of(spec), self.supplies, self.law, n, self.dt)
        self.bill = EnergyBill(self.bank, supply, self.dt)
        self.actuated.require_stable()
        for problem, fix in fast_filters(readings, gains_of(spec), spec.control.rate_hz):
            raise InputError(f"robot {spec.name}", problem, fix)
        g.start(z, true[0], true[1])
        width = len(self.bank.outputs)
        places = [(0, column) for column in self._z]
        places += [(1, j * width + column) for column in self._pressures for j in range(k)]
        g.wire([self.plant.state[0], self.bank.y.reshape(self.count, -1)], places)
        self.law.start()
        self.load = BelievedLoad(self.law, draws, self.count)
        self.home = self.plant.tool_pose().position @ self.task.axes.T
        self.joint = z[:, self._axes :].copy()
        nothing = np.zeros((self.count, self._axes))
        self.estimate = Estimate(nothing, nothing, np.zeros((self.count, n)), nothing, nothing)
        self.demand = Demand(*(np.zeros((self.count, k)) for _ in range(3)))
        self.estimator.start()
        tool, axes = self.plant.tool_pose().position, self.task.axes
        self._tool = ToolReference(g, self.estimator, self.law, self.guard, axes, tool, self.dt)

    def prepare(self) -> list[Broken]:
        """Swing in the air to identify friction and payload."""
        broken = self.actuated.failed(self.active)
        self._leave(broken)
        self.estimator.calibrate(True)
        ringing = Ringing(self.count, self.dt, SWING_S, self._axes)
        zero, still = np.zeros((self.count, self._axes)), np.zeros_like(self.joint)
        stiff = LEAST_DAMPING * np.broadcast_to(np.eye(self._axes), (self.count, self._axes, self._axes))
        stiffness = 6.0 * stiff
        for tick in range(round(SWING_S / self.dt)):
            position, velocity, joint, joint_rate = swing(tick * self.dt, self._axes, self._swing_part)
            self._sample()
            if tick == 0 and self.load.weigh(self._seen, self.terms):
                self.terms = self.law.terms(self._seen)
            estimate = self.estimator.step(self._seen, self.terms)
            nothing = np.zeros_like(estimate.force)  # the force in the air
            self.estimate = estimate._replace(sigma=nothing, feedback=nothing, answered=nothing)
            self.sigma.show(tick, estimate)
            # the learning of inertias depends on the valves
            self.valves.step(opened(self.law.cylinders.openings, self.demand.valve), self._seen, self.terms)
            if tick and tick % round(0.5 / self.dt) == 0:  # fitted again every 0.5 s
                self.valves.solve()
                self.law.deadband[:], self.law.supply[:] = self.valves.compensated, self._supply_pressure()
            self._wanted = Reference(
                self.home + position, zero + velocity, stiffness, stiff, zero, self.joint + joint, still + joint_rate
            )
            measured = Measured(self.gauges.now, *self._seen[1:4], nothing, nothing)
            self.demand = self.law.step(measured, self._wanted, self.active)
            if failed := [*self._suspect(tick, ringing), *self.advance(self.active)]:
                broken += failed
                self._leave(failed)
            ringing.step(self.terms.tip_rate, velocity)
            if not len(self.active):
                break
        broken += self._ringing(ringing)
        self.sigma.hold()
        self.estimator.calibrate(False)
        hold_identified(self.law, self.estimator.identification)
        self._tool.hold(self.joint)
        self.findings = findings(self.law, self.load, self.estimator.identification, self.valves)
        self.bill.start()
        if self.supplies is not None:
            self.supplies.start()
        return broken

    def _leave(self, broken: Sequence[Broken]) -> None:
        if broken:
            rows = np.array([one.row for one in broken])
            self.active = np.setdiff1d(self.active, rows)
            self.end(rows)

    def _ringing(self, swung: Ringing) -> list[Broken]:
        """Trials that oscillated in the swing, and so must not touch anything."""
        said = swung.sentences(self.law)
        return [Broken(int(i), Ended.MACHINE, said[i]) for i in self.active if said[i]]

    def _suspect(self, tick: int, swung: Ringing) -> list[Broken]:
        """Trials that the monitor ends in the swing. Oscillation takes precedence over oil and motion."""
        broken = self._watched(swing=True)
        if not broken:
            return []
        moved = any(one.code == Ended.WATCHDOG for one in broken) and tick * self.dt > 0.5 * SWING_S
        rings = {one.row: one for one in self._ringing(swung)} if moved else {}
        when = f"(in the swing, {SWING_S - tick * self.dt:.3f} s before the start)"
        said = [one._replace(cause=f"{one.cause} {when}") for one in broken]
        return [rings.get(one.row, one) if one.code == Ended.WATCHDOG else one for one in said]

    def _sample(self) -> None:
        if self.faults is not None:
            self.faults.tick()
        self.gauges.read()
        self.terms = self.law.terms(self._seen)
        if self.supplies is not None:
            self._line_gauges.read(self.supplies.pressure)
            self.law.supply[:] = self._supply_pressure()
            unknown = np.full_like(self._nominal, np.nan)
            self.valves.line_deviation = self.supplies.at_valves(self._line_gauges.deviation, unknown)

    def _supply_pressure(self) -> Float:
        """Pressures (N, k) at the valves: the line's as measured, and what the swing found where none is declared."""
        if self.supplies is None:
            return self.valves.supply
        return self.supplies.at_valves(self._line_gauges.pressure, self.valves.supply)

    def _watched(self, *, swing: bool = False, alarms: Collection[int] = ()) -> list[Broken]:
        if self.watch is None:
            return []
        if not (self.watch.due(opened(self.law.cylinders.openings, self.demand.valve)) or alarms):
            return []
        seen = self._seen._replace(force=self.estimate.answered)
        found = self.watch.look(seen, self.terms, self._wanted, self.active, swing=swing, alarms=alarms)
        coupled = {one.row: one for one in self.actuated.violations(0, self.active)} if found else {}
        return [coupled.get(one.row, one._replace(cause="; ".join([one.cause, *self._full(one.row)]))) for one in found]

    def sense(self, tick: int, active: Trials) -> Observation:
        """Pose and twist from the encoders, wrench from the pressures."""
        self.active = active
        self._sample()
        self.estimate = self.estimator.step(self._seen, self.terms)
        return self._tool.seen(tick * self.dt, self.plant.tool_pose().rotation)

    def act(self, command: Command, ramp: float) -> Float:
        """Compute valve commands, and return the wrench (N, 6) of equation (1) for limits and trace."""
        if self.supplies is not None:
            command = self._sharing.shared(command, self.terms)
        self._tool.aim(command, ramp)
        measured, self._wanted = self.law.given
        self.demand = self.law.step(measured, self._wanted, self.active)
        return self._tool.law_wrench

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """The robot's limits, applied to the estimate, and the energy error of the coupling."""
        broken = [] if self._tool.fine else self.guard.named(active)
        return [*self._watched(alarms=[one.row for one in broken]), *broken, *self.actuated.violations(tick, active)]

    def _read(self, observation: Observation) -> Observation:
        """The observation with the current force, for records. Feedback to the skill is later."""
        wrench = observation.wrench.copy()
        wrench[:, :3] = self.estimate.force @ self.task.axes
        return observation._replace(wrench=wrench)

    def advance(self, active: Trials) -> list[Broken]:
        """Step the coupled plant under the valve commands."""
        if self.supplies is not None:
            self.bill.price(self.supplies.at_valves(self.supplies.pressure, self._nominal))
        self.bill.step(self.actuated.plant.velocity)
        arrived = self._delay.step(self.demand.valve)
        if self.faults is not None:
            arrived = self.faults.obey(arrived, self._height)
        if self.supplies is None:
            return self.actuated.step(arrived, active)
        self.supplies.begin(lost=self.faults is not None)
        broken = self.actuated.step(arrived, active)
        self.supplies.end()
        return broken

    def end(self, rows: Trials) -> None:
        """Stop stepping their FMUs."""
        self.actuated.end(rows)

    def contact_torque(self) -> Float:
        """Contact torque at the tool frame's origin (N,) [Nm]."""
        return norm(self.plant.contact_wrench(self.setup.center_of_compliance)[:, 3:])

    def shares(self) -> Shares:
        """Energy only, because shares are unknown for cylinders."""
        unknown = np.full(self.count, np.nan)
        return Shares(self.guard.energy, unknown, unknown, unknown)

    def notes(self, i: int) -> list[str]:
        """Notes of controller, FMUs and identification."""
        waste = [] if self.supplies is None else self.supplies.waste(i)
        return [*self.law.notes, *self.bank.notes, *self._unmapped, *self.findings[i], *self._full(i), *waste]

    def _full(self, i: int) -> list[str]:
        return [] if self.supplies is None else [*self.supplies.said(i), *self._sharing.said(i)]

    def recording(self, every: int) -> WithColumns:
        """A recorder with the machine's columns and the current force."""
        point = np.asarray(self.setup.center_of_compliance, dtype=float)
        lines = 0 if self.supplies is None else len(self.supplies.lines.names)
        recorder = Recorder(self.plant, every, point, machine=columns(len(self.actuators), self._axes, lines))
        return WithColumns(recorder, self._columns, self._read)

    def outcome(self, result: Result) -> Result:
        """The unchanged result."""
        return result

    def _columns(self) -> dict[str, Float]:
        lines, told = self.supplies, dict[str, Float]()
        if lines is not None:
            told = {"line_pressure": lines.pressure, "pump_flow": lines.flow, "pace": self._sharing.pace}
        return told | {
            "pressure_a": self.gauges.pressure_a, "pressure_b": self.gauges.pressure_b, "valve": self.demand.valve,
            "piston_force": self.demand.present - self.estimator.friction(self.terms),
            "piston_force_true": self.actuated.force, "force_sigma": self.sigma.stated(self.estimate),
            "force_valid": self.estimate.valid.astype(float),
            "energy_supply": self.bill.supply, "energy_pistons": self.bill.pistons,
        }  # fmt: skip


def closed_configurations(chain: ClosedChain, task: ToolTask, scene: Scene, draws: Draws, count: int) -> Float:
    """Closed configurations (N, nq) with the tool at its start and the other joints as at home.

    Raises:
        InputError: a start outside the machine's plane, or one that a cylinder cannot reach or hold.
    """
    robot, m = chain.robot, len(task.axes)
    normal = np.cross(*task.axes) if m == 2 else np.zeros(3)
    across = {f"start.offset_{'xyz'[i]}": normal[i] for i in np.flatnonzero(np.abs(normal) > 1e-9)}
    if np.any(np.abs(sum(n * np.asarray(draws.get(name, 0.0)) for name, n in across.items())) > 1e-9):
        text = f"{robot.spec.name} moves its tool in a plane, and not across it"
        raise InputError(", ".join(across), text, "leave it out" if len(across) == 1 else "keep the start in the plane")
    home = chain.minimal(chain.home)
    rows = []
    for point in start_poses(robot, scene, draws, count).position @ task.axes.T:
        z = task.solve(chain, np.concatenate([point, home[m:]]), home)
        z = chain.settled(z)
        require_feasible(chain, z)
        rows.append(chain.configuration(z))
    return np.array(rows)


def holding_force(chain: ClosedChain, z: Float, draws: Draws) -> Float:
    """Piston forces (N, k) that balance gravity of each trial's masses at rest, with the least squared pressures.

    `z` (N, n) are minimal coordinates.
    """
    weight = areas(chain.robot.spec.actuation) ** 2
    scale = np.asarray(draws.get("robot.mass_scale", np.ones(len(z))))
    states = [chain.at(row, np.zeros(len(row))) for row in z]
    hold = np.array([state.holding_force(weight) for state in states])
    payload = chain.robot.spec.payload
    if payload is not None and "robot.payload" in draws:
        more = draws["robot.payload"] - payload.mass
        hold += [state.actuator_force(dm * state.load_gravity, weight) for state, dm in zip(states, more, strict=True)]
    return np.asarray(scale[:, None] * hold)
