"""Faults of a hydraulic machine at a time and in an actuator, while it comes down on a plate, presses, and slides.

The machine is the crane that ships, or the described excavator, of 36 t with a slew, on a plate on springs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.faults import moved_joints
from skillframe_papers.rows import crane_runs

from skillframe.execution import load_robot_model
from skillframe.robot import ClosedChain, RobotModel
from skillframe.world import Geom, Scene, Sprung

HOSE = np.pi / 4 * 0.0127**2
KINDS = {
    "pressure frozen": {"sensor.pressure_frozen": 1.0}, "pressure zero": {"sensor.pressure_zero": 1.0},
    "encoder step": {"sensor.encoder_step": 0.05}, "encoder frozen": {"sensor.encoder_frozen": 1.0},
    "stuck": {"actuator.stuck": 1.0}, "runaway, extends": {"actuator.runaway": 1.0},
    "runaway, retracts": {"actuator.runaway": -1.0}, "burst a": {"actuator.burst_a": HOSE},
    "burst b": {"actuator.burst_b": HOSE}, "supply loss": {"actuator.supply_loss": 1.0},
}  # fmt: skip
"""Half an inch of hose; a step of 50 mrad or mm."""
DEPTH, SECONDS, TIMES = 0.07, 9.0, (-7.0, 9.0)
"""[m] into the plate; [s] of the skill; times of faults drawn at random, the swing before the skill included."""
LIMIT = 15e3
"""[N] of the crane that ships."""
SUPPLY = (150.0 / 190.0, 210.0 / 190.0)
"""Pressures of the supply, over the declared one."""
EXCAVATOR = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "excavator"
SPRING, PUSHING = 1e6, crane_runs.Stiffness(1.5e5, 1.5e5)
"""[N/m] of the excavator's plate; its impedance, as in `test_space`."""

IN_TIME = 0.2
"""[s] of the rule: a fault ends its trial with its own reason within that, or is survived within limits."""
WORDS = {
    "pressure frozen": r"sensor: pressure_a of {piston} repeats [\d.]+ bar to the bit",
    "pressure zero": r"sensor: pressure_a of {piston} (repeats 0 bar to the bit|reads .* below the return line's 10)",
    "encoder step": r"sensor: the encoder of {joint} jumps by 0\.05\d* within a tick|.* jumps by 0\.049\d* within",
    "encoder frozen": r"sensor: the encoder of {joint} repeats [-\d.]+ to the bit",
    "stuck": r"watchdog: .* of {piston} ",
    "runaway, extends": r"watchdog: .* of {piston} ",
    "runaway, retracts": r"watchdog: .* of {piston} ",
    "burst a": r"watchdog: the oil of {piston} does not balance: in 0\.1 s chamber a \d+ cm3 less",
    "burst b": r"watchdog: the oil of {piston} does not balance: in 0\.1 s .*chamber b \d+ cm3 less",
    "supply loss": r"watchdog: .* of \w+ ",
}
"""How the reason of a fault begins, with the name of what broke. A lost supply starves any of them."""


class Machine(NamedTuple):
    """What breaks: a robot, a scene with a plate half a metre below the start, and the impedance that presses on it."""

    robot: RobotModel
    scene: Scene
    gains: crane_runs.Stiffness

    @property
    def parts(self) -> list[tuple[str, str]]:
        """Its actuators, each with the joint whose encoder shows its motion."""
        chain = ClosedChain(self.robot)
        return list(zip(chain.actuated, (chain.independent[i] for i in moved_joints(chain)), strict=True))


@cache
def crane() -> Machine:
    """The crane that ships."""
    where = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=True)
    return Machine(load_robot_model("hiab_xs031"), where, crane_runs.PRESSING)


@cache
def excavator(folder: Path = EXCAVATOR) -> Machine:
    """A machine described in a folder, from its home; its plate stands on a spring."""
    robot = load_robot_model(str(folder))
    chain = ClosedChain(robot)
    state = chain.at(chain.minimal(chain.home), np.zeros(len(chain.independent)))
    start = state.data.oMf[robot.tool_frames[0]].translation - np.array(robot.spec.workspace.fixture)
    top = start[2] - crane_runs.ABOVE + crane_runs.PLATE
    box = Geom(kind="box", size=(1.5, 1.5, 0.3), position=(float(start[0]), float(start[1]), float(top - 0.3)))
    plate = Sprung(name="plate", geoms=(box,), axis=(0.0, 0.0, 1.0), stiffness=SPRING, mass=8.0, damping_ratio=0.6)
    air = crane_runs.scene(start + crane_runs.FIXTURE, plate=False)
    mark = Geom(kind="box", size=(0.01, 0.01, 0.01), position=(0.0, 0.0, -5.0), collide=False)
    return Machine(robot, replace(air, sprung=(plate,), fixture=(mark,)), PUSHING)


