"""Draws a trace as a moving SVG: python -m tests.figures.moving_picture RUN.npz FILE.svg.

The left picture is the whole scene, the right one the tool's tip with the fixture cut open. Below is the contact force.

The report's z-buffer says what is seen of each geometry and how bright it is. The picture is contours of that, in four
tones. So hidden surfaces are right, and the file is text. What stands still is drawn once. What moves has one group per
frame, and a style rule shows one after the other. Readers who want no motion get the last frame.

docs/images/peg.svg is the run in README.md, of seed 1.
"""

import sys
from pathlib import Path

import numpy as np
from contourpy import contour_generator
from skillframe_reports.markup import escape
from skillframe_reports.raster import blank, paint
from skillframe_reports.shapes import merge
from skillframe_reports.stage import stage_of

from skillframe.execution.trace import Trace

FRAMES, HOLD = 36, 14
"""Frames of the motion, and how many frames long its end stays."""
SIZE = (470, 430)
"""Width and height of each of the two pictures [px]."""
TONES = (0.0, 0.68, 0.8, 0.92)
"""Brightness, as a share of a geometry's own colour, from which each tone begins."""
SLACK = 1.1
"""How far [px of the fine grid] a simplified contour may be from the contour: it takes off the steps of the grid."""
STILL, REST = 1e-3, 0.5
"""A tip that goes no farther than this [m] has come to rest; so long [s] it is still shown."""
INK, FORCE, TEXT = "#212b38", "#c2410c", "#1f2937"


