"""Segment demonstrations into phases.

The flow of `wrench_hmm` (and `pose_hmm`, driven by poses):

    windows -> features -> EM for K = 1, 2, ... -> best criterion -> transitions -> most likely path -> merge -> gate
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.config import build
from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import Float, norm, rotation_vector
from skillframe_segmenter import changepoints, em, gate, merge, model, pose_gate, runs
from skillframe_segmenter.boundaries import OPTION
from skillframe_segmenter.features import Features, Scales, features, scales, typical_scales
from skillframe_segmenter.model import PhaseModel, Pose0
from skillframe_segmenter.rounds import rounds
from skillframe_segmenter.settings import FEWEST_PER_PHASE, WINDOW_S, Settings
from skillframe_segmenter.windows import Windows, cut_all

SHORT = 3  # windows; shorter runs go to a neighbour
Labels = NDArray[np.intp]


class Prepared(NamedTuple):
    """Demonstrations as data of the model.

    Attributes:
        cut: in windows; point: (3,) observed; scale: of each; seen: features.
        drive: (W, R) regressors of the transitions, by demonstration; going: windows (W,) of each that go round, if
            that is a phase; origin: of poses, if they drive.
    """

    cut: list[Windows]
    point: Float
    scale: list[Scales]
    seen: list[Features]
    drive: list[Float]
    going: list[NDArray[np.bool_]] | None
    origin: Pose0 | None


class Segmented(NamedTuple):
    """A fitted segmentation.

    Attributes:
        fit: of the micro-phases; phase_of: (K,) phase of each.
        paths: micro-phase of every window; labels: phase of every window; both by demonstration.
        criterion: by number of micro-phases.
        round: the phase that goes round, or None.
    """

    fit: em.Fit
    phase_of: Labels
    paths: list[Labels]
    labels: list[Labels]
    criterion: dict[int, float]
    round: int | None = None


def segment(
    demonstrations: Sequence[Demonstration], phases: int | None, settings: Mapping[str, Any], kind: str
) -> Document:
    """`phase_model` and `demonstrations` of a policy file.

    Args:
        demonstrations: one or more.
        phases: number of phases; None finds it.
        settings: by name, see `Settings`.
        kind: "wrench_hmm" or "pose_hmm".

    Raises:
        InputError: demonstrations that cannot be cut, invalid settings, or too many phases.
    """
    chosen = build(Settings, settings, "--set")
    prepared = prepare(demonstrations, chosen, kind)
    data = em.gather(prepared.seen, prepared.drive, chosen, prepared.going)
    shortest = min(range(len(prepared.cut)), key=lambda i: prepared.cut[i].size)
    most = prepared.cut[shortest].size // FEWEST_PER_PHASE
    if phases is not None and not 1 <= phases <= most:
        raise InputError(
            demonstrations[shortest].source or f"demonstration {shortest + 1}",
            f"is {demonstrations[shortest].duration:.2f} s long, which allows 1 to {most} phases, not {phases}",
            "give fewer --phases, or leave it out",
        )
    found = fit(data, prepared, phases, chosen)
    rows = rows_of(prepared.cut, found.labels, [d.source for d in demonstrations])
    return {"phase_model": _model_of(prepared, found, chosen, kind), "demonstrations": rows}


def refitted(
    document: Document, demonstrations: Sequence[Demonstration], rows: Sequence[Document], said: Set[int],
    phases: int | None, settings: Mapping[str, Any],
) -> Document:  # fmt: skip
    """A segmentation fitted again, with the user's demonstrations held to their rows.

    Args:
        document: of `segment`, its phases joined or not.
        demonstrations: as then.
        rows: `demonstrations` of the document with boundaries moved.
        said: numbers of those to hold.
        phases: as then.
        settings: as then.

    Raises:
        InputError: an interval shorter than a window.
    """
    chosen, kind = build(Settings, settings, "--set"), document["phase_model"]["type"]
    prepared = prepare(demonstrations, chosen, kind)
    data = em.gather(prepared.seen, prepared.drive, chosen, prepared.going)
    before = fit(data, prepared, phases, chosen)._replace(phase_of=np.array(document["phase_model"]["phase_of"]))
    found = _refit(data, prepared, before, rows, said, chosen)
    again = rows_of(prepared.cut, found.labels, [d.source for d in demonstrations])
    for row, each in zip(again, rows, strict=True):
        row |= {key: each[key] for key in ("found", "set") if key in each}
    for i in said:
        if len(again[i]["boundaries"]) != len(rows[i]["boundaries"]):
            where = again[i]["file"] or f"demonstration {i + 1}"
            raise InputError(where, f"has an interval shorter than a window of {WINDOW_S:g} s", f"fix {OPTION}")
        again[i]["boundaries"] = rows[i]["boundaries"]
    return {"phase_model": _model_of(prepared, found, chosen, kind), "demonstrations": again}


def _model_of(prepared: Prepared, found: Segmented, settings: Settings, kind: str) -> Document:
    document = model.to_document(online_model(prepared, found, settings), kind)
    document["criterion"] = {str(k): value for k, value in found.criterion.items()}
    if found.round is not None:
        document["round"] = found.round
    return document


def prepare(demonstrations: Sequence[Demonstration], settings: Settings, kind: str) -> Prepared:
    """Windows, features and regressors of the transitions."""
    cut, point = cut_all(demonstrations, settings.at, settings.axes)
    scale = scales(cut)
    seen = [features(w, s) for w, s in zip(cut, scale, strict=True)]
    going = rounds(cut, seen)
    if kind == "pose_hmm":
        position = np.concatenate([w.position for w in cut])
        rotation = np.concatenate([w.rotation for w in cut])
        left, _, right = np.linalg.svd(rotation.mean(axis=0))
        mean = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        spread = [
            np.sqrt(position.var(axis=0).sum()),
            np.sqrt((rotation_vector(rotation @ mean.T) ** 2).sum(-1).mean()),
        ]
        origin = Pose0(position=position.mean(axis=0), rotation=mean, spread=np.maximum(spread, [1e-3, 1e-2]))
        drive = [pose_regressors(w.position, w.rotation, origin) for w in cut]
        return Prepared(cut, point, scale, seen, drive, going, origin)
    return Prepared(cut, point, scale, seen, [f.regressors for f in seen], going, None)


def pose_regressors(position: Float, rotation: Float, origin: Pose0) -> Float:
    """Phi (..., 7) of poses: displacement and turn from the mean pose over their spread, and 1."""
    moved_by = (position - origin.position) / origin.spread[0]
    turned_by = rotation_vector(rotation @ origin.rotation.T) / origin.spread[1]
    return np.concatenate([moved_by, turned_by, np.ones((*position.shape[:-1], 1))], axis=-1)


def fit(data: em.Data, prepared: Prepared, phases: int | None, settings: Settings) -> Segmented:
    """Phases of prepared demonstrations, numbered by first appearance."""
    signals = [np.hstack([f.motion, 0.5 * f.contact]) for f in prepared.seen]
    goes_round = data.going is not None
    if phases == 1 or not data.straight.any():
        data, phases = data._replace(going=None), 1
    cut = changepoints.segments([x[mine] for x, mine in zip(signals, data.split(data.straight), strict=True)])
    tried = {k: em.best(data, cut, k, settings) for k in (_numbers(data, settings) if phases is None else [phases])}
    chosen = em.with_transitions(data, min(tried.values(), key=lambda f: f.criterion), settings)
    paths = em.paths(data, chosen.model)
    tidy = [runs.without_short(path, SHORT) for path in paths]
    count = chosen.model.count
    groups = np.arange(count)
    if phases is None:
        travelled = np.concatenate([WINDOW_S * np.cumsum(w.motion, axis=0) for w in prepared.cut])
        straight = count - (data.going is not None)
        groups[:straight] = merge.groups_of_one_motion(
            data.seen, travelled, tidy, straight, settings.merge_angle_rad, settings.merge_votes
        )
    labels = [runs.without_short(groups[path], SHORT if phases else _shortest(path)) for path in tidy]
    criteria = {k: f.criterion for k, f in tried.items()}
    return _numbered(Segmented(chosen, groups, paths, labels, criteria, count - 1 if goes_round else None))


def _numbers(data: em.Data, settings: Settings) -> range:
    free = [int(each.sum()) for each in data.split(data.straight)]
    most = min(settings.phases_max, min((n for n in free if n >= FEWEST_PER_PHASE), default=0) // FEWEST_PER_PHASE)
    going = int(data.going is not None)
    return range(1 + going, max(most, 1) + going + 1)


def _shortest(path: Labels) -> int:
    return int(np.clip(round(0.05 * len(path)), 5, 8))  # windows, of the demonstration


def _numbered(found: Segmented) -> Segmented:
    """Phases by first appearance, micro-phases of empty ones joined to the nearest motion."""
    number = runs.in_order(found.labels)
    direction = found.fit.model.phases.direction
    kept = np.array([k for k, g in enumerate(found.phase_of) if int(g) in number])
    nearest = [k if int(g) in number else kept[int(norm(direction[kept] - direction[k]).argmin())]
               for k, g in enumerate(found.phase_of)]  # fmt: skip
    phase_of = np.array([number[int(found.phase_of[k])] for k in nearest], dtype=np.intp)
    labels = [np.array([number[int(x)] for x in each], dtype=np.intp) for each in found.labels]
    turning = None if found.round is None else number.get(found.round)
    return found._replace(phase_of=phase_of, labels=labels, round=turning)


def _refit(
    data: em.Data, prepared: Prepared, found: Segmented, rows: Sequence[Document], said: Set[int], settings: Settings
) -> Segmented:
    k = len(found.phase_of)
    ruled = [
        np.where(found.phase_of == _labels_of(rows[i], w)[:, None], 0.0, em.NEVER)
        if i in said
        else np.zeros((w.size, k))
        for i, w in enumerate(prepared.cut)
    ]
    going = None
    if data.going is not None and len(found.phase_of) > 1:
        going = np.concatenate([
            _labels_of(rows[i], w) == found.round if i in said else each
            for i, (w, each) in enumerate(zip(prepared.cut, data.split(data.going), strict=True))
        ])  # fmt: skip
    held = data._replace(going=going, ruled=np.concatenate(ruled))
    start = em.converge(held, found.fit.posterior, settings)
    again = em.with_transitions(held, start, settings)
    paths = em.paths(held, again.model)
    labels = [
        _labels_of(rows[i], w) if i in said else runs.without_short(found.phase_of[path], _shortest(path))
        for i, (w, path) in enumerate(zip(prepared.cut, paths, strict=True))
    ]
    return _numbered(found._replace(fit=again, paths=paths, labels=labels))


def _labels_of(row: Document, cut: Windows) -> Labels:
    middle = np.array(cut.edges(range(cut.size))) + 0.5 * (cut.edges([1])[0] - cut.start)
    return np.array(row["labels"], dtype=np.intp)[np.searchsorted(row["boundaries"], middle)]


def rows_of(cut: Sequence[Windows], labels: Sequence[Labels], names: Sequence[str]) -> list[Document]:
    """`demonstrations` of a policy file."""
    result = []
    for w, each, name in zip(cut, labels, names, strict=True):
        starts = runs.starts_of_runs(each)
        cuts = w.edges([int(i) for i in starts[1:]])
        result.append({
            "file": name, "start": w.start, "end": w.edges([w.size])[0], "boundaries": cuts,
            "labels": [int(x) for x in each[starts]],
        })  # fmt: skip
    return result


def online_model(prepared: Prepared, found: Segmented, settings: Settings) -> PhaseModel:
    """The model that follows the phases online."""
    chosen = found.fit.model
    kind = gate if prepared.origin is None else pose_gate
    return PhaseModel(
        at=prepared.point, axes=settings.axes, scales=typical_scales(prepared.scale), temper=chosen.temper,
        phase_of=found.phase_of, phases=chosen.phases, initial=chosen.initial, weights=chosen.weights,
        gate=kind.fit(prepared.drive, found.fit.posterior, found.paths),
        successors=successors(found.labels, int(found.phase_of.max()) + 1),
        switch_posterior=settings.switch_posterior, switch_windows=settings.switch_windows, origin=prepared.origin,
    )  # fmt: skip


def successors(labels: Sequence[Labels], phases: int) -> Float:
    """(P, P + 1) counts of successions, the last column ends."""
    counts = np.zeros((phases, phases + 1))
    for each in labels:
        order = [int(x) for x in each[runs.starts_of_runs(each)]]
        for one, two in pairwise([*order, phases]):
            counts[one, two] += 1.0
    return counts
