"""One run after the other: the 3-D replay, stills, events, plots, and the demonstrations it was learned from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skillframe.reports import peaks
from skillframe.reports.machine import machine_plots
from skillframe.reports.markup import Markup, data_uri, figure, join, json_script, note, number, table, tag
from skillframe.reports.motors import said_of_motors
from skillframe.reports.plots import demonstration_plots, events_of, run_plots
from skillframe.reports.quantities import quantity
from skillframe.reports.raster import Image, draw, png
from skillframe.reports.replay import run_data, scene_data, scene_key, viewer
from skillframe.reports.scores import said_of
from skillframe.reports.second import told_of_second
from skillframe.reports.sources import Chapter, Run
from skillframe.reports.stage import Camera, Stage, stage_of

STILL_WIDTH, STILL_HEIGHT = 560, 420
STILLS_NOTE = "Stills are drawn without OpenGL, as a shaded wireframe with hidden lines removed; fixtures are cut open."


def runs_section(chapter: Chapter, prefix: str, scenes: dict[str, Markup]) -> Markup:
    """The runs of a chapter.

    Args:
        chapter: with its traces.
        prefix: for identifiers, unique on the page.
        scenes: geometry blocks by key, filled here and placed once on the page.
    """
    if not chapter.runs:
        return note("There is no trace here, so there is no replay.")
    blocks = [
        run_block(run, f"{prefix}-run{i}", scenes, chapter.force_limit) for i, run in enumerate(chapter.runs, start=1)
    ]
    hidden = chapter.traces - len(chapter.runs)
    more = (
        note(f"{hidden} more traces are in the folder; give them to skillframe report by name to see them.")
        if hidden > 0
        else ""
    )
    return join([*blocks, more])


def run_block(run: Run, identifier: str, scenes: dict[str, Markup], force_limit: float | None = None) -> Markup:
    """One run."""
    meta, stage = run.trace.meta, stage_of(run.trace)
    won = bool(meta.get("success"))
    badge = tag("span", "success" if won else "failure", class_="badge won" if won else "badge lost")
    head = tag("header", tag("h3", _title(run), " ", badge), tag("p", _story(meta), class_="caption"),
               tag("p", run.why, class_="caption") if run.why else "")  # fmt: skip
    show = (
        _show(run, stage, identifier, scenes)
        if stage
        else note("This trace holds no geometry, so it can only be plotted.")
    )
    plots = [*run_plots(run.trace, force_limit), *machine_plots(run.trace)]
    beside = tag("div", show, tag("div", *plots[:2], class_="plots"), class_="stagebox")
    said = [note(str(text)) for text in meta.get("notes") or []]
    return tag(
        "article", head, *said, beside, tag("div", *plots[2:], class_="stagebox"), _stills(run, stage), class_="run"
    )


def _title(run: Run) -> str:
    meta = run.trace.meta
    name = str(meta.get("skill") or run.name)
    return f"{name}, trial {meta['trial']}" if meta.get("trial") is not None else name


def _story(meta: Mapping[str, Any]) -> str:
    where = " in ".join(str(meta[k]) for k in ("robot", "world") if meta.get(k))
    takes = (meta.get("interface") or {}).get("takes", "torque")
    where += "" if takes == "torque" else f", told a {takes}"
    facts = [where, str((not meta.get("success") and meta.get("failure")) or meta.get("reason") or "")]
    if isinstance(meta.get("duration_s"), int | float):
        facts.append(f"took {_figure(float(meta['duration_s']))} s")
    facts.append(", ".join(peaks.said(meta, _figure)))
    if isinstance(meta.get("final_error_m"), int | float):
        facts.append(f"final error {_figure(1e3 * float(meta['final_error_m']))} mm")
    facts += [*told_of_second(meta.get("second") or {}), *said_of_motors(meta), *said_of(meta)]
    drawn = [_draw_text(name, value) for name, value in sorted((meta.get("draws") or {}).items())]
    how = "Set for this run" if meta.get("trial") is None else "Drawn for this trial"
    return "; ".join(f for f in facts if f) + "." + (f" {how}: {', '.join(drawn)}." if drawn else "")


def _figure(value: float) -> str:
    """A measured figure. Below a hundredth of a millimetre, of a second or of a newton nothing is known."""
    return number(value) if value >= 0.01 or not math.isfinite(value) else "< 0.01"


def _draw_text(name: str, value: Any) -> str:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return f"{quantity(name).label} {value}"
    q = quantity(name)
    return f"{q.label} {number(q.factor * float(value))} {q.unit}".strip()


def _show(run: Run, stage: Stage, identifier: str, scenes: dict[str, Markup]) -> Markup:
    geometry = scene_data(stage)
    key = scene_key(geometry)
    scenes.setdefault(key, json_script(key, geometry))
    label = f"3-D replay of {_title(run)}; drag to turn, pinch or scroll to zoom"
    return tag(
        "div",
        viewer(identifier, label),
        _events(run),
        json_script(identifier, run_data(run.trace, stage, key)),
        class_="show",
    )


def _events(run: Run) -> Markup:
    events = events_of(run.trace)
    if not events:
        return Markup("")
    rows = [(i, f"{when:.2f} s", what) for i, (when, what) in enumerate(events, start=1)]
    return tag("div", table(("", "time", "event"), rows, numeric=9), class_="events")


def _stills(run: Run, stage: Stage | None) -> Markup:
    if stage is None:
        return Markup("")
    last = len(run.trace.time) - 1
    frames = {"start": 0, "middle": last // 2, "end": last}
    pictures = [_still(stage, name, frame, float(run.trace.time[frame])) for name, frame in frames.items()]
    return join([tag("div", *pictures, class_="stills"), tag("p", STILLS_NOTE, class_="caption")])


def _still(stage: Stage, name: str, frame: int, time: float) -> Markup:
    return figure("", f"{name}, {time:.2f} s", still_image(stage, frame, f"The scene at {time:.2f} s"))


def still_image(stage: Stage, frame: int, alt: str) -> Markup:
    """A picture of the stage at a sample, close, cut open, for a page."""
    image = png(still(stage, frame, stage.close, STILL_WIDTH, STILL_HEIGHT))
    return tag("img", src=data_uri("image/png", image), alt=alt, width=STILL_WIDTH, height=STILL_HEIGHT)


def still(stage: Stage, frame: int, camera: Camera, width: int, height: int) -> Image:
    """A picture (height, width, 4) of the stage at a sample, fixtures near the tip cut open."""
    meshes = [
        stage.placed(b, frame) if cut is None else cut.placed(stage.position[frame, b], stage.quaternion[frame, b])
        for b, cut in enumerate(stage.cut)
    ]
    return draw(meshes, camera, width, height)


def cover(chapter: Chapter) -> Markup:
    """A picture for the chapter's first screen: the first run's scene, half way."""
    stage = stage_of(chapter.runs[0].trace) if chapter.runs else None
    if stage is None:
        return Markup("")
    return tag("div", still_image(stage, len(stage.tip) // 2, "The tool and the fixture"), class_="cover")


def demonstrations_section(chapter: Chapter) -> Markup:
    """Plots of each demonstration."""
    if not chapter.demonstrations:
        return note("The folder keeps no demonstrations.")
    blocks = []
    for name, demonstration in chapter.demonstrations.items():
        seconds = f"{number(demonstration.duration)} s at {number(demonstration.rate)} Hz"
        blocks.append(
            tag(
                "article",
                tag("h3", name, " ", tag("span", seconds, class_="badge")),
                tag("div", demonstration_plots(demonstration), class_="grid three"),
            )
        )
    lead = (
        "What the teacher did: the environment's force on the tool and the tool's motion since the start, in base axes."
    )
    return join([tag("p", lead, class_="lead"), *blocks])
