"""Two arms that are both free (configuration E): what was tried so that they insert from 12 degrees, as published.

    python -m tests.figures.both_free            # a table; --only WORDS runs what holds one of the words

Each line changes one thing of the published set-up as the rows of the two-arm paper have it: 0.5 Nm of joint friction,
upright, the fixture at 0.75 m. "12 / 12" would be the paper's. Configuration B, the master alone, stands beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import NamedTuple

from skillframe_dualarm.dual_peg import DualPegParams, build
from skillframe_papers.published import INSERTION
from skillframe_papers.rows.insertion import Asked, at_start, in_the_grasp, largest, side_by_side
from skillframe_papers.rows.sweep import both, phase_of

from skillframe.control import controller
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Float

TILTS_DEG = (4.0, 8.0, 12.0)
NAMES = ("E", "B")
Draws = dict[str, Float]


def in_the_slave(tilt: Float) -> Draws:
    """The hole sits askew in the slave's grip, its mouth where it should be."""
    return {"fixture.tilt_y": tilt}


class Tried(NamedTuple):
    """One change.

    Attributes:
        name: what is changed.
        start: how a tilt [rad] comes about.
        friction: of the joints [Nm].
        phase: what changes of the motion, of the rows' settings.
        spring: of the null space, in 1/s2.
        seconds: simulated at most.
    """

    name: str
    start: Callable[[Float], Draws] = at_start
    friction: float = 0.5
    phase: Mapping[str, float] = MappingProxyType({})
    spring: float = 0.0
    seconds: float = 12.0


TRIED = (
    Tried("as in the rows"),
    Tried("tilt in the master's grasp", in_the_grasp),
    Tried("tilt in the slave's grasp", in_the_slave),
    Tried("friction compensated but for 0.25 Nm", friction=0.25),
    Tried("friction compensated but for 0.1 Nm", friction=0.1),
    Tried("friction compensated but for 0.05 Nm", friction=0.05),
    Tried("null-space spring, 10 rad/s", spring=100.0),
    Tried("null-space spring, 30 rad/s", spring=900.0),
    Tried("push without a cap (150 N)", phase={"lead_force_n": 150.0}),
    Tried("5 mm/s", phase={"speed": 0.005}, seconds=30.0),
    Tried("2 mm/s", phase={"speed": 0.002}, seconds=45.0),
)


@contextmanager
def sprung(spring: float) -> Iterator[None]:
    """Arms whose null space is held where it started, by a spring of `spring` times its inertia, beside its damping."""
    law, plain = controller.ImpedanceController, controller.ImpedanceController._null_space
    moved: dict[int, Float] = {}

    def held(self: controller.ImpedanceController, reading: controller.Reading) -> Float:
        damped = plain(self, reading)
        way = moved[id(self)] = moved.get(id(self), 0.0) + 1e-3 * reading.velocity
        back: Float = (self._projector @ way[..., None])[..., 0]  # the projector holds minus the damping
        return damped + spring / controller.NULL_SPACE_DAMPING * back

    try:
        if spring:
            law._null_space = held  # type: ignore[method-assign]
        yield
    finally:
        law._null_space = plain  # type: ignore[method-assign]


def reached(tried: Tried) -> list[tuple[float, float]]:
    """Of each of `NAMES`: largest tilt [degrees] up to which all are inserted, of either sign. 0: not even 4."""
    robot, scene = load_robot_model("dual_panda"), build(DualPegParams(friction=INSERTION["world.friction"]))
    values = {**INSERTION, **tried.phase}
    asked = [Asked(phase_of(n, scene.tool.frames, values), both(TILTS_DEG), [tried.friction]) for n in NAMES]
    with sprung(tried.spring):
        found = side_by_side(robot, scene, asked, duration_s=tried.seconds, tilted=tried.start)
    return [(largest(rows, 1, tried.friction), largest(rows, -1, tried.friction)) for rows in found]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[""], metavar="WORDS")
    only = parser.parse_args().only
    print("| tried | E, + / - | B, + / - |\n|---|---|---|")
    for tried in (each for each in TRIED if any(word in each.name for word in only)):
        print(f"| {tried.name} | {' | '.join(f'{p:g} / {m:g}' for p, m in reached(tried))} |", flush=True)
