"""Description of a search in words."""

from __future__ import annotations

import numpy as np

from skillframe.extend import Document
from skillframe_search.phase import Phase, read_phase

WAYS = {
    "tour": "a tour of samples of it",
    "ergodic": "an ergodic trajectory that spends its time as it says",
    "spiral": "an Archimedean spiral around the start, pitch {pitch:.2g} mm",
    "random_walk": "a random walk around the start, steps of {step:.2g} mm",
}
NAMES = {
    "across_1": "one way along the surface", "across_2": "the other way along it",
    "tilt_1": "tilt", "tilt_2": "tilt the other way", "turn": "turn about the push",
}  # fmt: skip


def describe(document: Document) -> list[str]:
    """The lines that describe a document's search."""
    phase = read_phase(document)
    x, y, z = phase.push.direction
    path = phase.path
    way = WAYS[path.kind].format(pitch=1e3 * path.pitch, step=1e3 * path.step)
    bounds = f"at most {1e3 * path.speed:.3g} mm/s and {path.acceleration:.3g} m/s²"
    if path.kind == "spiral" and path.radius:
        way += f" and {1e3 * path.radius:.1f} mm wide, {path.passes} passes"
    return [
        f"press along ({x:.3f}, {y:.3f}, {z:.3f}) with {phase.push.force:.1f} N",
        *_where(phase),
        f"follow {way}, {bounds}, stiffness {phase.stiffness.translation:g} N/m across the push and none along it",
        *_held(phase),
        "press and exert nothing more"
        if phase.forces is None
        else f"exert the forces demonstrated at the same velocity ({len(phase.forces.weights)} components)",
        f"done when {1e3 * phase.stop.drop_m:.3g} mm deeper than the surface and the answer to the push was lost; "
        f"failed after {phase.stop.time_s:g} s of search",
    ]


def _where(phase: Phase) -> list[str]:
    found = phase.exploration
    if found is None:
        return []
    deviation = np.sqrt(np.diag(np.array(found.covariance)))
    lines = []
    for name, mean, spread in zip(found.coordinates, found.mean, deviation, strict=True):
        metric = name.startswith("across")
        factor, unit = (1e3, "mm") if metric else (np.rad2deg(1.0), "degrees")
        lines.append(f"look {NAMES[name]}: {factor * mean:+.2f} {unit} from the start, ±{factor * spread:.2f} {unit}")
    return lines


def _held(phase: Phase) -> list[str]:
    seen = phase.evidence
    if "friction" not in seen or phase.forces is not None:
        return []
    line = f"friction {seen['friction']:.2f} holds the tool up to {1e3 * seen['dead_band_m']:.1f} mm behind its path"
    if "freed_from" in seen:
        push, stiffness, band = seen["freed_from"]
        line += f"; it would be {1e3 * band:.1f} mm with the {push:.1f} N demonstrated and {stiffness:g} N/m"
    return [line]
