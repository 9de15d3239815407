"""Insertions for the rows of the two-arm paper: configurations, tilts, joint friction, heights, parts.

Computed once for all rows, those that differ only in configuration, tilt and joint friction side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from skillframe_dualarm.document import Arm, Phase, configured, relative

from skillframe.execution import load_robot_model, load_world
from skillframe.extend import RowRun
from skillframe_papers.rows.insertion import POSTURES, Asked, Row, insert, largest, raised, side_by_side, sticking

NAMES = ("A", "B", "C", "D", "E", "E*")
QUICK_NAMES = NAMES[1:5]
"""A has other centres of compliance and takes its own simulation."""
COARSE = (4.0, 8.0, 12.0)
"""Tilts of everything [degrees]."""
HEIGHTS_M = (0.70, 0.75, 0.80)
"""Of the fixture over the floor; the middle one is the robot's."""
PARTS_DEG = (8.0, 12.0)
SECONDS, QUICK_SECONDS = 12.0, 7.5


class Sweep(NamedTuple):
    """Insertions by configuration.

    Attributes:
        rows: by posture, too: both signs, upright with both joint frictions, mirrored with joint friction.
        stiff: the nonzero joint friction [Nm].
        heights: with joint friction, by the fixture's height [m], the robot's included.
        beyond: without joint friction, at tilts past the end of `rows`.
        parts: with joint friction, by friction of the parts, the world's included.
        bottom: at +8 and -8 degrees with joint friction, to the bottom of the hole.
    """

    rows: dict[tuple[str, str], list[Row]]
    stiff: float
    heights: dict[tuple[str, float], list[Row]]
    beyond: dict[str, list[Row]]
    parts: dict[tuple[str, float], list[Row]]
    bottom: dict[str, list[Row]]

    def of(self, name: str, posture: str = "upright", *, stuck: bool) -> list[Row]:
        """Rows of a configuration, with joint friction or without."""
        return [r for r in self.rows[name, posture] if (r.joint_friction > 0.0) == stuck]

    def reach(self, name: str, sign: int, posture: str = "upright", *, stuck: bool) -> float:
        """Largest tilt of a sign up to which all succeed [degrees]."""
        return largest(self.of(name, posture, stuck=stuck), sign, self.stiff if stuck else 0.0)

    def reach_at(self, name: str, sign: int, height: float) -> float:
        """The same with joint friction, upright, at a fixture height [m]."""
        return largest(self.heights[name, height], sign, self.stiff)

    def reach_free(self, name: str, sign: int) -> float:
        """The same without joint friction, upright, up to the last tilt of `beyond`."""
        return largest([*self.of(name, stuck=False), *self.beyond.get(name, [])], sign, 0.0)

    @property
    def names(self) -> list[str]:
        """Computed configurations."""
        return [n for n in NAMES if (n, "upright") in self.rows]

    @property
    def postures(self) -> list[str]:
        """Computed postures."""
        return [p for p in POSTURES if ("B", p) in self.rows]

    @property
    def heights_run(self) -> list[float]:
        """Computed heights of the fixture [m]."""
        return sorted({height for _, height in self.heights})


def sweep(job: RowRun) -> Sweep:
    """Insertions for a row's settings, cached."""
    return _computed(tuple(sorted(job.settings.items())), job.seed, job.quick)


def both(tilts: Sequence[float]) -> list[float]:
    """Tilts of both signs, + first."""
    return [sign * tilt for sign in (1.0, -1.0) for tilt in tilts]


