"""Faults of the crane at a time and in a cylinder, while it comes down on a plate, presses, and slides along it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from skillframe_papers.rows import crane_runs

from skillframe.robot.model import RobotModel

HOSE = np.pi / 4 * 0.0127**2
KINDS = {
    "pressure frozen": {"sensor.pressure_frozen": 1.0}, "pressure zero": {"sensor.pressure_zero": 1.0},
    "encoder step": {"sensor.encoder_step": 0.05}, "encoder frozen": {"sensor.encoder_frozen": 1.0},
    "stuck": {"actuator.stuck": 1.0}, "runaway, extends": {"actuator.runaway": 1.0},
    "runaway, retracts": {"actuator.runaway": -1.0}, "burst a": {"actuator.burst_a": HOSE},
    "burst b": {"actuator.burst_b": HOSE}, "supply loss": {"actuator.supply_loss": 1.0},
}  # fmt: skip
"""Half an inch of hose; a step of 50 mrad or mm."""
CYLINDERS = ("lift", "tilt", "extension")
DEPTH, SECONDS = 0.07, 9.0
LIMIT = 15e3
"""[N] of the crane that ships."""

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
    "supply loss": r"watchdog: .* of (lift_piston|tilt_piston|extension) ",
}
"""How the reason of a fault begins, with the name of what broke. A lost supply starves any of them."""


class Struck(NamedTuple):
    """A trial in which something broke.

    Attributes:
        kind, cylinder, time: what, in which, and when [s] from the skill's start.
        after: [s] from then to the trial's end.
        force: largest true force [N]; ended: the code; success: of the trial; reason: in words.
    """

    kind: str
    cylinder: str
    time: float
    after: float
    force: float
    ended: str
    success: bool
    reason: str


def conditions(count: int, seed: int) -> dict[str, np.ndarray]:
    """Loads, frictions, masses, supplies, overlaps and delays that the controller is told nothing of.

    Some cranes with an empty grip and valves 20 ms late ring in the swing, and end before anything breaks.
    """
    rng = np.random.default_rng(seed)
    ranges = {
        "robot.payload": (0.0, 475.0), "actuator.delay": (0.0, 0.01), "actuator.friction_scale": (0.7, 1.3),
        "robot.mass_scale": (0.97, 1.03), "actuator.supply_pressure": (150e5, 210e5), "actuator.deadband": (0.0, 0.02),
    }  # fmt: skip
    return {name: rng.uniform(*ends, count) for name, ends in ranges.items()}


def struck(
    kinds: Sequence[str], cylinders: Sequence[int], times: Sequence[float], runs: int, seed: int,
    seconds: float = SECONDS,
) -> Iterator[Struck]:  # fmt: skip
    """Every kind in every cylinder at every time, so many runs each with its own conditions; chunks of a kind."""
    for kind in kinds:
        cases = [(c, t) for c in cylinders for t in times for _ in range(runs)]
        yield from together([(kind, c, t) for c, t in cases], seed, seconds)


def together(
    cases: Sequence[tuple[str, int, float]], seed: int, seconds: float, robot: RobotModel | None = None
) -> Iterator[Struck]:
    """Trials side by side, each with what breaks in it (a name in `KINDS`), in which cylinder, and when."""
    draws = conditions(len(cases), seed)
    for name in {name for kind, _, _ in cases for name in KINDS[kind]}:
        draws[name] = np.array([KINDS[kind].get(name, 0.0) for kind, _, _ in cases])
    draws["fault.cylinder"] = np.array([1.0 + c for _, c, _ in cases])
    draws["fault.time"] = np.array([t for _, _, t in cases])
    where = crane_runs.scene(np.array([crane_runs.FIXTURE[0], 0.0, crane_runs.ABOVE]), plate=True)
    path = crane_runs.press_and_slide(DEPTH)
    result = crane_runs.run(path, crane_runs.PRESSING, where, draws, seconds=seconds, seed=seed, robot=robot)
    for i, (kind, c, time) in enumerate(cases):
        reason = str(result.reason[i])
        early = re.search(r"in the swing, ([0-9.]+) s before", reason)
        end = -float(early[1]) if early else float(result.duration_s[i])
        yield Struck(
            kind, CYLINDERS[c], time, end - time, float(result.peak_force_n[i]), str(result.ended_by[i]),
            bool(result.success[i]), reason,
        )  # fmt: skip


def own_reason(one: Struck) -> bool:
    """Did a sensor's check or a watchdog end it, and name the part that broke?"""
    piston = one.cylinder if one.cylinder == CYLINDERS[2] else f"{one.cylinder}_piston"
    words = WORDS[one.kind].format(joint=one.cylinder, piston=piston)
    return one.ended in ("sensor", "watchdog") and re.match(words, one.reason) is not None


def verdict(one: Struck) -> str:
    """By the rule: "in time" with its own reason, "survived" without a force above the limit, or "neither"."""
    if own_reason(one) and one.after <= IN_TIME:
        return "in time"
    held = one.force <= LIMIT and one.ended not in ("force", "true_force")
    return "survived" if held else "neither"


def fine(one: Struck) -> bool:
    """Does it keep the rule?"""
    return verdict(one) != "neither"
