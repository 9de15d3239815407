r"""A wrench frame that metadata declare and the data contradict. Only an explicit declaration is judged.

Two signatures, both our choice:

- Weight and bias. A sensor on a turning tool reads a bias fixed in the tool and a weight fixed in base. In tool axes
  \(F = b + R^T w\), in base axes \(F = w + R b\). Both are fitted robustly to the first quarter, half, three quarters
  and all of the recording, since contact comes late; the declared frame is refused if its median residual exceeds
  0.5 N and five times the other's in one of them. Constant forces in either frame satisfy both models, so that a
  contact force that turns with the tool is no contradiction. A weight that is declared to be in the wrench must also
  turn in tool axes (and not in base axes).
- Work. A passive environment cannot push the tool along. Over the motion in contact, with
  \(c = \int F \cdot dx / \int |F| |dx|\), the declared frame is refused if its c is above 0.3, the other's below -0.3,
  for the wrench as it is and less its mean of the first 0.25 s: it may hold a bias that nobody has removed yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from skillframe.demonstration.columns import FORCE, POSITION, Columns
from skillframe.errors import InputError
from skillframe.frames import Float, norm, rotate, rotation_vector

SAMPLES, ROUNDS = 400, 8
SHARES = (0.25, 0.5, 0.75, 1.0)
LEAST_TURN = np.deg2rad(20.0)
LEAST_RESIDUAL, RESIDUAL_RATIO = 0.5, 5.0
LEAST_PATH, WORK_COSINE, WORK_RATE, WORK_FORCE = 0.02, 0.3, 20.0, 3.0
LEAST_WEIGHT = 2.0
LEVEL_TIME = 0.25


class Turning(NamedTuple):
    """A tool's attitude (T, 3, 3) in base, and the torque on it (T, 3) at its point, base axes [N m]."""

    rotation: Float
    torque: Float


def refuse_contradiction(columns: Columns, rotation: Float, declared: Mapping[str, Any]) -> None:
    """Refuse a declared wrench frame that the data contradict.

    Args:
        columns: the file's, with the wrench as recorded.
        rotation: (T, 3, 3) tool attitude in base.
        declared: from `convention.declared_wrench`.

    Raises:
        InputError: with the evidence.
    """
    frame = declared.get("frame")
    if frame is None:
        return
    force = columns.stack(FORCE)
    evidence = weight_evidence(force, rotation, frame, bool(declared.get("includes_tool_weight")))
    if evidence is None and not declared.get("includes_tool_weight"):
        sign = -1.0 if declared.get("sign") == "teacher" else 1.0
        evidence = _work_evidence(columns.stack(POSITION), sign * force, rotation, columns["t"], frame)
    if evidence is not None:
        other = "tool" if frame == "base" else "base"
        raise InputError(
            f"{columns.source}: wrench.frame", f"says {frame!r}, but {evidence}",
            f"say {other!r} if the sensor's axes were mislabelled, or check wrench.sign and the pose's columns",
        )  # fmt: skip


def fit_weight_and_bias(force: Float, rotation: Float, frame: str) -> tuple[Float, float]:
    """Robust fit of \\(F = c + M d\\) with M = R^T (tool axes) or R (base axes).

    Returns:
        (6,) c and d [N], and the median residual [N].
    """
    matrix = rotation if frame == "base" else np.swapaxes(rotation, -1, -2)
    design = np.concatenate([np.broadcast_to(np.eye(3), matrix.shape), matrix], axis=-1)
    weight = np.ones(len(force))
    solution: Float = np.zeros(6)
    residual = norm(force)
    for _ in range(ROUNDS):
        scaled = (design * weight[:, None, None]).reshape(-1, 6)
        solution = np.asarray(np.linalg.lstsq(scaled, (force * weight[:, None]).ravel(), rcond=1e-6)[0], dtype=float)
        residual = norm(force - design @ solution)
        weight = 1.0 / np.sqrt(np.maximum(residual, 1e-3 + 0.1 * np.median(residual)))
    return solution, float(np.median(residual))


