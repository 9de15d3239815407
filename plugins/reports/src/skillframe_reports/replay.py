"""Trace data for the page's 3-D viewer: meshes once per scene, poses per frame, in base64.

Frames are even in time, at most 30 per second and 450, interpolated linearly (quaternions with continuous signs,
normalised in the viewer). Positions are float32 [m], normals signed bytes, colours bytes.
"""

from __future__ import annotations

import base64
import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.execution import Trace
from skillframe.frames import Float, continuous, norm
from skillframe_reports.markup import Markup, tag
from skillframe_reports.shapes import Mesh
from skillframe_reports.stage import Camera, Stage

MOST_FRAMES = 450


def scene_data(stage: Stage) -> dict[str, Any]:
    """Return a stage's geometry: a mesh per body, and its cut version if any."""
    bodies = [
        {"name": name, "still": still, "mesh": _packed(mesh), "cut": None if cut is None else _packed(cut)}
        for name, still, mesh, cut in zip(stage.names, stage.still, stage.meshes, stage.cut, strict=True)
    ]
    return {"bodies": bodies}


def run_data(trace: Trace, stage: Stage, scene: str) -> dict[str, Any]:
    """Return a run's poses, tip, desired tip and force per frame."""
    time = np.asarray(trace.time, dtype=float)
    times = frame_times(time)
    poses = np.concatenate([stage.position, continuous(stage.quaternion)], axis=-1)
    low = np.clip(np.searchsorted(time, times, side="right") - 1, 0, max(len(time) - 2, 0))
    high = np.minimum(low + 1, len(time) - 1)
    span = np.where(time[high] > time[low], time[high] - time[low], 1.0)
    share = np.clip((times - time[low]) / span, 0.0, 1.0)

    def sample(values: Float) -> Float:
        weight = share.reshape(-1, *[1] * (np.ndim(values) - 1))
        result: Float = np.nan_to_num(values[low]) * (1.0 - weight) + np.nan_to_num(values[high]) * weight
        return result

    return {
        "scene": scene,
        "frames": len(times),
        "start": float(times[0]),
        "stop": float(times[-1]),
        "poses": _floats(sample(poses)),
        "point": _floats(sample(stage.tip)),
        "wanted": _floats(sample(stage.wanted)),
        "force": _floats(sample(trace.wrench[:, :3])),
        "peak": float(np.nanmax(norm(np.nan_to_num(trace.wrench[:, :3])), initial=0.0)),
        "close": _camera(stage.close),
        "far": _camera(stage.far),
    }


def scene_key(data: dict[str, Any]) -> str:
    """Return a key of a scene's geometry, which runs share."""
    return "scene-" + hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:12]


def frame_times(time: Float) -> Float:
    """Return even times (K,) from the first to the last sample."""
    span = float(time[-1] - time[0])
    count = int(np.clip(np.ceil(span * 30.0), 1, MOST_FRAMES - 1)) + 1
    return np.linspace(time[0], time[-1], count)


def _packed(mesh: Mesh) -> dict[str, Any]:
    return {
        "vertices": _floats(mesh.vertices),
        "normals": _encoded(np.round(127.0 * mesh.normals).astype("<i1")),
        "colors": _encoded(np.round(255.0 * np.clip(mesh.colors, 0.0, 1.0)).astype("<u1")),
        "faces": _encoded(mesh.faces.astype("<u2" if len(mesh.vertices) < 65536 else "<u4")),
        "wide": len(mesh.vertices) >= 65536,
    }


def _floats(values: Float) -> str:
    return _encoded(np.asarray(values).astype("<f4"))


def _encoded(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "target": [float(v) for v in camera.target],
        "distance": float(camera.distance),
        "azimuth": camera.azimuth,
        "elevation": camera.elevation,
        "fov": camera.field_of_view,
    }


def viewer(identifier: str, label: str) -> Markup:
    """Return the viewer's element. The script finds its data by the identifier."""
    controls = [
        tag("button", "Play", type="button", class_="play", aria_label="Play or pause"),
        tag("input", type="range", class_="slider", min=0, max=1, step=1, value=0, aria_label="Time"),
        tag("output", "0.00 s", class_="clock"),
        tag(
            "select",
            *[tag("option", f"{s}×", value=v, selected=v == "1") for s, v in _SPEEDS],
            class_="speed",
            aria_label="Speed",
        ),
    ]
    switches = [
        _switch("cut", "cut open", True),
        _switch("arrow", "force arrow", True),
        _switch("path", "paths", True),
        tag("button", "Close view", type="button", class_="near", aria_pressed="true"),
        tag("button", "Whole scene", type="button", class_="far", aria_pressed="false"),
    ]
    canvas = tag("canvas", tabindex=0, role="img", aria_label=label)
    return tag(
        "div",
        tag("div", canvas, tag("p", class_="readout"), class_="screen"),
        tag("div", *controls, class_="controls"),
        tag("div", *switches, class_="switches"),
        class_="viewer", data_run=identifier,
    )  # fmt: skip


_SPEEDS = (("¼", "0.25"), ("½", "0.5"), ("1", "1"), ("2", "2"), ("4", "4"))


def _switch(name: str, label: str, on: bool) -> Markup:
    return tag("label", tag("input", type="checkbox", class_=name, checked=on), label)