def simplified(line, slack=SLACK):
    """The points of a polyline (P, 2) that it needs (Douglas and Peucker 1973)."""
    keep = np.zeros(len(line), dtype=bool)
    keep[[0, -1]] = True
    todo = [(0, len(line) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        start, along = line[first], line[last] - line[first]
        away = line[first + 1 : last] - start
        length = np.hypot(*along)
        off = np.hypot(*away.T) if length < 1e-9 else np.abs(along[0] * away[:, 1] - along[1] * away[:, 0]) / length
        if off.max() > slack:
            middle = first + 1 + int(off.argmax())
            keep[middle] = True
            todo += [(first, middle), (middle, last)]
    return line[keep]


def outline_of(mask):
    """The borders of a mask as the text of an SVG path, in half pixels, relative. It is empty where the mask is."""
    padded = np.pad(mask, 1).astype(float)
    texts = []
    for line in contour_generator(z=padded).lines(0.5):
        points = np.round(simplified(line) - 0.5).astype(int)
        steps = np.diff(points, axis=0)
        steps = steps[np.any(steps != 0, axis=1)]
        if len(steps) > 2:
            moves = "".join(f"{x}{y:+d} " if y < 0 else f"{x} {y} " for x, y in steps[:-1])
            texts.append(f"M{points[0, 0]} {points[0, 1]}l{moves.strip()}z".replace(" -", "-"))
    return "".join(texts)


def tones_of(canvas, color, index):
    """(tone, mask) of what is seen of a geometry, the darkest first, each within the one before."""
    own = canvas.owner == index
    bright = canvas.color.sum(axis=-1) / max(float(np.sum(color[:3])), 1e-9)
    for tone, least in enumerate(TONES):
        yield tone, own & (bright >= least)


def drawing(canvas, colors):
    """SVG paths of the geometries with these numbers and colours."""
    paths = []
    for index, color in colors.items():
        for tone, mask in tones_of(canvas, color, index):
            text = outline_of(mask) if mask.any() else ""
            if text:
                shade = min((0.6, 0.74, 0.86, 0.97)[tone], 1.0 / max(*color[:3], 1e-9))
                fill = "#" + "".join(f"{round(255 * min(shade * c, 1.0)):02x}" for c in color[:3])
                edge = ' class="e"' if tone == 0 else ""
                paths.append(f'<path fill="{fill}"{edge} d="{text}"/>')
    return "".join(paths)


def by_color(meshes):
    """The geometries of a body, those of one colour as one: a fixture of many convex parts is one thing to see."""
    groups = {}
    for mesh in meshes:
        if len(mesh.faces):
            groups.setdefault(tuple(mesh.colors[0]), []).append(mesh)
    return [merge(group) for group in groups.values()]


def panel(stage, camera, frames, cut):
    """The still part and the moving part of each frame, as SVG."""
    numbers = {}
    for body in range(len(stage.names)):
        one = stage.cut[body] if cut and stage.cut[body] is not None else None
        for mesh in by_color(stage.whole[body] if one is None else [one]):
            numbers[len(numbers)] = (body, mesh)
    still = {i for i, (body, _) in numbers.items() if stage.still[body]}
    colors = {i: mesh.colors[0] for i, (_, mesh) in numbers.items()}

    def seen(canvas, some, frame):
        placed = {}
        for i in sorted(some):
            body, mesh = numbers[i]
            placed[i] = mesh.placed(stage.position[frame, body], stage.quaternion[frame, body])
        return paint(canvas, placed, camera)

    ground = seen(blank(*SIZE), still, frames[0])
    moving = set(numbers) - still
    texts = [drawing(seen(ground.copy(), moving, frame), {i: colors[i] for i in sorted(moving)}) for frame in frames]
    return drawing(ground, {i: colors[i] for i in sorted(still)}), texts


def ended(trace, tip):
    """The sample up to which there is something to see."""
    moving = np.flatnonzero(np.hypot(np.hypot(*(tip - tip[-1])[:, :2].T), (tip - tip[-1])[:, 2]) > STILL)
    until = trace.time[moving[-1] if len(moving) else 0] + REST
    return int(np.searchsorted(trace.time, min(until, trace.time[-1])))


def force_strip(trace, frames, left, top, width, height):
    """The contact force over time as a line, and where on it each frame is."""
    shown = slice(0, int(frames[-1]) + 1)
    time, wrench = trace.time[shown], trace.wrench_true[shown]
    force = np.hypot(np.hypot(*wrench[:, :2].T), wrench[:, 2])
    most = float(max(force.max(), 1.0))
    x = left + width * (time - time[0]) / max(float(np.ptp(time)), 1e-9)
    y = top + height * (1.0 - force / most)
    line = simplified(np.stack([x, y], axis=1), 0.3)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in line)
    still = (
        f'<path d="M{left} {top + height}h{width}" stroke="#9ca3af" stroke-width="1.5"/>'
        f'<polyline points="{points}" fill="none" stroke="{FORCE}" stroke-width="2.5" stroke-linejoin="round"/>'
        f'<text x="{left}" y="{top - 6}" fill="{FORCE}">contact force, up to {most:.0f} N</text>'
        f'<text x="{left + width}" y="{top - 6}" text-anchor="end">{float(np.ptp(time)):.1f} s</text>'
    )
    return still, [f'<circle cx="{x[f]:.1f}" cy="{y[f]:.1f}" r="7" fill="{FORCE}"/>' for f in frames]


def style(seconds):
    step = 100.0 / (FRAMES + HOLD)
    return (
        "text{font:600 25px system-ui,sans-serif;fill:" + TEXT + "}.e{stroke:" + INK + ";stroke-width:2.4;"
        "stroke-linejoin:round}.f,.z{visibility:hidden}"
        f".f{{animation:f {seconds:.4f}s step-end infinite}}.z{{animation:z {seconds:.4f}s step-end infinite}}"
        f"@keyframes f{{0%{{visibility:visible}}{step:.4f}%{{visibility:hidden}}}}"
        f"@keyframes z{{0%{{visibility:visible}}{step * (HOLD + 0.99):.4f}%{{visibility:hidden}}}}"
        "@media(prefers-reduced-motion:reduce){.f,.z{animation:none}.z{visibility:visible}}"
    )


def moving_picture(trace, title):
    """The SVG of a trace. The same trace gives the same bytes."""
    stage = stage_of(trace)
    last = ended(trace, stage.tip)
    frames = np.round(np.linspace(0, last, FRAMES)).astype(int)
    width, height = SIZE
    whole, close = panel(stage, stage.far, frames, cut=False), panel(stage, stage.close, frames, cut=True)
    strip = force_strip(trace, frames, 30, height + 60, 2 * width - 40, 70)
    duration = float(trace.time[last] - trace.time[0])
    seconds = duration * (FRAMES + HOLD) / FRAMES
    groups = []
    for i, (one, two, dot) in enumerate(zip(whole[1], close[1], strip[1], strict=True)):
        delay = f"animation-delay:{duration * i / FRAMES - seconds:.4f}s"
        kind = "z" if i == FRAMES - 1 else "f"
        moving = (
            f'<g transform="translate(10)scale(.5)">{one}</g><g transform="translate({width + 10})scale(.5)">{two}</g>'
        )
        groups.append(f'<g class="{kind}" style="{delay}">{moving}{dot}</g>\n')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * width + 20} {height + 150}" role="img">\n'
        f"<title>{escape(title)}</title>\n<style>{style(seconds)}</style>\n"
        f'<rect width="100%" height="100%" rx="14" fill="#f6f7f9"/>\n'
        f'<g transform="translate(10)scale(.5)">{whole[0]}</g>'
        f'<g transform="translate({width + 10})scale(.5)">{close[0]}</g>\n{strip[0]}\n' + "".join(groups) + "</svg>\n"
    )


if __name__ == "__main__":
    run = Trace.load(Path(sys.argv[1]))
    name = f"{run.meta['robot']} in {run.meta['world']}"
    Path(sys.argv[2]).write_text(moving_picture(run, name), encoding="utf-8")
