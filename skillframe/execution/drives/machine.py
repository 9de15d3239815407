"""Hydraulic machines: cylinders as co-simulated FMUs between command and plant.

    encoders, pressures -> filters -> force estimate -> Observation -> skill.step -> Command
        -> hydraulic law -> valve commands -> FMUs and plant, coupled by `cosim`

Before the skill starts the machine swings in the air for some seconds, an explicit step in which friction and payload
are identified; from then on they are held. There is no force sensor: what the skill sees as wrench is the estimate from
chamber pressures, and the pose is that of the filtered encoders. The machine moves its tool in a plane; the attitude of
the tool follows from its joints and is not commanded.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from skillframe.control.endings import Broken, Ended
from skillframe.control.limits import LimitGuard
from skillframe.errors import InputError
from skillframe.execution.drive import Shares, Trials
from skillframe.execution.drives.actuated import Actuated
from skillframe.execution.drives.machine_faults import BrokenParts, moved_joints
from skillframe.execution.drives.machine_reference import LEAST_DAMPING, PlaneTask
from skillframe.execution.drives.machine_start import closed_configurations, holding_force
from skillframe.execution.drives.recording import WithColumns
from skillframe.execution.recorder import Recorder
from skillframe.execution.result import Result
from skillframe.execution.setup import Setup
from skillframe.fmu.unmapped import unmapped
from skillframe.frames import Float, norm
from skillframe.machine.checks.figures import CYLINDER
from skillframe.machine.checks.holding import require_held
from skillframe.machine.columns import EnergyBill, columns, supply_pressures
from skillframe.machine.cylinder.bank import banks, foreign_specs, instance_parameters
from skillframe.machine.faults import faults_in, ports
from skillframe.machine.force.calibration import CALIBRATION_S, SETTLE_S, hold_identified, swing
from skillframe.machine.force.compiled import CompiledEstimator
from skillframe.machine.force.findings import findings
from skillframe.machine.force.load import BelievedLoad
from skillframe.machine.force.momentum import Estimate, ForceSettings
from skillframe.machine.force.residual_noise import residual_noise
from skillframe.machine.force.ringing import Ringing
from skillframe.machine.force.stated import StatedSigma
from skillframe.machine.force.valve import ValveIdentification, ValveSettings
from skillframe.machine.law.gains import law_gains
from skillframe.machine.law.hydraulic import Demand, Measured, Reference, plane_task
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.law.vdc_actuator import Cylinders, cylinders
from skillframe.machine.sensors import MachineSensors
from skillframe.machine.watch.watch import MachineWatch
from skillframe.robot.chain import ClosedChain
from skillframe.robot.driven import fast_filters
from skillframe.signals.delay import CommandDelay
from skillframe.skill import Command, Observation
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Draws, Plant

__all__ = ["MachineDrive"]

SWING_S = CALIBRATION_S + SETTLE_S
VALVES_S = 0.5
"""So often the swing's rows are fitted again for overlap and supply pressure of the valves (ours)."""


