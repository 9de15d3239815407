"""MP4 video of a trace: the whole scene, the cut close view, and the contact force.

MuJoCo's renderer draws frames if OpenGL works (`opengl`), else `skillframe_reports.raster`, with a cached background.
Playback is in real time, in H.264 4:2:0 for browsers and office programs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, need
from skillframe.execution import Trace
from skillframe.files import writing_whole
from skillframe.frames import Float, norm
from skillframe_reports import opengl
from skillframe_reports.raster import PAPER, Image, blank, over_paper, paint, picture
from skillframe_reports.shapes import Mesh
from skillframe_reports.stage import Camera, Stage, stage_of

FRAME_RATE = 25
FAR_WIDTH, CLOSE_WIDTH, HEIGHT, STRIP = 400, 560, 480, 80
QUALITY = "20"  # libx264's constant rate factor: nearly lossless to the eye
SUFFIXES = (".mp4", ".m4v", ".mov")
FAINT = (176, 184, 194)
LEFT = 16  # of the force curve [pixels]
OWN = "skillframe's own renderer, because OpenGL draws nothing here (skillframe doctor)"
STOPPED = "skillframe's own renderer, because "


class Film(NamedTuple):
    """A written video: number of frames, and their renderer in words."""

    frames: int
    renderer: str


def check_film(path: Path) -> None:
    """Refuse an unwritable video before a run is spent on it.

    Raises:
        InputError: the file's extension is no video format.
        MissingDependency: the libraries that write it are not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "is not the name of a video", f"let it end in {' or '.join(SUFFIXES)}")
    for library in ("av", "PIL"):
        need(library)


def write_film(trace: Trace, path: Path, tell: Callable[[int, int], None] = lambda done, total: None) -> Film:
    """Write a video of a run, whole or not at all.

    Returns:
        number of frames, and their renderer.

    Raises:
        InputError: the trace holds no geometry, or the file cannot be written.
    """
    check_film(path)
    stage = stage_of(trace)
    if stage is None:
        raise InputError(path, "cannot be drawn: the trace holds no geometry", "write the trace again")
    samples = film_samples(np.asarray(trace.time, dtype=float))
    backend, renderer = opengl.backend(), OWN
    if backend is not None:
        try:
            with writing_whole(path) as temporary:
                _encode(_composed(trace, samples, _by_opengl(stage, samples, backend), tell), temporary)
            return Film(len(samples), f"MuJoCo's renderer (OpenGL by {backend})")
        except opengl.NoPicture as stopped:
            renderer = f"{STOPPED}{stopped}"
    with writing_whole(path) as temporary:
        _encode(_composed(trace, samples, _by_hand(stage, samples), tell), temporary)
    return Film(len(samples), renderer)


def film_samples(time: Float) -> NDArray[np.int64]:
    """Return the samples (K,) to show: the latest before each frame's time."""
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


def _composed(
    trace: Trace, samples: NDArray[np.int64], views: Iterator[list[Image]], tell: Callable[[int, int], None]
) -> Iterator[Image]:
    """Frames (HEIGHT + STRIP, width, 3): two views side by side, and the strip below."""
    strip = _Strip(trace)
    for done, (sample, (far, close)) in enumerate(zip(samples.tolist(), views, strict=True), start=1):
        frame = np.empty((HEIGHT + STRIP, FAR_WIDTH + CLOSE_WIDTH, 3), dtype=np.uint8)
        frame[:HEIGHT, :FAR_WIDTH], frame[:HEIGHT, FAR_WIDTH:] = far, close
        frame[:HEIGHT, FAR_WIDTH] = FAINT
        frame[HEIGHT:] = strip.at(sample)
        yield frame
        tell(done, len(samples))


def _by_hand(stage: Stage, samples: NDArray[np.int64]) -> Iterator[list[Image]]:
    still = {b: _mesh(stage, b, 0) for b, fixed in enumerate(stage.still) if fixed}
    panes = [(camera, paint(blank(width, HEIGHT), still, camera)) for camera, width in _views(stage)]
    for sample in samples.tolist():
        moving = {b: _mesh(stage, b, sample) for b, fixed in enumerate(stage.still) if not fixed}
        yield [over_paper(picture(paint(background.copy(), moving, camera))) for camera, background in panes]


def _by_opengl(stage: Stage, samples: NDArray[np.int64], backend: str) -> Iterator[list[Image]]:
    return opengl.pictures(stage, samples.tolist(), _views(stage), HEIGHT, backend)


def _views(stage: Stage) -> list[tuple[Camera, int]]:
    """Both cameras with picture widths. A narrow picture needs a larger distance."""
    both = ((stage.far, FAR_WIDTH), (stage.close, CLOSE_WIDTH))
    return [(c._replace(distance=c.distance * max(1.0, HEIGHT / width)), width) for c, width in both]


def _mesh(stage: Stage, body: int, sample: int) -> Mesh:
    cut = stage.cut[body]
    if cut is None:
        return stage.placed(body, sample)
    return cut.placed(stage.position[sample, body], stage.quaternion[sample, body])


class _Strip:
    """The strip below: name, time, and the contact force up to now."""

    def __init__(self, trace: Trace) -> None:
        self._time = np.asarray(trace.time, dtype=float)
        self._force = norm(np.nan_to_num(np.asarray(trace.wrench[:, :3], dtype=float)))
        self._meta: dict[str, Any] = trace.meta
        span = max(float(self._time[-1] - self._time[0]), 1e-9)
        top = max(float(self._force.max(initial=0.0)), 1.0)
        x = LEFT + (self._time - self._time[0]) / span * (FAR_WIDTH + CLOSE_WIDTH - 2 * LEFT)
        self._curve = list(zip(x.tolist(), (STRIP - 10 - self._force / top * 38).tolist(), strict=True))

    def at(self, sample: int) -> Image:
        """Return the strip (STRIP, width, 3) at a sample."""
        from PIL import Image as Picture
        from PIL import ImageDraw, ImageFont

        drawn = Picture.new("RGB", (FAR_WIDTH + CLOSE_WIDTH, STRIP), PAPER)
        pen, font = ImageDraw.Draw(drawn), ImageFont.load_default(15)
        pen.line([(LEFT, STRIP - 10), (FAR_WIDTH + CLOSE_WIDTH - LEFT, STRIP - 10)], fill=FAINT)
        pen.line(self._curve, fill=FAINT, width=1)
        pen.line(self._curve[: sample + 1], fill=(204, 60, 46), width=2)
        meta = self._meta
        where = " in ".join(str(meta[key]) for key in ("robot", "world") if meta.get(key))
        now = f"{self._time[sample]:5.2f} s    contact force {self._force[sample]:4.1f} N"
        if sample == len(self._time) - 1:
            now += "    goal reached" if meta.get("success") else f"    {meta.get('failure') or 'goal not reached'}"
        pen.text((LEFT, 6), f"{meta.get('skill') or ''}    {where}    {now}".strip(), fill=(38, 46, 56), font=font)
        return np.asarray(drawn)
