"""Rows of the hydraulic crane: what its model alone can answer, and what is not run here.

Holding forces follow from gravity at rest, F = J_p^-T g(z), and pressures from F = p_a A_a - p_b A_b.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from skillframe.records import RowResult, RowRun, RowType

START = (math.pi / 4, -math.pi / 2, 0.5)
PRESSURES = {"lift": (130.0e5, 30.9148e5), "tilt": (90.0e5, 35.7169e5)}  # [Pa], published start values
LOOP = "the crane's co-simulated run is not part of this command yet"


def row_types() -> Iterable[RowType]:
    """The rows 19 to 22."""
    yield _absent("19", "the crane learns and reproduces in contact, stiff and soft", "demonstrated, no figures",
                  "IROS 2018 (abstract)")  # fmt: skip
    yield _absent("20", "contact force from chamber pressures while moving", "4.1 % at 8000 N",
                  "Koivumäki and Mattila, T-RO 2015 (abstract)")  # fmt: skip
    yield RowType(
        name="21", summary="pressures that hold the crane at its start", published="130/30.9 and 90/35.7 bar",
        source="HydraulicManipulatorVDC, start values of the simulation", bar="net piston forces within 2 %",
        settings={"robot.payload": 475.0, "cylinder.bore": 0.080, "cylinder.rod": 0.045}, run=_holding,
    )  # fmt: skip
    yield _absent("22", "diamond path of 30 s with model errors of 10 %", "no figure found",
                  "HydraulicManipulatorVDC")  # fmt: skip


def _absent(name: str, summary: str, published: str, source: str) -> RowType:
    def run(job: RowRun) -> RowResult:
        return RowResult(ours="not run here", difference=f"Not computed: {LOOP}.", computed=False)

    return RowType(name=name, summary=summary, published=published, source=source, run=run)


def _holding(job: RowRun) -> RowResult:
    """Net piston forces at rest against those of the published pressures."""
    import numpy as np

    from skillframe.robot.loops import ClosedChain
    from skillframe.robot.model import load_model
    from skillframe.robot.payload import with_payload
    from skillframe.robot.spec import load_robot

    bore, rod, payload = (float(job.settings[k]) for k in ("cylinder.bore", "cylinder.rod", "robot.payload"))
    area_a = math.pi / 4.0 * bore**2
    area_b = area_a - math.pi / 4.0 * rod**2
    robot = load_model(with_payload(load_robot("hiab_xs031"), payload))
    force = ClosedChain(robot).at(np.array(START), np.zeros(3)).holding_force()
    rows, off = [], []
    for mine, (name, (a, b)) in zip(force, PRESSURES.items(), strict=False):
        theirs = a * area_a - b * area_b
        off.append(float(mine) / theirs - 1.0)
        rows.append((name, f"{theirs / 1e3:.2f} kN", f"{mine / 1e3:.2f} kN", f"{100.0 * off[-1]:+.1f} %"))
    worst = max(abs(x) for x in off)
    return RowResult(
        ours=", ".join(f"{row[0]} {row[2]} ({row[3]})" for row in rows), verdict="pass" if worst <= 0.02 else "fail",
        difference="The published pressures are start values of a simulation, not an equilibrium.",
        values={"lift_off": off[0], "tilt_off": off[1]}, head=("cylinder", "published", "ours", "off"), rows=rows,
    )  # fmt: skip