@cache
def _computed(settings: tuple[tuple[str, float], ...], seed: int, quick: bool) -> Sweep:
    values = dict(settings)
    run = _Runs(values, seed, QUICK_SECONDS if quick else SECONDS)
    stiff, own = values["robot.joint_friction"], values["world.friction"]
    names, all_names = (QUICK_NAMES, QUICK_NAMES) if quick else (NAMES[:5], NAMES)
    coarse, small = both(COARSE), both(PARTS_DEG)
    asked = {(n, "coarse"): (coarse, [0.0, stiff]) for n in all_names}
    if quick:  # without joint friction all insert; the rows need 8 degrees
        asked |= {(n, "coarse"): (coarse, [stiff]) for n in names}
        asked |= {(n, "free"): (both(COARSE[1:2]), [0.0]) for n in names}
    if not quick:
        asked |= {(n, "between"): (both((6.0, 10.0, 14.0)), [stiff]) for n in names}  # degrees, upright
        asked |= {(n, "beyond"): (both((16.0, 20.0, 24.0)), [0.0]) for n in names}  # degrees, beyond the sweep's end
    done = run(asked)
    rows = {
        (n, POSTURES[0]): done.get((n, "free"), []) + done[n, "coarse"] + done.get((n, "between"), [])
        for n in all_names
    }
    stuck = {n: [r for r in rows[n, POSTURES[0]] if r.joint_friction > 0.0] for n in names}
    heights = {(n, HEIGHTS_M[1]): stuck[n] for n in names}
    parts = {(n, own): [r for r in stuck[n] if abs(r.tilt_deg) in PARTS_DEG] for n in names}
    beyond: dict[str, list[Row]] = {}
    bottom: dict[str, list[Row]] = {}
    if not quick:
        beyond = {n: done[n, "beyond"] for n in names}
        # friction of the parts, beside the world's
        parts |= {(n, f): found for f in (0.05, 0.4) for n, found in run.each(names, small, stiff, parts=f).items()}
        mirrored = run.each(names, coarse, stiff, posture=POSTURES[1])
        rows |= {(n, POSTURES[1]): found for n, found in mirrored.items()}
        heights |= {
            (n, h): found for h in (HEIGHTS_M[0], HEIGHTS_M[2])
            for n, found in run.each(names, coarse, stiff, height=h).items()
        }  # fmt: skip
        bottom = run.each(names, [8.0, -8.0], stiff, to_the_bottom=True)
    return Sweep(rows, stiff, heights, beyond, parts, bottom)


class _Runs(NamedTuple):
    """Insertions with a row's settings."""

    values: Mapping[str, float]
    seed: int
    seconds: float

    def __call__(
        self, asked: Mapping[tuple[str, str], tuple[Sequence[float], Sequence[float]]], *, posture: str = "upright",
        height: float | None = None, parts: float | None = None, to_the_bottom: bool = False,
    ) -> dict[tuple[str, str], list[Row]]:  # fmt: skip
        """Tilts and frictions of configurations, named first in the key, side by side."""
        robot = load_robot_model("dual_panda")
        robot = robot if height is None else raised(robot, height)
        scene = load_world("dual_peg", {"friction": self.values["world.friction"] if parts is None else parts})
        found = side_by_side(
            robot, scene, [Asked(phase_of(n, scene.tool.frames, self.values), *how) for (n, _), how in asked.items()],
            posture=posture, seed=self.seed, duration_s=self.seconds, to_the_bottom=to_the_bottom,
        )  # fmt: skip
        return dict(zip(asked, found, strict=True))

    def each(self, names: Sequence[str], tilts: Sequence[float], stiff: float, **where: Any) -> dict[str, list[Row]]:
        """The same tilts of several configurations with joint friction, by name."""
        return {n: found for (n, _), found in self({(n, ""): (tilts, [stiff]) for n in names}, **where).items()}


@cache
def stuck_in(settings: tuple[tuple[str, float], ...], seed: int, arm: int, quick: bool) -> list[Row]:
    """Configuration C at 4 (not quick) and 8 degrees of both signs, joint friction in one arm: 0 master, 1 slave."""
    values = dict(settings)
    robot = sticking(load_robot_model("dual_panda"), arm)
    scene = load_world("dual_peg", {"friction": values["world.friction"]})
    phase = phase_of("C", scene.tool.frames, values)
    stiff, tilts = [values["robot.joint_friction"]], both([8.0] if quick else [4.0, 8.0])
    return insert(robot, scene, phase, tilts, stiff, seed=seed, duration_s=5.0 if quick else SECONDS)


def phase_of(name: str, frames: dict[str, Any], values: Mapping[str, float]) -> Phase:
    """A configuration of `NAMES`, "E*" for the relative task of E, with the row's settings."""
    arm = Arm(center_of_compliance=frames["tip"], share=1.0), Arm(center_of_compliance=frames["tip"])
    phase = Phase(arms=arm, lead_force_n=values["lead_force_n"], speed=values["speed"])
    made = configured(phase, name[0], frames)
    return relative(made) if name.endswith("*") else made
