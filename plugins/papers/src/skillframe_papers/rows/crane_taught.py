r"""Row 19: the crane taught through a force-reflecting master, and its LMC skills in the corner.

A push at the angle a in the crane's plane slides on the stack and on the stop, each of friction mu, if

    -90 degrees + atan mu < a < -atan mu.

Each pair of demonstrations has one operator and machine, with friction within 20 % and masses within 2 % of the
controller's; another machine runs the skill. Wrenches are estimated from noisy chamber pressures. Only the paper's
abstract was available.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atan, degrees, radians
from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.sessions import aimed, record_operated
from skillframe_hydraulics.teleoperation import OperatorSettings

from skillframe.demonstration import Demonstration
from skillframe.document import learned
from skillframe.execution import Result, load_robot_model, load_world, prepare, simulate
from skillframe.extend import Document, Illustration, LearnOptions, RowResult, RowRun, registry
from skillframe.frames import Float
from skillframe.world import nominal_fixture

ROBOT, WORLD = "hiab_xs031", "pallets"
SURFACES = ("wood", "styrofoam")
STARTS = ((-0.2, -0.15), (0.2, 0.15), (0.0, 0.0))
"""Start of a run from the nominal one: over the stack, beside the stop, in the middle [m]."""
FRICTION, MASS = 0.2, 0.02
CORNER = (0.5, 0.482)  # x, z of the tool in the world's corner [m]
LEARN = {
    "contact_only": True, "force_min_n": 1000.0, "step_m": 0.02, "speed_max_m_s": 0.1, "stiffness_n_m": 1e5,
    "lead_force_n": 3000.0, "lead_force_max_n": 3000.0, "stall_m": 0.002, "side_stiffness": 1.0,
}  # fmt: skip
"""Settings of the learner for a machine of this size, as the how-to page of the crane gives them."""


class Taught(NamedTuple):
    """A pair of demonstrations on a surface, and its learned skill."""

    pair: int
    surface: str
    demonstrations: list[Demonstration]
    redrawn: int
    document: Document

    @property
    def angle(self) -> float:
        """Angle of the learned push in the crane's plane [degrees], NaN without one."""
        direction = self.document["phases"][0]["translation"]["desired_direction"]
        return np.nan if direction is None else degrees(np.arctan2(direction[2], direction[0]))


class Reached(NamedTuple):
    """Runs that ended in the corner unharmed, all runs, and their ends."""

    good: int
    result: Result


def taught(job: RowRun) -> RowResult:
    """Row 19: what two demonstrations on each surface teach, and the skills' runs on both."""
    pairs, surfaces = range(job.count(3, 1)), SURFACES
    shown = SURFACES[: job.count(2, 1)]
    skills = [_teach(job, pair, surface) for pair in pairs for surface in shown]
    reached = {
        (i, surface): _run(job, each, surface)
        for i, each in enumerate(skills) for surface in surfaces
        if not job.quick or surface != each.surface
    }  # fmt: skip
    steepest = degrees(atan(float(job.settings["world.friction"]))) - 90.0
    inside = [min(each.angle - steepest, -90.0 - steepest - each.angle) for each in skills]
    angles = np.array([each.angle for each in skills]).reshape(len(pairs), len(shown))
    apart = float(np.ptp(angles, axis=1).max())
    good, count = sum(r.good for r in reached.values()), sum(len(r.result.success) for r in reached.values())
    return RowResult(
        ours=f"push at {_span(angles[:, 0])} degrees taught on wood"
        + (f", {_span(angles[:, 1])} on styrofoam" if len(shown) > 1 else "")
        + f"; {good} of {count} runs end in the corner",
        verdict="pass" if min(inside) > 0.0 and apart <= 10.0 and good == count else "fail",
        pictures=[_picture(job, skills[0], {s: reached[0, s].result for s in surfaces if (0, s) in reached})],
        head=("operator", "taught on", "push [degrees]", "inside by [degrees]",
              *(f"runs on {each}" for each in surfaces)),
        rows=[
            (str(each.pair + 1), each.surface, f"{each.angle:.1f}", f"{margin:.1f}",
             *(_words(reached[i, surface]) if (i, surface) in reached else "-" for surface in surfaces))
            for i, (each, margin) in enumerate(zip(skills, inside, strict=True))
        ],
        values={"apart_deg": apart, "inside_deg": min(inside), "share": good / count},
        difference=f"Operator, master and surfaces (1e6 and 3e4 N/m) are ours. Pushes from {steepest:.1f} to "
        f"{-90.0 - steepest:.1f} degrees slide on stack and stop; LMC takes the middle of what the demonstrations "
        f"allow, wherever in there the operator aims ({job.settings['operator.angle_deg']:g} degrees here). "
        f"{sum(each.redrawn for each in skills)} demonstrations were redrawn.",
    )  # fmt: skip


