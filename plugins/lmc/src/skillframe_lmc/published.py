"""Rows 1 to 6 of the papers' results as published, and what ours must reach; `rows` computes them."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.records import Lazy, RowType

SEED = "the overview paper (Suomalainen), section on learning from force"
PAPER_6 = "Suomalainen, Calinon, Pignat, Kyrki, ICRA 2019"
NOISE = {"teacher.aim_noise_deg": 8.0, "world.friction": 0.2}
VALLEY = {**NOISE, "world.slope_deg": 45.0}
TOPIC = "learning from force"
IGNORED = (
    "the mean direction of the motions, and minus the mean force, which know nothing of sectors, reach it in 20 of 20 "
    "pairs too, because starts and aim are symmetric about the valley"
)


def row_types() -> Iterable[RowType]:
    """The rows of this plug-in."""
    yield RowType(
        name="1", topic=TOPIC,
        summary="the sector of feasible pushes narrows with friction", published="narrower with friction",
        source=SEED, bar="median width within 1 degree of 90 - atan(friction), at three frictions",
        frozen=True, settings={"world.friction": 0.2, "teacher.aim_noise_deg": 3.0},
        run=Lazy("skillframe_lmc.rows:sector_width"),
    )  # fmt: skip
    yield RowType(
        name="2", topic=TOPIC,
        summary="from either side, one push and one free axis slide to the valley's bottom",
        published="slides from any start of the convergence region", source=SEED,
        bar="largest tilt of the push within 2 degrees of slope - atan(friction), both sides",
        frozen=True, settings={"world.friction": 0.2, "world.slope_deg": 45.0},
        run=Lazy("skillframe_lmc.rows:valley_boundary"),
    )  # fmt: skip
    yield RowType(
        name="3", topic=TOPIC,
        summary="the intersection of pyramids is robust to a wavering hand", published="robust to noise",
        source=SEED, bar="a feasible direction from two demonstrations in 95 % of the pairs", weak=IGNORED,
        settings=VALLEY,
        run=Lazy("skillframe_lmc.rows:noise"),
    )  # fmt: skip
    yield RowType(
        name="4", topic=TOPIC,
        summary="hose coupler: a push, no turn; one compliant axis each; aligned from both starts",
        published="translation yes, rotation no; 1 + 1 axes; both starts aligned", source=SEED,
        bar="the same in 95 % of the pairs, and both starts of every pair that is run, steered at the flange",
        settings=NOISE,
        run=Lazy("skillframe_lmc.rows:hose"),
    )  # fmt: skip
    yield RowType(
        name="5", topic=TOPIC,
        summary="peg in hole: push along z, free along x, turns about y",
        published="push z, no turn, axes x and y", source=PAPER_6,
        bar="identical, and the push within 10 degrees of z, in 95 % of the pairs", settings=NOISE,
        run=Lazy("skillframe_lmc.rows:peg"),
    )  # fmt: skip
    yield RowType(
        name="6", topic=TOPIC,
        summary="levering teaches that translation is the environment's", published="3-DoF compliance",
        source=SEED, bar="translation fully compliant, rotation not, in every demonstration", settings=NOISE,
        run=Lazy("skillframe_lmc.rows:levering"),
    )  # fmt: skip
