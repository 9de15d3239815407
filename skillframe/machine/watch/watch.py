"""The watch over N machines: readings, oil and tool, looked at every 20 ms, and what it ends a trial for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken, Ended
from skillframe.frames import Float
from skillframe.machine.force.valve import ValveIdentification
from skillframe.machine.law.hydraulic import Measured, Reference, Terms
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.law.vdc_actuator import Cylinders
from skillframe.machine.sensors import RECENT, MachineSensors
from skillframe.machine.watch.flow import FlowWatch, knowledge
from skillframe.machine.watch.readings import ReadingWatch, Suspicion
from skillframe.machine.watch.tool import ToolWatch
from skillframe.robot.driven import MachineNoise


class MachineWatch:
    """Of N machines.

    Args:
        law: with what it knows of valves and supply; valves: what finds that out, and how surely.
        cylinders: as the controller knows them.
        gauges: the sensors; noise: theirs, as robot.toml says it.
        moved: (k,) which coordinate each cylinder moves.
        dt: [s] of a tick.
    """

    def __init__(
        self, law: CompiledLaw, valves: ValveIdentification, cylinders: Cylinders, gauges: MachineSensors,
        noise: MachineNoise, moved: NDArray[np.int64], dt: float,
    ) -> None:  # fmt: skip
        chain, period, count = law.chain, RECENT * dt, gauges.raw.shape[1]
        self._law, self._valves, self._gauges, self._tick = law, valves, gauges, 0
        speed = chain.minimal(chain.model.velocityLimit)
        names = (tuple(chain.independent), tuple(chain.actuated))
        self._readings = ReadingWatch(noise, speed, cylinders.return_pressure, moved, names, dt)
        # white noise behind w^2 / (s + w)^2 has a variance w dt / 4 times as large
        filtered = noise.encoder * float(np.sqrt(0.5 * np.pi * noise.corner_hz * dt))
        self._flow = FlowWatch(cylinders, names[1], count, period, filtered)
        self._tool = ToolWatch(count, period)
        self._told: Float = np.zeros((count, len(names[1])))
        self._known, self._swinging = knowledge(law, valves), True

    def due(self, valve: Float) -> bool:
        """Take in the command (N, k) of a tick. Is it one in which all are looked at?"""
        self._told += valve
        self._tick += 1
        return self._tick % RECENT == 0

    def look(
        self, seen: Measured, terms: Terms, reference: Reference, active: NDArray[np.int64], *, swing: bool = False,
        alarms: Collection[int] = (),
    ) -> list[Broken]:  # fmt: skip
        """The trials among `active` that are not to go on, each for the first thing that was found.

        To be called in ticks that are `due`, and in those with alarms.

        Args:
            seen: readings.
            terms: of the model there.
            reference: what the law follows.
            active: trials that run.
            swing: before the skill starts.
            alarms: trials that break a limit in this tick, whose readings are looked at now.
        """
        due = self._tick % RECENT == 0
        last, turn = self._gauges.raw, self._gauges.turn
        raw = np.concatenate([last[turn:], last[:turn]])
        found = self._readings.look(raw, self._gauges.chambers, terms.piston_rate)
        if due:
            if swing or self._swinging:  # what is known is held afterwards
                self._known, self._swinging = knowledge(self._law, self._valves), swing
            found += self._flow.look(self._told / RECENT, seen, terms, self._known, swing)
            if not swing:  # a machine that swings by itself there is told so at its end, with what to lower
                found += self._tool.look(terms.tip_rate, reference.position - terms.tip, seen.force, reference)
            self._told[:] = 0.0
        return list(_first(found, active if due else alarms)) if found else []


def _first(found: Iterable[Suspicion], active: Iterable[int]) -> Iterator[Broken]:
    """The first suspicion of every one of these trials."""
    left = {int(row) for row in active}
    for one in found:
        if one.row in left:
            left.remove(one.row)
            yield Broken(one.row, Ended.SENSOR if one.sensor else Ended.WATCHDOG, one.text)