def _machine(rng: np.random.Generator) -> dict[str, float]:
    return {
        "actuator.friction_scale": 1.0 + FRICTION * rng.uniform(-1.0, 1.0),
        "robot.mass_scale": 1.0 + MASS * rng.uniform(-1.0, 1.0),
    }


def _teach(job: RowRun, pair: int, surface: str) -> Taught:
    """Two demonstrations, onto the stack and against the stop, and their LMC."""
    kind, robot = registry().skill("lmc"), load_robot_model(ROBOT)
    near = {"above": 0.25, "away": 0.3}  # half-way to the start of runs
    world = load_world(WORLD, {**near, "surface": surface, "friction": job.settings["world.friction"]})
    scene = aimed(robot, world, radians(float(job.settings["operator.angle_deg"])))
    settings = OperatorSettings(delay_s=float(job.settings["operator.delay_s"]))
    seed, machine = 1000 * job.seed + pair, _machine(np.random.default_rng([job.seed, pair]))
    found = record_operated(robot, scene, settings, count=2, seed=seed, draws=machine)
    document = learned(kind, found.demonstrations, LearnOptions(settings=LEARN))
    made = Taught(pair, surface, found.demonstrations, len(found.rejected), document)
    job.tell(f"operator {pair + 1}, taught on {surface}: push at {made.angle:.1f} degrees")
    return made


def _run(job: RowRun, skill: Taught, surface: str) -> Reached:
    starts = STARTS[: job.count(len(STARTS), 1)]
    rngs = [np.random.default_rng([job.seed, skill.pair, i, SURFACES.index(surface)]) for i in range(len(starts))]
    machines = [_machine(rng) for rng in rngs]
    draws = {key: np.array([each[key] for each in machines]) for key in machines[0]}
    draws |= {f"start.offset_{axis}": np.array(starts)[:, i] for i, axis in enumerate("xz")}
    scene = load_world(WORLD, {"surface": surface, "friction": job.settings["world.friction"]})
    behaviour, setup = prepare(load_robot_model(ROBOT), scene, skill.document)
    result = simulate(behaviour, setup, draws, rngs, duration_s=40.0, trace_hz=20.0)
    good = int((result.success & (result.peak_force_n < 12e3)).sum())  # N
    job.tell(f"operator {skill.pair + 1}, taught on {skill.surface}, run on {surface}: {good} of {len(starts)}")
    return Reached(good, result)


def _span(angles: Float) -> str:
    low, high = f"{angles.min():.1f}", f"{angles.max():.1f}"
    return low if low == high else f"{low} to {high}"


def _words(reached: Reached) -> str:
    result = reached.result
    why = next((f"; {text}" for text in result.failure if text), "")
    return f"{reached.good} of {len(result.success)}, at most {1e-3 * result.peak_force_n.max():.1f} kN{why}"


def _picture(job: RowRun, skill: Taught, results: Mapping[str, Result]) -> Illustration:
    """Taught and run paths of the tool in the crane's plane, with stack and stop."""
    from matplotlib.figure import Figure
    from skillframe_segmenter.drawing import BLUE, GREY, INK, RED, svg

    figure = Figure(figsize=(8.6, 4.2))
    taught_on, run_on = figure.subplots(1, 2, sharex=True, sharey=True)
    home = nominal_fixture(load_robot_model(ROBOT)).position
    for i, each in enumerate(skill.demonstrations):
        x, _, z = (each.position - home).T
        taught_on.plot(x, z, color=(BLUE, RED)[i], label=("taught on the stack", "taught on the stop")[i])
    for surface, result in results.items():
        colour = (INK, RED)[SURFACES.index(surface)]
        for i, trace in enumerate(result.traces or []):
            x, _, z = (trace.position - home).T
            run_on.plot(x, z, color=colour, label=f"run on {surface}" if i == 0 else None)
    for canvas in (taught_on, run_on):
        canvas.axhline(CORNER[1], color=GREY, lw=0.8, zorder=0)
        canvas.axvline(CORNER[0], color=GREY, lw=0.8, zorder=0)
        canvas.set(xlabel="x [m]", aspect="equal")
        canvas.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    taught_on.set_ylabel("z [m]")
    angle, tail = radians(skill.angle), np.array([-0.05, 0.85])
    tip = tail + 0.15 * np.array([np.cos(angle), np.sin(angle)])
    taught_on.annotate("", tip, tail, arrowprops={"arrowstyle": "->", "color": INK})
    caption = (
        f"Middle of the tool, taught on {skill.surface} and run; grey: where it touches stack and stop. Arrow: the "
        "learned push. In styrofoam the push takes the tool deeper than the untouched surfaces."
    )
    return Illustration("The crane taught and running on pallets", caption, svg(figure))
