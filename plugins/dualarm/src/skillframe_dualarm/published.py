"""Rows 7 to 12 of the papers' results as published, and what ours must reach; `rows` computes them."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.records import Lazy, RowType

SOURCE = "Suomalainen, Calinon, Pignat, Kyrki, ICRA 2019"
SETTINGS = {"robot.joint_friction": 0.5, "world.friction": 0.2, "lead_force_n": 30.0, "speed": 0.02}
CALIBRATED = "largest push 30 N, on B and D with joint friction, + sign"


def row_types() -> Iterable[RowType]:
    """The rows of this plug-in."""

    def row(name: str, summary: str, published: str, bar: str, run: str, weak: str = "") -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=SOURCE, bar=bar, calibrated=CALIBRATED, weak=weak,
            settings=SETTINGS, group="two arms", run=Lazy(f"skillframe_dualarm.rows:{run}"),
        )  # fmt: skip

    yield row("7", "two arms insert up to a tilt that depends on who gives way where (Table I)",
              "A 4, B 12, C fails at 4, D 8, E 12 degrees",
              "with joint friction, + sign: each of A to E within 4 degrees (two steps) of the published",
              "table")  # fmt: skip
    yield row("8", "C fails because of static friction in the slave's joints", "C fails at 4 degrees",
              "C at 8 degrees succeeds without joint friction and fails with it", "slave")  # fmt: skip
    yield row("9", "both arms compliant insert in shorter time (from 8 degrees)", "B 26.5 s, D 13.0 s, E 5.0 s",
              "with joint friction, + sign: E inserts in less time than D, and D in less than B", "times")  # fmt: skip
    yield row("10", "both arms compliant insert with less joint motion (from 8 degrees)", "B 1.45, D 0.99, E 0.59 rad",
              "with joint friction, + sign: the joints of E move less than those of D, and D's less than B's",
              "paths")  # fmt: skip
    yield row("11", "the opposite sign of the tilt works as well", "works",
              "without joint friction the signs differ by at most 2 degrees for A to D", "signs",
              "every configuration reaches the end of the sweep there, so the difference is 0 by its ceiling",
              )  # fmt: skip
    yield row("12", "the pair turns the wrong way only at large angles or low friction", "only there",
              "without joint friction A to D never turn as a pair", "failures",
              "all of these trials succeed, E is left out, and the friction of the parts is never varied")  # fmt: skip
