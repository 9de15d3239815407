"""Rows 15 to 18 of the papers' results as published, and what ours must reach; `rows` computes them."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.records import Lazy, RowType

HAGOS = "Hagos, Suomalainen, Kyrki, IROS 2018 (abstract), and the overview paper"
SETTINGS = {"teacher.aim_noise_deg": 8.0, "world.friction": 0.2, "table.moved": 0.03}


def row_types() -> Iterable[RowType]:
    """The rows of this plug-in."""

    def row(name: str, summary: str, published: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=HAGOS, bar=bar, settings=SETTINGS, group="phases",
            run=Lazy(f"skillframe_segmenter.rows:{run}"),
        )  # fmt: skip

    yield row("15", "hose coupler: two phases, lower and interlock", "two phases",
              "two phases and less than 5 % of the time mislabelled, in 90 % of the groups", "hose")  # fmt: skip
    yield row("16", "valley: both sides are one phase, along the valley is the second", "one phase, then a second",
              "two phases, both sides alike, the change within 0.3 s, in 90 % of the groups", "valley")  # fmt: skip
    yield row("17", "wrench-driven transitions do not mind where things stand", "less prone to position error",
              "tables 30 mm off: at least 90 % of changes within 0.3 s, pose-driven less than 20 %, in every world",
              "moved")  # fmt: skip
    yield row("18", "the phase is recognised online by the forward algorithm", "online",
              "new demonstrations: at least 95 % of changes within 0.3 s, no switch elsewhere", "online")  # fmt: skip