class MachineDrive:
    """N hydraulic machines in lock-step.

    Args:
        setup: robot, scene and settings.
        draws: quantities per trial.
        rngs: one generator per trial, for the sensors.

    Raises:
        InputError: the machine cannot stand at a start.
        StepTooLarge: the control rate is too low for the load on a cylinder.
        UnknownName, SkillframeError: as `skillframe.execution.executor.simulate`.
    """

    def __init__(self, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> None:
        self.setup, self.count, self.dt = setup, len(rngs), 1.0 / setup.robot.spec.control.rate_hz
        robot, spec = setup.robot, setup.robot.spec
        self.chain = ClosedChain(robot)
        self.actuators = tuple(self.chain.actuated)
        self.task = plane_task(self.chain)
        fixture = fixture_poses(robot, draws, self.count)
        self.plant = Plant(robot, setup.scene, self.count, fixture, draws, timestep=self.dt)
        self.plant.reset(closed_configurations(self.chain, self.task, setup.scene, draws, self.count))
        n, k = len(self.chain.independent), len(self.chain.actuated)
        self.gauges = MachineSensors(spec.sensors, rngs, n, k, self.dt)
        self.guard = LimitGuard(setup.limits, self.count, self.dt)
        self.active = np.arange(self.count)
        known = cylinders(spec.actuation, spec.folder / "robot.toml")
        corner, estimate = spec.sensors.corner_hz, ForceSettings()
        noise = residual_noise(self.chain, known, spec.sensors, estimate.corner, self.dt)
        estimate = replace(estimate, sensor_corner=corner, row_noise=tuple(noise.tolist()))
        g, unknown = self.gauges, np.zeros((self.count, 2))
        seen = g.z, g.rate
        self.law = CompiledLaw(self.chain, known, law_gains(self.chain), self.count, self.dt, seen=seen)
        self._seen = Measured(*seen, g.pressure_a, g.pressure_b, unknown, unknown)
        """Sensors' readings, as they are now. The force is not measured."""
        reads = self._seen, self.law.at
        self.estimator = CompiledEstimator(self.chain, known, self.count, self.dt, estimate, reads=reads)
        self.valves = ValveIdentification(known, self.count, self.dt, ValveSettings(corner=corner))
        broken = faults_in(draws)
        self.bank = banks(spec, self.count, ports(broken))
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
        self.watch = self._watch(known) if spec.sensors.watch else None
        self.findings: list[list[str]] = [[] for _ in rngs]
        meant = [a.unused for a in spec.actuation if a.fmu != CYLINDER]
        rows = unmapped(foreign_specs(spec), meant, spec.folder)
        self._unmapped = [text for row in rows for text in row._replace(outputs=()).sentences]
        self._begin(draws)

    def _watch(self, known: Cylinders) -> MachineWatch:
        noise = self.setup.robot.spec.sensors
        return MachineWatch(self.law, self.valves, known, self.gauges, noise, moved_joints(self.chain), self.dt)

    def _begin(self, draws: Draws) -> None:
        """FMUs in equilibrium with the load, the step judged against it, sensors and law at rest."""
        z = self._true_z()
        hold = holding_force(self.chain, z, draws)
        own = instance_parameters(self.setup.robot.spec, draws, hold)
        supply = supply_pressures(own, self.law.cylinders.supply_pressure, self.count)
        self._height: Float = supply - self.law.cylinders.return_pressure
        require_held(self.setup.robot.spec.actuation, hold, supply, f"robot {self.setup.robot.spec.name}")
        self.actuated.master.start(0.0, 0.0, own)
        self._require_pressures()
        self.bill = EnergyBill(self.bank, supply, self.dt)
        self.actuated.require_stable()
        spec = self.setup.robot.spec
        for problem, fix in fast_filters(spec.sensors, spec.gains, spec.control.rate_hz):
            raise InputError(f"robot {spec.name}", problem, fix)
        self.gauges.start(z, *self._true_pressures())
        self._wire()
        self.law.start()
        self.load = BelievedLoad(self.law, draws, self.count)
        self.home = self.plant.tool_pose().position[:, self.task.axes].copy()
        self.joint = z[:, 2:].copy()
        nothing = np.zeros((self.count, 2))
        self.estimate = Estimate(nothing, nothing, np.zeros((self.count, len(self.chain.actuated))), nothing, nothing)
        self.demand = Demand(*(np.zeros((self.count, len(self.chain.actuated))) for _ in range(3)))
        self.estimator.start(self._seen)
        tool, axes = self.plant.tool_pose().position, self.task.axes
        self._in_plane = PlaneTask(self.gauges, self.estimator, self.law, self.guard, axes, tool, self.dt)

    def _wire(self) -> None:
        """Tell the sensors where the true values stand."""
        k, width = len(self.actuators), len(self.bank.outputs)
        where = [(0, column) for column in self._z]
        where += [(1, j * width + column) for column in self._pressures for j in range(k)]
        self.gauges.wire([self.plant.state[0], self.bank.y.reshape(self.count, -1)], where)

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

    def prepare(self) -> list[Broken]:
        """Swing in the air and identify friction and payload, then hold what was found."""
        broken = self.actuated.failed(self.active)
        self._leave(broken)
        self.estimator.calibrate(True)
        ringing = Ringing(self.count, self.dt, SWING_S)
        zero, still = np.zeros((self.count, 2)), np.zeros_like(self.joint)
        stiff = LEAST_DAMPING * np.broadcast_to(np.eye(2), (self.count, 2, 2))
        stiffness = 6.0 * stiff
        for tick in range(round(SWING_S / self.dt)):
            position, velocity, joint, joint_rate = swing(tick * self.dt)
            self._sample()
            if tick == 0:
                self._weigh()
            self._estimate(force_counts=False)
            self.sigma.show(tick, self._estimated)
            self._look_at_valves(tick)
            self._valve(
                Reference(
                    self.home + position, zero + velocity, stiffness, stiff, zero, self.joint + joint,
                    still + joint_rate,
                )
            )  # fmt: skip
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
        self._in_plane.hold(self.joint)
        self.findings = findings(self.law, self.load, self.estimator.identification, self.valves)
        self.bill.start()
        return broken

    def _leave(self, broken: Sequence[Broken]) -> None:
        """Trials that failed before the start are not stepped any more."""
        if broken:
            rows = np.array([one.row for one in broken])
            self.active = np.setdiff1d(self.active, rows)
            self.end(rows)

    def _ringing(self, swung: Ringing) -> list[Broken]:
        """The trials that rang in the swing: nothing was identified, and nothing should be touched."""
        said = swung.sentences(self.law)
        return [Broken(int(i), Ended.MACHINE, said[i]) for i in self.active if said[i]]

    def _suspect(self, tick: int, swung: Ringing) -> list[Broken]:
        """Trials that the watch ends in the swing. Ringing, once that can be told, is a cause before oil and motion."""
        broken = self._watched(swing=True)
        if not broken:
            return []
        moved = any(one.code == Ended.WATCHDOG for one in broken) and tick * self.dt > 0.5 * SWING_S
        rings = {one.row: one for one in self._ringing(swung)} if moved else {}
        when = f"(in the swing, {SWING_S - tick * self.dt:.3f} s before the start)"
        said = [one._replace(cause=f"{one.cause} {when}") for one in broken]
        return [rings.get(one.row, one) if one.code == Ended.WATCHDOG else one for one in said]

    def _look_at_valves(self, tick: int) -> None:
        """Identify them, and let the law go by what is known so far: what it learns of inertias depends on it."""
        self.valves.step(self.demand.valve, self._seen, self.terms)
        if tick and tick % round(VALVES_S / self.dt) == 0:
            self.valves.solve()
            self.law.deadband[:], self.law.supply[:] = self.valves.compensated, self.valves.supply

    def _sample(self) -> None:
        """Read the sensors, and the model's terms where the machine then is."""
        if self.faults is not None:
            self.faults.tick()
        self.gauges.read()
        self.terms = self.law.terms(self._seen)

    def _weigh(self) -> None:
        """At rest, before the swing: go by the load that the pressures hold if it cannot be what was told."""
        if self.load.weigh(self._seen, self.terms):
            self.terms = self.law.terms(self._seen)

    def _estimate(self, force_counts: bool = True) -> None:
        """The force from what was sampled. In the air it is known to be zero."""
        self.estimate = self._estimated = estimate = self.estimator.step(self._seen, self.terms)
        if not force_counts:
            nothing = np.zeros_like(estimate.force)
            self.estimate = estimate._replace(sigma=nothing, feedback=nothing, answered=nothing)

    def _valve(self, reference: Reference) -> None:
        _, rate, pressure_a, pressure_b, _, _ = self._seen
        estimate = self.estimate
        measured = Measured(self.gauges.now, rate, pressure_a, pressure_b, estimate.answered, estimate.sigma)
        self._wanted = reference
        self.demand = self.law.step(measured, reference, self.active)

    def _watched(self, *, swing: bool = False, alarms: Collection[int] = ()) -> list[Broken]:
        """Trials whose readings, oil and motion do not fit each other, or whose coupling is to blame for that."""
        if self.watch is None:
            return []
        if not (self.watch.due(self.demand.valve) or alarms):
            return []
        seen = self._seen._replace(force=self.estimate.answered)
        found = self.watch.look(seen, self.terms, self._wanted, self.active, swing=swing, alarms=alarms)
        coupled = {one.row: one for one in self.actuated.violations(0, self.active)} if found else {}
        return [coupled.get(one.row, one) for one in found]

    def sense(self, tick: int, active: Trials) -> Observation:
        """Pose and twist as the encoders say, wrench as the pressures say."""
        self.active = active
        self._sample()
        self._estimate()
        return self._in_plane.seen(tick * self.dt, self.plant.tool_pose().rotation)

    def act(self, command: Command, ramp: float) -> Float:
        """Valve commands of the law, and equation (1)'s wrench (N, 6) for limits and trace, returned."""
        self._in_plane.aim(command, ramp)
        measured, self._wanted = self.law.given
        self.demand = self.law.step(measured, self._wanted, self.active)
        return self._in_plane.law_wrench

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """The robot's limits, held to the estimate, and the energy that the coupling makes."""
        broken = [] if self._in_plane.fine else self.guard.named(active)
        return [*self._watched(alarms=[one.row for one in broken]), *broken, *self.actuated.violations(tick, active)]

    def _read(self, observation: Observation) -> Observation:
        """The same with the force as it is now, for the record. A skill that answers the force sees it late."""
        wrench = observation.wrench.copy()
        wrench[:, self.task.axes] = self.estimate.force
        return observation._replace(wrench=wrench)

    def advance(self, active: Trials) -> list[Broken]:
        """One coupled step under the valve commands. Trials whose FMU failed, each with its sentence."""
        self.bill.step(self.actuated.plant.velocity)
        arrived = self._delay.step(self.demand.valve)
        if self.faults is not None:
            arrived = self.faults.obey(arrived, self._height)
        return self.actuated.step(arrived, active)

    def end(self, rows: Trials) -> None:
        """Their FMUs are not stepped any more."""
        self.actuated.end(rows)

    def contact_torque(self) -> Float:
        """(N,) at the tool frame's origin [Nm]."""
        return norm(self.plant.contact_wrench(self.setup.center_of_compliance)[:, 3:])

    def shares(self) -> Shares:
        """Cylinders have no motors whose shares would be known."""
        unknown = np.full(self.count, np.nan)
        return Shares(self.guard.energy, unknown, unknown, unknown)

    def notes(self, i: int) -> list[str]:
        """What law, FMUs and identification have to say."""
        return [*self.law.notes, *self.bank.notes, *self._unmapped, *self.findings[i]]

    def recording(self, every: int) -> WithColumns:
        """A recorder with the machine's columns, and the force as it is now."""
        point = np.asarray(self.setup.center_of_compliance, dtype=float)
        recorder = Recorder(self.plant, every, point, machine=columns(len(self.actuators)))
        return WithColumns(recorder, self._columns, self._read)

    def outcome(self, result: Result) -> Result:
        """As it is."""
        return result

    def _columns(self) -> dict[str, Float]:
        return {
            "pressure_a": self.gauges.pressure_a, "pressure_b": self.gauges.pressure_b, "valve": self.demand.valve,
            "piston_force": self.demand.present - self.estimator.friction(self.terms),
            "piston_force_true": self.actuated.force, "force_sigma": self.sigma.stated(self.estimate),
            "force_valid": self.estimate.valid.astype(float),
            "energy_supply": self.bill.supply, "energy_pistons": self.bill.pistons,
        }  # fmt: skip
