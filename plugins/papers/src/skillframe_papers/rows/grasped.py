"""Rows 43 and 44: two arms with a peg tilted in its grasp, the paper's pose error.

Rows 7 to 12 tilt the peg's arm and its commands too. Here the arm moves along the hole, and the peg alone is tilted
about its tip.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from skillframe.execution import load_robot_model, load_world
from skillframe.extend import RowResult, RowRun
from skillframe_papers.rows.insertion import PUBLISHED, Asked, Row, in_the_grasp, largest, raised, side_by_side
from skillframe_papers.rows.sweep import COARSE, HEIGHTS_M, SECONDS, both, phase_of

NAMES, QUICK_NAMES = ("A", "B", "C", "D", "E"), ("B", "E")
QUICK_DEG = COARSE[::2]
OWN_M = HEIGHTS_M[1]


class Grasped(NamedTuple):
    """Insertions by fixture height [m] and configuration, of both signs, and their joint friction [Nm]."""

    rows: dict[float, dict[str, list[Row]]]
    stiff: float

    def reach(self, height: float, name: str, sign: int) -> float:
        """Largest tilt of a sign up to which all are inserted [degrees]."""
        return largest(self.rows[height][name], sign, self.stiff)

    def worst(self, name: str) -> float:
        """The smaller of both signs at the robot's own height [degrees]."""
        return min(self.reach(OWN_M, name, sign) for sign in (1, -1))


def _grasped(job: RowRun) -> Grasped:
    return _computed(tuple(sorted(job.settings.items())), job.seed, job.quick)


@cache
def _computed(settings: tuple[tuple[str, float], ...], seed: int, quick: bool) -> Grasped:
    values, names = dict(settings), QUICK_NAMES if quick else NAMES
    stiff, tilts = values["robot.joint_friction"], both(QUICK_DEG if quick else COARSE)
    robot, scene = load_robot_model("dual_panda"), load_world("dual_peg", {"friction": values["world.friction"]})
    asked = [Asked(phase_of(name, scene.tool.frames, values), tilts, [stiff]) for name in names]
    rows = {
        height: dict(zip(names, side_by_side(
            raised(robot, height), scene, asked, seed=seed, duration_s=7.5 if quick else SECONDS,
            tilted=in_the_grasp,
        ), strict=True))
        for height in ((OWN_M,) if quick else HEIGHTS_M)
    }  # fmt: skip
    return Grasped(rows, stiff)


def table(job: RowRun) -> RowResult:
    """Row 43: Table I, tilts in the grasp."""
    found = _grasped(job)
    own = found.rows[OWN_M]
    off = {
        height: [n for n in rows if abs(found.reach(height, n, 1) - PUBLISHED[n]["largest_deg"]) > 4.0]  # degrees
        for height, rows in found.rows.items()
    }
    said = "; ".join(f"{' and '.join(names) or 'none'} at {height:.2f} m" for height, names in off.items())
    reach = ", ".join(f"{name} {found.reach(OWN_M, name, 1):g}" for name in own)
    return RowResult(
        ours=f"{reach} degrees at {found.stiff:g} Nm, + sign, {OWN_M:.2f} m; not as published: {said}",
        verdict="fail" if any(off.values()) else "pass",
        head=("largest tilt [degrees]", "published", *(f"fixture at {height:.2f} m, + / -" for height in found.rows)),
        rows=[
            (name, f"{PUBLISHED[name]['largest_deg']:g}",
             *(" / ".join(f"{found.reach(height, name, sign):g}" for sign in (1, -1)) for height in found.rows))
            for name in own
        ],
        difference=f"Tilts of {', '.join(f'{t:g}' for t in (QUICK_DEG if job.quick else COARSE))} degrees, both signs. "
        "Null: the same tilts of the whole arm at the start, which is row 7.",
        values={name: found.reach(OWN_M, name, 1) for name in own},
    )  # fmt: skip


def best(job: RowRun) -> RowResult:
    """Row 44: both arms compliant reach furthest, and in less time, with less motion and less force."""
    found = _grasped(job)
    own = found.rows[OWN_M]
    others = [name for name in own if name != "E"]
    beaten = {name: _beaten(own["E"], own[name]) for name in others}
    less, count = (sum(pair[i] for pair in beaten.values()) for i in (0, 1))
    further = all(found.worst("E") >= found.worst(name) for name in others)
    return RowResult(
        ours=f"E inserts up to {found.worst('E'):g} degrees of both signs, the best other up to "
        f"{max(found.worst(n) for n in others):g}; faster, with less motion and less force in {less} of {count} "
        "insertions of the others; the tilt in the grasp was chosen after tilts at the start had missed",
        verdict="pass" if further and less == count and count else "fail",
        head=("", *(f"{row.tilt_deg:+g} degrees" for row in own["E"])),
        rows=[(name, *(_told(row) for row in rows)) for name, rows in own.items()],
        difference="Time, way of both arms' joints, largest contact force, to the goal. Null: the same tilts of the "
        "whole arm at the start, where E inserts from none of + sign: rows 7, 9, 10 and 24.",
        values={"largest_deg": found.worst("E"), "less": less / max(count, 1)},
    )  # fmt: skip


def _beaten(ours: list[Row], other: list[Row]) -> tuple[int, int]:
    """Insertions that E does with less of everything, and those of the other configuration."""
    pairs = [(e, o) for e, o in zip(ours, other, strict=True) if o.outcome == "success"]
    return sum(
        e.outcome == "success"
        and (e.time_s < o.time_s and sum(e.joint_path_rad) < sum(o.joint_path_rad) and e.force_n < o.force_n)
        for e, o in pairs
    ), len(pairs)


def _told(row: Row) -> str:
    if row.outcome != "success":
        return row.outcome
    return f"{row.time_s:.1f} s, {sum(row.joint_path_rad):.2f} rad, {row.force_n:.0f} N"