class Struck(NamedTuple):
    """A trial in which something broke.

    Attributes:
        kind, actuator, joint, time: what, in which, the joint that it moves, and when [s] from the skill's start.
        after: [s] from then to the trial's end.
        force, limit: largest true force, and the robot's limit of it [N].
        ended: the code; success: of the trial; reason: in words.
    """

    kind: str
    actuator: str
    joint: str
    time: float
    after: float
    force: float
    limit: float
    ended: str
    success: bool
    reason: str


def conditions(count: int, seed: int, robot: RobotModel | None = None) -> dict[str, np.ndarray]:
    """Loads, frictions, masses, supplies, overlaps and delays that the controller is told nothing of.

    Some cranes with an empty grip and valves 20 ms late ring in the swing, and end before anything breaks.
    """
    rng, spec = np.random.default_rng(seed), (robot or crane().robot).spec
    assert spec.payload is not None
    supply = float(spec.actuation[0].known["supply_pressure"])
    ranges = {
        "robot.payload": (0.0, spec.payload.rating), "actuator.delay": (0.0, 0.01),
        "actuator.friction_scale": (0.7, 1.3), "robot.mass_scale": (0.97, 1.03),
        "actuator.supply_pressure": (SUPPLY[0] * supply, SUPPLY[1] * supply), "actuator.deadband": (0.0, 0.02),
    }  # fmt: skip
    return {name: rng.uniform(*ends, count) for name, ends in ranges.items()}


def struck(
    kinds: Sequence[str], actuators: Sequence[int], times: Sequence[float], runs: int, seed: int,
    seconds: float = SECONDS,
) -> Iterator[Struck]:  # fmt: skip
    """Every kind in every actuator at every time, so many runs each with its own conditions; chunks of a kind."""
    for kind in kinds:
        yield from together([(kind, k, t) for k in actuators for t in times for _ in range(runs)], seed, seconds)


def at_random(machine: Machine, count: int, seed: int, batch: int = 50) -> Iterator[Struck]:
    """Faults of any kind in any actuator at any time from the swing's beginning to the end, so many side by side."""
    rng, kinds = np.random.default_rng(seed), list(KINDS)
    for number, first in enumerate(range(0, count, batch)):
        size = min(batch, count - first)
        kind, part = (rng.integers(0, len(of), size) for of in (kinds, machine.parts))
        cases = [(kinds[i], int(k), float(t)) for i, k, t in zip(kind, part, rng.uniform(*TIMES, size), strict=True)]
        yield from together(cases, seed + number, SECONDS, machine)


def together(
    cases: Sequence[tuple[str, int, float]], seed: int, seconds: float, machine: Machine | None = None
) -> Iterator[Struck]:
    """Trials side by side, each with what breaks in it (a name in `KINDS`), in which actuator, and when."""
    machine = machine or crane()
    draws, parts = conditions(len(cases), seed, machine.robot), machine.parts
    for name in {name for kind, _, _ in cases for name in KINDS[kind]}:
        draws[name] = np.array([KINDS[kind].get(name, 0.0) for kind, _, _ in cases])
    draws["fault.cylinder"] = np.array([1.0 + k for _, k, _ in cases])
    draws["fault.time"] = np.array([t for _, _, t in cases])
    path = crane_runs.press_and_slide(DEPTH)
    result = crane_runs.run(
        path, machine.gains, machine.scene, draws, seconds=seconds, seed=seed, robot=machine.robot
    )  # fmt: skip
    limit = machine.robot.spec.limits.force_n
    for i, (kind, k, time) in enumerate(cases):
        reason = str(result.reason[i])
        early = re.search(r"in the swing, ([0-9.]+) s before", reason)
        end = -float(early[1]) if early else float(result.duration_s[i])
        yield Struck(
            kind, *parts[k], time, end - time, float(result.peak_force_n[i]), limit, str(result.ended_by[i]),
            bool(result.success[i]), reason,
        )  # fmt: skip


def own_reason(one: Struck) -> bool:
    """Did a sensor's check or a watchdog end it, and name the part that broke?"""
    words = WORDS[one.kind].format(joint=one.joint, piston=one.actuator)
    return one.ended in ("sensor", "watchdog") and re.match(words, one.reason) is not None


def verdict(one: Struck) -> str:
    """By the rule: "in time" with its own reason, "survived" without a force above the limit, or "neither".

    A trial that ended "before" its fault has none; by more than half a tick, to which the time is rounded.
    """
    if one.after < -0.5e-3:
        return "before"
    if own_reason(one) and one.after <= IN_TIME:
        return "in time"
    held = one.force <= one.limit and one.ended not in ("force", "true_force")
    return "survived" if held else "neither"


def fine(one: Struck) -> bool:
    """Does it keep the rule?"""
    return verdict(one) != "neither"
