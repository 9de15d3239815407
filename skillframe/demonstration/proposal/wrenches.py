r"""Axes and sign of a recorded wrench, as far as weight and work tell them.

Weight: a sensor on a turning tool reads bias and weight. In tool axes they are \(F = b + R^T w\), in base axes
\(F = w + R b\). The axes are those whose fit leaves a fifth of the other's residual, and w points down if the wrench is
the environment's. Work: what the tool touches opposes its motion. The force that does so in base axes may push it along
in tool axes, and then axes and sign cannot be told apart: both pairs are named.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.demonstration.contradiction import (
    LEAST_PATH,
    LEAST_RESIDUAL,
    LEAST_WEIGHT,
    RESIDUAL_RATIO,
    SHARES,
    WORK_COSINE,
    fit_weight_and_bias,
    work_cosine,
)
from skillframe.demonstration.proposal.attitudes import SAMPLES, weight_left
from skillframe.frames import Float, norm, rotate

UPRIGHT = np.cos(np.deg2rad(30.0))
LEVEL_TIME = 0.25


class WrenchVerdict(NamedTuple):
    """Axes ("base", "tool") and sign ("environment", "teacher") of a wrench, None where nothing tells, and reasons.

    Attributes:
        weighs: whether the tool's weight is in it.
    """

    frame: str | None
    sign: str | None
    weighs: bool
    reasons: list[str]
    open: list[str]


def judge_wrench(time: Float, position: Float | None, rotation: Float, force: Float, said: str | None) -> WrenchVerdict:
    """Axes and sign of a force (T, 3) as recorded.

    Args:
        time: (T,) [s].
        position: (T, 3) [m], or None where the file has none.
        rotation: (T, 3, 3) attitude in base.
        force: [N].
        said: axes that a known layout states, to go by where data do not tell.
    """
    frame, sign, weighs, reasons = _by_weight(rotation, force)
    unsure: list[str] = []
    if position is not None and (frame is None or sign is None):
        frame, sign = _by_work(time, position, rotation, force, (frame, sign, said), reasons, unsure)
    if frame is None and said is not None:
        frame = said
        reasons.append(f"wrench axes: {said}, as this layout's makers state")
    if frame is None:
        unsure.append(
            "the wrench's axes: it is taken in base axes; a sensor on the tool usually gives tool axes (--wrench-frame)"
        )
    if sign is None:
        unsure.append("whose force it is: taken as the environment's on the tool (--wrench-sign)")
    return WrenchVerdict(frame, sign, weighs, reasons, unsure)


def _by_weight(rotation: Float, force: Float) -> tuple[str | None, str | None, bool, list[str]]:
    fits = {frame: weight_left(force, rotation, frame) for frame in ("tool", "base")}
    for part, share in enumerate(SHARES):
        ours = min(fits, key=lambda frame: fits[frame][part])
        best, other = sorted(fits[frame][part] for frame in fits)
        if not np.isfinite(other) or not other > max(LEAST_RESIDUAL, RESIDUAL_RATIO * best):
            continue
        count = max(2, round(share * min(SAMPLES, len(force))))
        pick = np.linspace(0, len(force) - 1, min(SAMPLES, len(force))).round().astype(int)[:count]
        solution = fit_weight_and_bias(force[pick], rotation[pick], ours)[0]
        weight = solution[3:] if ours == "tool" else solution[:3]
        size = float(norm(weight))
        reasons = [f"wrench axes: {ours}; weight and bias explain it there to {best:.2f} N, else to {other:.2f} N"]
        if size < LEAST_WEIGHT:
            return ours, None, False, reasons
        down = float(-weight[2] / size)
        if abs(down) < UPRIGHT:
            return (
                ours,
                None,
                True,
                [*reasons, f"its weight of {size:.1f} N leans by {np.rad2deg(np.arccos(abs(down))):.0f} degrees"],
            )
        sign = "environment" if down > 0.0 else "teacher"
        way = "down" if down > 0.0 else "up, so the sensor shows the opposite"
        return ours, sign, True, [*reasons, f"wrench sign: {sign}; a weight of {size:.1f} N points {way}"]
    return None, None, False, []


def _by_work(
    time: Float, position: Float, rotation: Float, force: Float, known: tuple[str | None, str | None, str | None],
    reasons: list[str], unsure: list[str],
) -> tuple[str | None, str | None]:  # fmt: skip
    """Axes and sign from the work over the motion in contact."""
    frame, sign, said = known
    free = force - force[time <= time[0] + LEVEL_TIME].mean(axis=0)
    shares = {}
    for name, turned in (("base", free), ("tool", rotate(rotation, free))):
        shares[name], path = work_cosine(position, turned, time)
    if path < LEAST_PATH or max(map(abs, shares.values())) < WORK_COSINE:
        return frame, sign
    told = ", ".join(f"{share:+.0%} of |F||dx| in {name} axes" for name, share in shares.items())
    if frame is not None:
        share = shares[frame]
        if sign is None and abs(share) > WORK_COSINE:
            sign = "environment" if share < 0.0 else "teacher"
            reasons.append(f"wrench sign: {sign}; its work over the motion in contact is {told}")
        return frame, sign
    base, tool = shares["base"], shares["tool"]
    if base * tool > 0.0:
        sign = "environment" if base < 0.0 else "teacher"
        reasons.append(f"wrench sign: {sign}; its work over the motion in contact is {told}")
        apart = abs(abs(base) - abs(tool))
        if apart > WORK_COSINE and said is None:
            frame = "base" if abs(base) > abs(tool) else "tool"
            reasons.append(f"wrench axes: {frame}, where it bears on the motion more")
        return frame, sign
    if said is not None:
        sign = "environment" if shares[said] < 0.0 else "teacher"
        reasons.append(f"wrench sign: {sign} in {said} axes, which the layout states; its work in contact is {told}")
        return said, sign
    opposing = "base" if base < tool else "tool"
    pushing = "tool" if opposing == "base" else "base"
    unsure.append(
        f"axes and sign of the wrench together: its work in contact is {told}, so it is in {opposing} axes and the "
        f"environment's (proposed), or in {pushing} axes and the teacher's"
    )
    return opposing, "environment"
