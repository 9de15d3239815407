"""Runs of a chapter: 3-D replay, stills, events, plots, and demonstrations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skillframe.execution import joint_shares, peak_forces, second_parts
from skillframe_reports.demonstration_curves import axis, lanes_of
from skillframe_reports.markup import Markup, data_uri, figure, join, json_script, note, number, table, tag
from skillframe_reports.plots import DOUBT_CAPTION, doubted, drive_plots, events_of, run_plots
from skillframe_reports.quantities import quantity
from skillframe_reports.raster import Image, draw, png
from skillframe_reports.replay import run_data, scene_data, scene_key, viewer
from skillframe_reports.scores import said_of
from skillframe_reports.sources import Chapter, Run
from skillframe_reports.stage import Camera, Stage, stage_of

STILL_WIDTH, STILL_HEIGHT = 560, 420
STILLS_NOTE = "Stills are drawn without OpenGL, as a shaded wireframe with hidden lines removed; fixtures are cut open."


def runs_section(chapter: Chapter, prefix: str, scenes: dict[str, Markup]) -> Markup:
    """Return the runs of a chapter."""
    if not chapter.runs:
        return note("There is no trace here, so there is no replay.")
    blocks = [
        run_block(run, f"{prefix}-run{i}", scenes, chapter.force_limit) for i, run in enumerate(chapter.runs, start=1)
    ]
    hidden = chapter.traces - len(chapter.runs)
    if hidden > 0:
        more = f"{hidden} more traces are in the folder; give them to skillframe report by name to see them."
        blocks.append(note(more))
    return join(blocks)


def run_block(run: Run, identifier: str, scenes: dict[str, Markup], force_limit: float | None = None) -> Markup:
    """Return one run."""
    meta, stage = run.trace.meta, stage_of(run.trace)
    won = bool(meta.get("success"))
    badge = tag("span", "success" if won else "failure", class_="badge won" if won else "badge lost")
    head = tag("header", tag("h3", _title(run), " ", badge), tag("p", _story(meta), class_="caption"),
               tag("p", run.why, class_="caption") if run.why else "")  # fmt: skip
    show, stills = note("This trace holds no geometry, so it can only be plotted."), Markup("")
    if stage:
        geometry = scene_data(stage)
        key = scene_key(geometry)
        scenes.setdefault(key, json_script(key, geometry))
        events = [(i, f"{when:.2f} s", what) for i, (when, what) in enumerate(events_of(run.trace), start=1)]
        listed = tag("div", table(("", "time", "event"), events, numeric=9), class_="events") if events else ""
        label = f"3-D replay of {_title(run)}; drag to turn, pinch or scroll to zoom"
        data = json_script(identifier, run_data(run.trace, stage, key))
        show = tag("div", viewer(identifier, label), listed, data, class_="show")
        last = len(run.trace.time) - 1
        pictures = [
            figure("", f"{name}, {at}", still_image(stage, frame, f"The scene at {at}"))
            for name, frame in (("start", 0), ("middle", last // 2), ("end", last))
            for at in [f"{run.trace.time[frame]:.2f} s"]
        ]
        stills = join([tag("div", *pictures, class_="stills"), tag("p", STILLS_NOTE, class_="caption")])
    plots = [*run_plots(run.trace, force_limit), *drive_plots(run.trace)]
    beside = tag("div", show, tag("div", *plots[:2], class_="plots"), class_="stagebox")
    said = [note(str(text)) for text in meta.get("notes") or []]
    return tag("article", head, *said, beside, tag("div", *plots[2:], class_="stagebox"), stills, class_="run")


def _title(run: Run) -> str:
    meta = run.trace.meta
    name = str(meta.get("skill") or run.name)
    return f"{name}, trial {meta['trial']}" if meta.get("trial") is not None else name


def _story(meta: Mapping[str, Any]) -> str:
    where = " in ".join(str(meta[k]) for k in ("robot", "world") if meta.get(k))
    takes = (meta.get("interface") or {}).get("takes", "torque")
    where += "" if takes == "torque" else f", with {takes} commands"
    facts = [where, str((not meta.get("success") and meta.get("failure")) or meta.get("reason") or "")]
    if isinstance(meta.get("duration_s"), int | float):
        facts.append(f"took {_figure(float(meta['duration_s']))} s")
    facts.append(", ".join(peak_forces(meta, _figure)))
    if isinstance(meta.get("final_error_m"), int | float):
        facts.append(f"final error {_figure(1e3 * float(meta['final_error_m']))} mm")
    facts += [*second_parts(meta.get("second") or {}), *joint_shares(meta), *said_of(meta)]
    drawn = []
    for name, value in sorted((meta.get("draws") or {}).items()):
        q, plain = quantity(name), isinstance(value, bool) or not isinstance(value, int | float)
        amount = f"{value}" if plain else f"{number(q.factor * float(value))} {q.unit}".strip()
        drawn.append(f"{q.label} {amount}")
    how = "Set for this run" if meta.get("trial") is None else "Sampled for this trial"
    return "; ".join(f for f in facts if f) + "." + (f" {how}: {', '.join(drawn)}." if drawn else "")


def _figure(value: float) -> str:
    """A figure. Values below a hundredth of its unit are beyond measurement."""
    return number(value) if value >= 0.01 or not math.isfinite(value) else "< 0.01"


def still_image(stage: Stage, frame: int, alt: str) -> Markup:
    """Return an image of the stage at a sample, close and cut open."""
    image = png(still(stage, frame, stage.close, STILL_WIDTH, STILL_HEIGHT))
    return tag("img", src=data_uri("image/png", image), alt=alt, width=STILL_WIDTH, height=STILL_HEIGHT)


def still(stage: Stage, frame: int, camera: Camera, width: int, height: int) -> Image:
    """Return a picture (height, width, 4) of the stage at a sample, with fixtures near the tip cut open."""
    meshes = [
        stage.placed(b, frame) if cut is None else cut.placed(stage.position[frame, b], stage.quaternion[frame, b])
        for b, cut in enumerate(stage.cut)
    ]
    return draw(meshes, camera, width, height)


def cover(chapter: Chapter) -> Markup:
    """Return a picture of the first run's scene, half way."""
    stage = stage_of(chapter.runs[0].trace) if chapter.runs else None
    if stage is None:
        return Markup("")
    return tag("div", still_image(stage, len(stage.tip) // 2, "The tool and the fixture"), class_="cover")


def demonstrations_section(chapter: Chapter) -> Markup:
    """Return plots of each demonstration."""
    if not chapter.demonstrations:
        return note("The folder keeps no demonstrations.")
    lead = "What the teacher did: the tool's motion since the start and the environment's force on it, in base axes."
    blocks = [tag("p", lead, class_="lead")]
    for name, demonstration in chapter.demonstrations.items():
        seconds = f"{number(demonstration.duration)} s at {number(demonstration.rate)} Hz"
        ends = (float(demonstration.time[0]), float(demonstration.time[-1]))
        drawn = tag("div", *lanes_of(demonstration), axis(*ends), class_="lanes")
        unsure = doubted(demonstration.extra)
        said = tag("p", DOUBT_CAPTION, class_="caption") if unsure is not None and unsure.any() else ""
        title = tag("h3", name, " ", tag("span", seconds, class_="badge"))
        blocks.append(tag("article", title, tag("div", drawn, said, class_="card plain")))
    return join(blocks)
