"""A trace as an MP4 film: the whole scene, the tool's tip close and cut open, and the contact force over time.

Frames are drawn by `skillframe.reports.raster`, so that no graphics library is needed; what stands still is drawn once
and kept. Played back, a second is a second. H.264 in 4:2:0, which browsers and office programs play.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, need
from skillframe.execution.trace import Trace
from skillframe.files import writing_whole
from skillframe.frames import Float, norm
from skillframe.reports.raster import PAPER, Canvas, Image, blank, over_paper, paint, picture
from skillframe.reports.shapes import Mesh
from skillframe.reports.stage import Camera, Stage, stage_of

FRAME_RATE = 25
FAR_WIDTH, CLOSE_WIDTH, HEIGHT, STRIP = 400, 560, 480, 80
QUALITY = "20"  # libx264's constant rate factor: hardly told from the original
SUFFIXES = (".mp4", ".m4v", ".mov")
INK, FAINT, FORCE = (38, 46, 56), (176, 184, 194), (204, 60, 46)
LEFT = 16  # of the force curve [pixels]


class _Pane(NamedTuple):
    """One view: its background with what stands still, and where it lies in the frame."""

    camera: Camera
    background: Canvas
    column: int


def check_film(path: Path) -> None:
    """Refuse, before a run is spent on it, a film that could not be written.

    Raises:
        InputError: the file's name ends in something that is no film.
        MissingDependency: the libraries that write it are not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "is not a name of a film", f"let it end in {' or '.join(SUFFIXES)}")
    for library in ("av", "PIL"):
        need(library)


def write_film(trace: Trace, path: Path, tell: Callable[[int, int], None] = lambda done, total: None) -> int:
    """Write a film of a run, whole or not at all.

    Args:
        trace: the run, with its geometry.
        path: the file to write.
        tell: is told after each frame how many of how many are done.

    Returns:
        number of frames.

    Raises:
        InputError: the trace holds no geometry, or the file cannot be written.
    """
    check_film(path)
    stage = stage_of(trace)
    if stage is None:
        raise InputError(path, "cannot be drawn: the trace holds no geometry", "write the trace again")
    samples = film_samples(np.asarray(trace.time, dtype=float))
    with writing_whole(path) as temporary:
        _encode(_frames(trace, stage, samples, tell), temporary)
    return len(samples)


def film_samples(time: Float) -> NDArray[np.int64]:
    """The samples (K,) that are shown: of each frame's time the latest one before it."""
    ticks = np.arange(time[0], time[-1] + 0.5 / FRAME_RATE, 1.0 / FRAME_RATE)
    return np.clip(np.searchsorted(time, ticks + 1e-9, side="right") - 1, 0, len(time) - 1)


def _encode(frames: Iterator[Image], path: Path) -> None:
    import av

    with av.open(str(path), "w", format="mp4") as film:
        stream = film.add_stream("libx264", rate=FRAME_RATE, options={"crf": QUALITY, "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = FAR_WIDTH + CLOSE_WIDTH, HEIGHT + STRIP, "yuv420p"
        for frame in frames:
            film.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        film.mux(stream.encode())


def _frames(
    trace: Trace, stage: Stage, samples: NDArray[np.int64], tell: Callable[[int, int], None]
) -> Iterator[Image]:
    panes = [_pane(stage, stage.far, FAR_WIDTH, 0), _pane(stage, stage.close, CLOSE_WIDTH, FAR_WIDTH)]
    strip = _Strip(trace)
    for done, sample in enumerate(samples.tolist(), start=1):
        frame = np.empty((HEIGHT + STRIP, FAR_WIDTH + CLOSE_WIDTH, 3), dtype=np.uint8)
        for pane in panes:
            seen = over_paper(picture(paint(pane.background.copy(), _moving(stage, sample), pane.camera)))
            frame[:HEIGHT, pane.column : pane.column + seen.shape[1]] = seen
        frame[:HEIGHT, FAR_WIDTH] = FAINT
        frame[HEIGHT:] = strip.at(sample)
        yield frame
        tell(done, len(samples))


def _pane(stage: Stage, camera: Camera, width: int, column: int) -> _Pane:
    still = {b: _mesh(stage, b, 0) for b, fixed in enumerate(stage.still) if fixed}
    camera = camera._replace(distance=camera.distance * max(1.0, HEIGHT / width))  # a narrow pane sees less
    return _Pane(camera, paint(blank(width, HEIGHT), still, camera), column)


def _moving(stage: Stage, sample: int) -> dict[int, Mesh]:
    return {b: _mesh(stage, b, sample) for b, fixed in enumerate(stage.still) if not fixed}


def _mesh(stage: Stage, body: int, sample: int) -> Mesh:
    cut = stage.cut[body]
    if cut is None:
        return stage.placed(body, sample)
    return cut.placed(stage.position[sample, body], stage.quaternion[sample, body])


class _Strip:
    """The strip below: what ran, the time, and the contact force's curve up to now."""

    def __init__(self, trace: Trace) -> None:
        self._time = np.asarray(trace.time, dtype=float)
        self._force = norm(np.nan_to_num(np.asarray(trace.wrench[:, :3], dtype=float)))
        self._meta: dict[str, Any] = trace.meta
        span = max(float(self._time[-1] - self._time[0]), 1e-9)
        top = max(float(self._force.max(initial=0.0)), 1.0)
        x = LEFT + (self._time - self._time[0]) / span * (FAR_WIDTH + CLOSE_WIDTH - 2 * LEFT)
        self._curve = list(zip(x.tolist(), (STRIP - 10 - self._force / top * 38).tolist(), strict=True))

    def at(self, sample: int) -> Image:
        """The strip (STRIP, width, 3) at a sample."""
        from PIL import Image as Picture
        from PIL import ImageDraw, ImageFont

        drawn = Picture.new("RGB", (FAR_WIDTH + CLOSE_WIDTH, STRIP), PAPER)
        pen, font = ImageDraw.Draw(drawn), ImageFont.load_default(15)
        pen.line([(LEFT, STRIP - 10), (FAR_WIDTH + CLOSE_WIDTH - LEFT, STRIP - 10)], fill=FAINT)
        pen.line(self._curve, fill=FAINT, width=1)
        pen.line(self._curve[: sample + 1], fill=FORCE, width=2)
        pen.text((LEFT, 6), self._words(sample), fill=INK, font=font)
        return np.asarray(drawn)

    def _words(self, sample: int) -> str:
        meta = self._meta
        where = " in ".join(str(meta[key]) for key in ("robot", "world") if meta.get(key))
        now = f"{self._time[sample]:5.2f} s    contact force {self._force[sample]:4.1f} N"
        if sample == len(self._time) - 1:
            now += "    goal reached" if meta.get("success") else f"    {meta.get('failure') or 'goal not reached'}"
        return f"{meta.get('skill') or ''}    {where}    {now}".strip()
