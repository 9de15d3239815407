r"""Axes and sign of a recorded wrench, from weight and work.

Weight: a sensor on a turning tool reads \(F = b + R^T w\) in tool axes or \(F = w + R b\) in base axes. The axes are
those whose fit leaves a fifth of the other's residual, and w points down for the environment's wrench. Work: contact
does not push the tool along. This only excludes combinations of axes and sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skillframe.demonstration import (
    LEAST_PATH,
    LEAST_RESIDUAL,
    LEAST_WEIGHT,
    LEVEL_TIME,
    MOST_WEIGHT,
    RESIDUAL_RATIO,
    SHARES,
    Demonstration,
    fit_weight_and_bias,
    work_cosine,
)
from skillframe.frames import Float, norm, quaternion_from_matrix, rotate
from skillframe_recordings.orientation_doubts import tared
from skillframe_recordings.proposal.orientations import SAMPLES, weight_left
from skillframe_recordings.thresholds import PROPOSAL

FRAMES, SIGNS = ("base", "tool"), ("environment", "teacher")


class Known(NamedTuple):
    """Stated axes and sign, None if unknown, and the source of the axes.

    Attributes:
        orientation: whether the orientation is known, which tool axes require.
    """

    frame: str | None = None
    sign: str | None = None
    said: str = ""
    orientation: bool = True


class WrenchVerdict(NamedTuple):
    """Axes ("base", "tool") and sign ("environment", "teacher") of a wrench, None if undetermined, and reasons.

    Attributes:
        weighs: whether it includes the tool's weight.
        excluded: whether the default, base axes and the environment's sign, is impossible.
    """

    frame: str | None
    sign: str | None
    weighs: bool
    reasons: list[str]
    open: list[str]
    excluded: bool = False


def judge_wrench(time: Float, position: Float | None, rotation: Float, force: Float, known: Known) -> WrenchVerdict:
    """Return axes and sign of a recorded force (T, 3).

    Args:
        time: (T,) [s].
        position: (T, 3) [m], or None.
        rotation: (T, 3, 3) orientation in base.
        force: [N].
        known: what is given or stated by the layout.
    """
    found = _by_weight(time, rotation, force)
    frame, sign = known.frame or found.frame, known.sign or found.sign
    reasons, unsure = list(found.reasons), []
    if known.frame is not None and known.said:
        reasons.append(f"wrench axes: {known.frame}, {known.said}")
    pairs = [(f, s) for f in ([frame] if frame else FRAMES) for s in ([sign] if sign else SIGNS)]
    left, told = _by_work(time, position, rotation, force, pairs, known.orientation)
    if not left:
        return WrenchVerdict(
            frame, known.sign, found.weighs, reasons, [f"whose force it is: {told} (--set wrench-sign)"]
        )
    frames, signs = {f for f, _ in left}, {s for _, s in left}
    if frame is None and len(frames) == 1:
        frame = left[0][0]
        reasons.append(f"wrench axes: {frame}; {told}")
    if sign is None and len(signs) == 1:
        sign = left[0][1]
        reasons.append(f"wrench sign: {sign}; {told}")
    lines = " or ".join(typed(f if len(frames) > 1 else None, s if len(signs) > 1 else None) for f, s in left)
    weight = ""
    if "tool" in frames and frame is None:
        wrench = np.concatenate([rotate(rotation, force), np.zeros_like(force)], axis=1)
        quaternion = quaternion_from_matrix(rotation)
        read = Demonstration(time=time, position=np.zeros_like(force), quaternion=quaternion, wrench=wrench, source="")
        weight = "".join(f"; in tool axes, {text}" for text in tared(read))
    if len(frames) > 1 and len(signs) > 1 and len(left) < len(pairs):
        excluded = ("base", "environment") not in left
        unsure.append(f"axes and sign of the wrench: {told}: type {lines}{weight}")
        return WrenchVerdict(frame, sign, found.weighs, reasons, unsure, excluded)
    if len(frames) > 1:
        unsure.append(
            "the wrench's axes: the recording does not determine them; type --set wrench-frame=base or --set "
            f"wrench-frame=tool, which a sensor on the tool usually has{weight}"
        )
    if len(signs) > 1:
        unsure.append(
            "whose force it is: the recording does not determine it; type --set wrench-sign=environment or "
            "--set wrench-sign=teacher"
        )
    return WrenchVerdict(frame, sign, found.weighs, reasons, unsure)


def typed(frame: str | None, sign: str | None) -> str:
    """Return the options for axes and sign."""
    said = (("frame", frame), ("sign", sign))
    return " ".join(f"--set wrench-{name}={value}" for name, value in said if value is not None)


class _Weighed(NamedTuple):
    frame: str | None = None
    sign: str | None = None
    weighs: bool = False
    reasons: Sequence[str] = ()


def _by_weight(time: Float, rotation: Float, force: Float) -> _Weighed:
    """Axes and sign from a weight that turns in one of the axes and is present from the start."""
    fits = {frame: weight_left(force, rotation, frame) for frame in FRAMES}
    for part, share in enumerate(SHARES):
        ours = min(fits, key=lambda frame: fits[frame][part])
        best, other = sorted(fits[frame][part] for frame in fits)
        if not np.isfinite(other) or not other > max(LEAST_RESIDUAL, RESIDUAL_RATIO * best):
            continue
        count = max(2, round(share * min(SAMPLES, len(force))))
        pick = np.linspace(0, len(force) - 1, min(SAMPLES, len(force))).round().astype(int)[:count]
        solution = fit_weight_and_bias(force[pick], rotation[pick], ours)[0]
        start = time <= time[0] + LEVEL_TIME
        turned = np.swapaxes(rotation[start], -1, -2) if ours == "tool" else rotation[start]
        explained = solution[:3] + turned @ solution[3:]
        if float(np.median(norm(force[start] - explained))) > max(LEAST_RESIDUAL, RESIDUAL_RATIO * best):
            continue  # a force that comes later is a contact's
        weight = solution[3:] if ours == "tool" else solution[:3]
        size = float(norm(weight))
        reasons = [f"wrench axes: {ours}; weight and bias explain it there to {best:.2f} N, else to {other:.2f} N"]
        if size < LEAST_WEIGHT:
            return _Weighed(ours, None, False, reasons)
        down = float(-weight[2] / size)
        if abs(down) < PROPOSAL.upright or size > MOST_WEIGHT:
            continue  # no weight: it leans, or no arm could carry it
        sign = "environment" if down > 0.0 else "teacher"
        way = "down" if down > 0.0 else "up, so the sensor shows the opposite"
        return _Weighed(ours, sign, True, [*reasons, f"wrench sign: {sign}; a weight of {size:.1f} N points {way}"])
    return _Weighed()


def _by_work(
    time: Float,
    position: Float | None,
    rotation: Float,
    force: Float,
    pairs: Sequence[tuple[str, str]],
    orientation: bool,
) -> tuple[list[tuple[str, str]], str]:
    """Possible pairs of axes and sign, and the work as a sentence.

    Work excludes pairs but does not choose among the rest: in wrong axes, part of the normal force seems to do work.
    """
    if position is None:
        return [*pairs], ""
    free = force - force[time <= time[0] + LEVEL_TIME].mean(axis=0)
    shares, path = {}, 0.0
    for name, turned in (("base", free), *([("tool", rotate(rotation, free))] if orientation else [])):
        shares[name], path = work_cosine(position, turned, time)
    if path < LEAST_PATH:
        return [*pairs], ""
    way = {"environment": 1.0, "teacher": -1.0}
    left = [(f, s) for f, s in pairs if way[s] * shares.get(f, 0.0) <= PROPOSAL.pushed]
    told = ", ".join(
        f"{shares[f]:+.0%} of |F||dx| in {f} axes" for f in dict.fromkeys(f for f, _ in pairs) if f in shares
    )
    return left, f"its work over the motion in contact is {told}, and what is touched does not push the tool along"
