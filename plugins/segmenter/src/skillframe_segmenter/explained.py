r"""Share of motion and force that the phases explain, against chance.

With x the features of the windows (`features`) and m_k the mean over the windows of phase k in the *other* recordings,

    share = 1 - sum |x_t - m_{k(t)}|^2 / sum |x_t - m|^2

over all windows, m being the mean over all phases of the others; below 0 they mislead. A single recording is judged by
itself, which flatters. Chance is the share with labels shifted cyclically in time, `SHIFTS` times; p = (1 + as good) /
(1 + SHIFTS). As phases were found in these recordings, a small p does not hold for new ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration, contact_evidence
from skillframe.frames import Float
from skillframe_segmenter.features import features, scales
from skillframe_segmenter.settings import WINDOW_S
from skillframe_segmenter.windows import Windows, cut_all

SHIFTS, WITHIN_S = 199, 0.25
CERTAIN = 0.05  # p above which phases are no better than chance
MANY = 4  # changes of contact in a recording that one phase does not explain
Labels = NDArray[np.intp]


def explained(
    rows: Sequence[Mapping[str, Any]], demonstrations: Sequence[Demonstration], at: str | None, axes: str
) -> dict[str, Any]:
    """The entry `explained`: share, chance and p of phases, and the touches at cuts.

    Args:
        rows: `demonstrations` of a segmentation.
        demonstrations: the same.
        at: observed point of the tool.
        axes: "base" or "phase_start".
    """
    cut, _ = cut_all(demonstrations, at, axes)
    seen = [np.hstack([f.motion, f.contact]) for f in map(features, cut, scales(cut))]
    labels = [_labels(row, w) for row, w in zip(rows, cut, strict=True)]
    rng = np.random.default_rng(0)
    turns = [[int(rng.integers(1, len(each))) for each in labels] for _ in range(SHIFTS)]
    share = share_of(seen, labels)
    chance = np.array([share_of(seen, [np.roll(x, n) for x, n in zip(labels, turn, strict=True)]) for turn in turns])
    return {
        "share": share, "chance": float(chance.mean()), "p": float((1 + (chance >= share).sum()) / (1 + SHIFTS)),
        "shifts": SHIFTS, "recordings": len(labels), "cuts": sum(len(row["boundaries"]) for row in rows),
        "touches": _touches(rows, demonstrations, turns),
    }  # fmt: skip


def share_of(seen: Sequence[Float], labels: Sequence[Labels]) -> float:
    """Share that phases explain of features (W, F), each recording judged by the others.

    Args:
        seen: by recording.
        labels: phase of every window (W,), by recording.
    """
    count = 1 + max(int(each.max()) for each in labels)
    member = [np.eye(count)[each] for each in labels]  # (W, K)
    sums = np.array([m.T @ x for m, x in zip(member, seen, strict=True)])
    sizes = np.array([m.sum(axis=0) for m in member])
    left = total = 0.0
    for i, x in enumerate(seen):
        others = [j for j in range(len(seen)) if j != i] or [i]
        size, whole = sizes[others].sum(axis=0), sums[others].sum(axis=0)
        mean = whole.sum(axis=0) / size.sum()
        means = np.where(size[:, None] > 0.0, whole / np.maximum(size, 1.0)[:, None], mean)
        left += float(((x - means[labels[i]]) ** 2).sum())
        total += float(((x - mean) ** 2).sum())
    return 1.0 - left / total if total > 0.0 else 0.0


def _labels(row: Mapping[str, Any], cut: Windows) -> Labels:
    middle = np.array(cut.edges(range(cut.size))) + 0.5 * WINDOW_S
    return np.array(row["labels"], dtype=np.intp)[np.searchsorted(row["boundaries"], middle)]


def _touches(
    rows: Sequence[Mapping[str, Any]], demonstrations: Sequence[Demonstration], turns: Sequence[Sequence[int]]
) -> dict[str, Any]:
    """Counts of contact changes: all, near a cut, and near shifted cuts on average."""
    moments = [np.array([t for c in contact_evidence(d).contacts for t in c[:2]]) for d in demonstrations]
    inner = [
        m[(m > row["start"] + WITHIN_S) & (m < row["end"] - WITHIN_S)] for m, row in zip(moments, rows, strict=True)
    ]
    cuts = [np.array(row["boundaries"]) for row in rows]
    begins, ends = ([row[key] for row in rows] for key in ("start", "end"))

    def near(turn: Sequence[int]) -> int:
        moved = [s + (c - s + n * WINDOW_S) % (e - s) for c, n, s, e in zip(cuts, turn, begins, ends, strict=True)]
        return sum(near_cuts(m, c) for m, c in zip(inner, moved, strict=True))

    return {
        "changes": int(sum(len(m) for m in inner)), "near": near([0] * len(cuts)),
        "chance": float(np.mean([near(turn) for turn in turns])), "within_s": WITHIN_S,
    }  # fmt: skip


def near_cuts(moments: Float, cuts: Float) -> int:
    """Number of moments within `WITHIN_S` of a cut."""
    if not len(cuts):
        return 0
    return int((np.abs(moments[:, None] - cuts).min(axis=1, initial=np.inf) <= WITHIN_S).sum())


def words(found: Mapping[str, Any]) -> list[str]:
    """The lines for phases and contact."""
    alone = " (of one recording by itself, which flatters)" if found["recordings"] == 1 else ""
    verdict = "" if found["p"] <= CERTAIN else "; no better than chance: check the cuts"
    lines = [
        f"phases explain {_percent(found['share'])} of motion and force{alone}, against "
        f"{_percent(found['chance'])} for time-shifted data (p = {found['p']:.2g}, {found['shifts']} shifts){verdict}"
    ]
    touches = found["touches"]
    if not found["cuts"]:
        many = touches["changes"] > MANY * found["recordings"]
        return [f"nothing is cut, though contact begins or ends {_times(touches['changes'])}"] if many else []
    if touches["changes"]:
        lines.append(
            f"contact begins or ends {_times(touches['changes'])}, {touches['near']} of them within "
            f"{touches['within_s']:g} s of a cut; by chance {touches['chance']:.1f}"
        )
    return lines


def _percent(share: float) -> str:
    return f"{round(100.0 * share)}%"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
