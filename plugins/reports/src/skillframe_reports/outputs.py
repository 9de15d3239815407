"""Writers that `skillframe_outputs` registers for runs, skills, segmentations, scenes and results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from skillframe.errors import InputError
from skillframe.execution import Trace
from skillframe.extend import Explanation, Moment, Segmentation
from skillframe.files import write_whole
from skillframe.frames import Pose, matrix_from_quaternion
from skillframe.world import Scene
from skillframe_reports import cuts
from skillframe_reports.learned import labelled
from skillframe_reports.markup import Markup, data_uri, tag
from skillframe_reports.page import write_report
from skillframe_reports.raster import over_paper, png
from skillframe_reports.runs import still
from skillframe_reports.scene_picture import scene_picture
from skillframe_reports.stage import CLOSE, stage_of
from skillframe_reports.video import write_film

EXPLANATION_STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; color: #1d2025; background: #f6f7f9; margin: 0; }
main { max-width: 60rem; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; }
.headline { font-size: 1.2rem; margin: 0 0 1.5rem; }
.card { background: #fff; border: 1px solid #e1e4e9; border-radius: 10px; padding: 1rem 1.25rem; margin: 1.25rem 0; }
.card h2 { font-size: 1.1rem; margin: 0 0 .75rem; }
.card img { display: block; max-width: 100%; margin: 0 auto; }
.card p, footer { color: #4b515b; font-size: .92rem; }
"""
PICTURE = (960, 720)
"""Width and height of the picture of a moment [pixels]."""
Progress = Callable[[float, float], None]


def replay(trace: Trace, out: Path, progress: Progress) -> str:
    """Write a page with a 3-D replay and plots of a run."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{out.stem}.npz"
        trace.save(file)
        write_report([file], out)
    return ""


def video(trace: Trace, out: Path, progress: Progress) -> str:
    """Write a video of a run and return what drew it."""
    return f"the video was drawn by {write_film(trace, out, progress).renderer}"


def still_file(moment: Moment, out: Path, progress: Progress) -> str:
    """Write a picture of a run at a time, with the fixture near the tip cut open.

    Raises:
        InputError: the trace holds no geometry.
    """
    trace = moment.trace
    stage = stage_of(trace)
    if stage is None:
        raise InputError(out, "cannot be drawn: the trace holds no geometry", "run again")
    last = len(trace.time) - 1
    frame = last if moment.time is None else min(int(np.searchsorted(trace.time, moment.time)), last)
    image = over_paper(still(stage, frame, stage.far if moment.far else stage.close, *PICTURE))
    write_whole(out, png(np.concatenate([image, np.full((*image.shape[:2], 1), 255, np.uint8)], axis=-1)))
    return ""


def report(inputs: Sequence[Path], out: Path, progress: Progress) -> str:
    """Write a report of campaign folders and traces."""
    write_report(inputs, out)
    return ""


def explanation(skill: Explanation, out: Path, progress: Progress) -> str:
    """Write a page that explains a skill."""
    cards = [
        tag(
            "section",
            tag("h2", picture.title),
            tag("img", src=data_uri("image/svg+xml", picture.svg.encode()), alt=picture.title),
            tag("p", picture.caption),
            class_="card",
        )
        for picture in skill.pictures
    ]
    details = tag(
        "section",
        tag("h2", "In words"),
        tag("ul", *(tag("li", *labelled(line)) for line in skill.words[1:])),
        class_="card",
    )
    sources = ", ".join(source["file"] for source in skill.document["learned_from"]) or "nothing"
    made = f"Skill of type {skill.document['type']}, learned from {sources}."
    head = tag(
        "head", Markup('<meta charset="utf-8"/>'), tag("title", skill.title), tag("style", Markup(EXPLANATION_STYLE)),
        Markup('<meta name="viewport" content="width=device-width, initial-scale=1"/>'),
    )  # fmt: skip
    body = tag(
        "main",
        tag("h1", skill.title),
        tag("p", skill.words[0], class_="headline"),
        *cards,
        details,
        tag("footer", made),
    )
    page = "<!doctype html>\n" + tag("html", head, tag("body", body), lang="en")
    write_whole(out, page.encode())
    return ""


def boundaries(cut: Segmentation, out: Path, progress: Progress) -> str:
    """Write a page for editing phase boundaries."""
    write_whole(out, cuts.page(cut.document, cut.words, cut.demonstrations, cut.command).encode("utf-8"))
    return ""


def scene_file(scene: Scene, out: Path, progress: Progress) -> str:
    """Write a picture of a scene cut open, with its tool where runs start."""
    from skillframe.execution import geom_json  # needs MuJoCo, which the other kinds do without

    tip = Pose(np.array(scene.start_tip), matrix_from_quaternion(scene.start_quaternion))
    sprung = (geom for part in scene.sprung for geom in part.geoms)
    fixture, tool = (
        [geom_json(geom) for geom in geoms if geom.visible] for geoms in ((*scene.fixture, *sprung), scene.tool.geoms)
    )
    reach = max(CLOSE, 1.5 * float(np.linalg.norm(tip.position)))  # a start far from the origin is in the picture
    write_whole(out, scene_picture(fixture, tool, tip.at(-np.array(scene.tool.frames["tip"])), reach))
    return ""