def weight_evidence(force: Float, rotation: Float, frame: str, weighs: bool = False) -> str | None:
    """Evidence that forces (T, 3), said to be in these axes, are in the others, or None if there is none."""
    pick = np.linspace(0, len(force) - 1, min(SAMPLES, len(force))).round().astype(int)
    force, rotation = force[pick], rotation[pick]
    other = "tool" if frame == "base" else "base"
    for share in SHARES:
        part = slice(0, max(2, round(share * len(force))))
        if norm(rotation_vector(rotation[0].T @ rotation[part])).max() < LEAST_TURN:
            continue
        ours = fit_weight_and_bias(force[part], rotation[part], frame)[1]
        theirs = fit_weight_and_bias(force[part], rotation[part], other)[1]
        if ours > LEAST_RESIDUAL and ours > RESIDUAL_RATIO * theirs:
            return (
                f"weight and bias on the turning tool explain it in {other} axes to {theirs:.2f} N, "
                f"in {frame} axes only to {ours:.2f} N"
            )
        if weighs and (evidence := _still_weight(force[part], rotation[part], frame)) is not None:
            return evidence
    return None


def _still_weight(force: Float, rotation: Float, frame: str) -> str | None:
    """A weight, said to be in the wrench, that stands still in tool axes or turns in base axes."""
    in_frame, in_other = force, rotate(rotation if frame == "tool" else np.swapaxes(rotation, -1, -2), force)
    spread, other_spread = (float(np.median(norm(f - np.median(f, axis=0)))) for f in (in_frame, in_other))
    if frame == "tool" and spread < 0.1 * other_spread and other_spread > LEAST_WEIGHT:
        return (
            f"the weight does not turn with the tool (spread {spread:.2f} N in tool axes, {other_spread:.2f} N in base)"
        )
    if frame == "base" and other_spread < 0.1 * spread and spread > LEAST_WEIGHT:
        return f"the weight turns in base axes (spread {spread:.2f} N there, {other_spread:.2f} N in tool axes)"
    return None


def work_cosine(position: Float, force: Float, time: Float, turning: Turning | None = None) -> tuple[float, float]:
    """Work of a force over the motion in contact, as a share of \\(\\int |F| |dx|\\), and that motion's length [m].

    Contact is where the force exceeds 3 N and 30 % of its 95th percentile; steps are taken at 20 Hz, to keep noise out.
    With `turning`, work and share are those of the whole wrench, \\(\\int F \\cdot dx + T \\cdot d\\varphi\\) over
    \\(\\int |F| |dx| + |T| |d\\varphi|\\): where a tool levers, force and torque do opposite work.
    """
    stride = max(1, round(1.0 / (WORK_RATE * float(np.median(np.diff(time))))))
    step = np.diff(position[::stride], axis=0)
    middle = force[::stride][: len(step)]
    strength = norm(middle)
    touching = strength > max(WORK_FORCE, 0.3 * float(np.quantile(norm(force), 0.95)))
    length = norm(step)[touching]
    total = float((strength[touching] * length).sum())
    work = float((middle[touching] * step[touching]).sum())
    if turning is not None:
        attitude, torque = turning.rotation[::stride], turning.torque[::stride][: len(step)][touching]
        turn = rotate(attitude[:-1], rotation_vector(np.swapaxes(attitude[:-1], -1, -2) @ attitude[1:]))[touching]
        total += float((norm(torque) * norm(turn)).sum())
        work += float((torque * turn).sum())
    return (work / total if total > 0.0 else 0.0), float(length.sum())


def _work_evidence(position: Float, force: Float, rotation: Float, time: Float, frame: str) -> str | None:
    evidence = None
    for level in (force[time <= time[0] + LEVEL_TIME].mean(axis=0), np.zeros(3)):
        turned = rotate(rotation, force - level)
        in_base, wrong = (force - level, turned) if frame == "base" else (turned, force - level)
        ours, path = work_cosine(position, in_base, time)
        theirs, _ = work_cosine(position, wrong, time)
        if not (path > LEAST_PATH and ours > WORK_COSINE and theirs < -WORK_COSINE):
            return None
        evidence = (
            f"it would push the tool along (work {ours:+.0%} of |F||dx| over {path * 1e3:.0f} mm), "
            f"otherwise oppose it ({theirs:+.0%})"
        )
    return evidence
