"""Learn a policy from whole demonstrations: cut them into phases, and learn each phase as a skill.

Two phases may be one skill shown from two sides if they never share a demonstration and have the same neighbours, if
both begin demonstrations, or if one is optional on the way from the other or a detour from it. They are joined if one
desired direction explains both, and each can turn the tool about the other's axis. Consecutive phases are joined too if
both are in contact, hold their orientation, and push less than 35 degrees apart, as of a box that touches a wall on its
way into a corner; in free air a push that leans on the friction cone explains too much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from math import cos, inf, radians
from typing import Any

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions, registry
from skillframe.frames import norm
from skillframe_segmenter.agreement import check_agreement
from skillframe_segmenter.air import Learner, learned_in_air
from skillframe_segmenter.boards import learn_places, names_places
from skillframe_segmenter.boundaries import moved, parse_move
from skillframe_segmenter.contacts import at_contact
from skillframe_segmenter.explained import explained
from skillframe_segmenter.segmentation import refitted
from skillframe_segmenter.settings import PHASE_MIN_S, PolicySettings, Settings
from skillframe_segmenter.zvc import ZvcSettings

WRENCHES = "wrench_hmm"
SAME_PUSH = cos(radians(35.0))
OWN = ("segmenter", "skill", "phases", "recoveries", "set_boundary", "places")
BETWEEN = ("recoveries", "set_boundary", "places")  # settings of the whole policy, not of a place


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a policy document, learned by place (`boards`) if the demonstrations name places.

    Settings: `places` (true), `segmenter` (wrench_hmm), `skill` (lmc), `phases` (found), `recoveries` (1),
    `set_boundary` (a list of "DEMONSTRATION:BOUNDARY=SECONDS", counted as they stand without it), and those of the
    segmenter and the phases' learner.

    Raises:
        InputError: demonstrations that cannot be cut or do not agree, or an unknown setting.
        UnknownName: no such segmenter or skill.
    """
    own, cutting, learning = _sorted(options)
    if own["places"] and names_places(demonstrations):
        each = replace(options, settings={k: v for k, v in options.settings.items() if k not in BETWEEN})
        return learn_places(demonstrations, each, own["recoveries"], bool(own["set_boundary"]), learn)
    segmenter = registry().segmenter(own["segmenter"])
    names = [d.source for d in demonstrations]
    moves = [parse_move(text, names) for text in own["set_boundary"] or ()]
    found = segmenter.fit(demonstrations, own["phases"], cutting)
    options = LearnOptions(at=options.at, hand=options.hand, axes=options.axes, settings=learning)
    if own["phases"] is None:
        found = _joined(found, demonstrations, own["skill"], options, stand_ins=False)
    check_agreement(found["demonstrations"], demonstrations)
    if own["phases"] is None:
        found = _joined(found, demonstrations, own["skill"], options, stand_ins=True)
        if found["phase_model"].get("type") == WRENCHES and not moves:
            found = at_contact(found, demonstrations, segmenter.fit, cutting)
    if moves:
        rows = moved(found["demonstrations"], moves, names)
        if "phase_of" not in found["phase_model"]:  # no model of micro-phases to fit again
            found = {**found, "demonstrations": list(rows)}
        else:
            found = refitted(found, demonstrations, rows, {m.demonstration for m in moves}, own["phases"], cutting)
            check_agreement(found["demonstrations"], demonstrations)
    parts = [pieces(found, demonstrations, [k]) for k in range(_count(found))]
    bodies = [learned_in_air(_learner(own["skill"]), each, options) for each in parts]
    return {
        **{key: value for key, value in bodies[0].items() if key in ("frame", *_alike(bodies))},
        "phases": [as_phase(body, own["skill"], _alike(bodies)) for body in bodies],
        "recoveries": own["recoveries"],
        "phase_min_s": PHASE_MIN_S,
        "explained": explained(found["demonstrations"], demonstrations, options.at, options.axes),
        **found,
    }


def _alike(bodies: Sequence[Document]) -> list[str]:
    """Keys beside `phases` that all learned phases share."""
    return [key for key, value in bodies[0].items() if key != "phases" and all(b.get(key) == value for b in bodies)]


def as_phase(body: Document, skill: str, shared: Sequence[str]) -> Document:
    """A learned phase in a policy, with the keys of its own beside `phases`."""
    beside = {key: value for key, value in body.items() if key not in ("phases", "frame", *shared)}
    return {**body["phases"][0], "skill": skill, **({"beside": beside} if beside else {})}


def _sorted(options: LearnOptions) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Settings of the policy, of the segmenter, and of the phases' learner."""
    own: dict[str, Any] = {key: PolicySettings.__dataclass_fields__[key].default for key in OWN}
    own |= {key: value for key, value in options.settings.items() if key in OWN}
    names = {*Settings.__dataclass_fields__, *ZvcSettings.__dataclass_fields__}
    cutting = {key: value for key, value in options.settings.items() if key in names}
    learning = {k: v for k, v in options.settings.items() if k not in names and k not in OWN}
    for key in ("phases", "recoveries"):
        value = own[key]
        if value is not None and (not isinstance(value, int) or isinstance(value, bool) or value < 0):
            raise InputError(f"--set {key}", f"{value!r} is not a whole number", "give one")
    return own, {**cutting, "at": options.at, "axes": options.axes}, learning


def _count(found: Document) -> int:
    return len(found["phase_model"]["successors"])


def pieces(found: Document, demonstrations: Sequence[Demonstration], phases: Sequence[int]) -> list[Demonstration]:
    """Parts of all demonstrations in some phases, very short ones only if there are no others.

    Neighbouring intervals stay one part.
    """
    result = []
    for row, demonstration in zip(found["demonstrations"], demonstrations, strict=True):
        edges = [float(demonstration.time[0]), *row["boundaries"], float(demonstration.time[-1])]
        spans: list[tuple[float, float]] = []
        for (start, stop), label in zip(pairwise(edges), row["labels"], strict=True):
            if label in phases:
                joins = bool(spans) and spans[-1][1] == start
                spans = [*spans[:-1], (spans[-1][0], stop)] if joins else [*spans, (start, stop)]
        result += [demonstration.between(*span) for span in spans]
    long = [piece for piece in result if piece.duration >= 0.25]  # s
    return long or result


def _learner(skill: str) -> Learner:
    kind = registry().skill(skill)
    if kind.learn is None:
        raise InputError(f"--skill {skill}", "is not learned from demonstrations", "name one that is, such as lmc")
    return kind.learn


def _joined(
    found: Document, demonstrations: Sequence[Demonstration], skill: str, options: LearnOptions, *, stand_ins: bool
) -> Document:  # fmt: skip
    """The segmentation with phases of one direction joined.

    Consecutive phases in contact may be joined before demonstrations are compared; alternatives only after, or an
    incomplete one would merely lack a phase.
    """
    kind = registry().skill(skill)
    if kind.learn is None:
        return found
    rows = found["demonstrations"]
    bodies = [_learner(skill)(pieces(found, demonstrations, [k]), options) for k in range(_count(found))]
    touching = {k for k in range(_count(found)) if _in_contact(found, demonstrations, k)}
    candidates = [
        ((one, two), pieces(found, demonstrations, [one]) + pieces(found, demonstrations, [two]))
        for one, two in (alternatives(rows) if stand_ins else [])
        if turn_alike(bodies[one], bodies[two])
    ] + [
        ((one, two), pieces(found, demonstrations, [one, two]))
        for one, two in neighbours(rows)
        if {one, two} <= touching and one_push(bodies[one], bodies[two])
    ]
    for (one, two), parts in candidates:
        if found["phase_model"].get("round") in (one, two):
            continue
        if _one_direction(kind.learn, parts, options):
            return _joined(relabelled(found, one, two), demonstrations, skill, options, stand_ins=stand_ins)
    return found


def _one_direction(
    learn_phase: Learner, parts: Sequence[Demonstration], options: LearnOptions
) -> bool:  # fmt: skip
    """Whether one direction explains all parts, and the learner accepts them together."""
    try:
        body = learn_phase(parts, options)
    except InputError:
        return False
    return _part(body, "translation").get("desired_direction") is not None


def neighbours(rows: Sequence[Mapping[str, Any]]) -> list[tuple[int, int]]:
    """Pairs of phases, the smaller first, that follow each other in a demonstration."""
    return sorted({(min(pair), max(pair)) for row in rows for pair in pairwise(row["labels"])})


def _in_contact(found: Document, demonstrations: Sequence[Demonstration], phase: int) -> bool:
    """Whether a phase's median force exceeds the model's scale, False without such a model."""
    scale: float = found["phase_model"].get("scales", {}).get("force", inf)
    force = np.concatenate([norm(piece.wrench[:, :3]) for piece in pieces(found, demonstrations, [phase])])
    return float(np.median(force)) > scale


def _part(body: Document, name: str) -> Mapping[str, Any]:
    part: Mapping[str, Any] = body["phases"][0].get(name) or {}
    return part


def one_push(one: Document, two: Document) -> bool:
    """Whether two learned phases hold their orientation and push the same way."""
    turns = [_part(body, "rotation") for body in (one, two)]
    if any(
        turn.get("desired_direction") or turn.get("compliant_axes") or turn.get("fully_compliant") for turn in turns
    ):
        return False
    a, b = (_part(body, "translation").get("desired_direction") for body in (one, two))
    return a is not None and b is not None and sum(x * y for x, y in zip(a, b, strict=True)) > SAME_PUSH


def turn_alike(one: Document, two: Document) -> bool:
    """Whether each phase can turn the tool about the axis of the other."""
    return all(_gives(_part(a, "rotation"), _part(b, "rotation")) for a, b in ((one, two), (two, one)))


def _gives(turn: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether a phase that turns as `turn` may turn about the desired axis of the other, if any."""
    wanted, own = other.get("desired_direction"), turn.get("desired_direction")
    if wanted is None or turn.get("fully_compliant"):
        return True
    axes = np.array([*turn.get("compliant_axes", []), *([] if own is None else [own])]).reshape(-1, 3)
    base = np.linalg.svd(axes, full_matrices=False)
    return float(norm(base[2][base[1] > 0.1] @ np.array(wanted))) > SAME_PUSH


def alternatives(rows: Sequence[Mapping[str, Any]]) -> list[tuple[int, int]]:
    """Pairs that begin demonstrations, or never share one and have the same neighbours, or of which one is optional."""
    labels = [list(row["labels"]) for row in rows]
    firsts = {each[0] for each in labels}
    phases = sorted({label for each in labels for label in each})
    steps = [(a, b) for each in labels for a, b in pairwise([-1, *each, -2])]

    def neighbours(phase: int) -> tuple[set[int], set[int]]:
        return {a for a, b in steps if b == phase}, {b for a, b in steps if a == phase}

    def apart(one: int, two: int) -> bool:
        return not any(one in each and two in each for each in labels)

    def optional(one: int, two: int) -> bool:
        """Whether `two` comes after `one` only, and elsewhere `one` goes where `two` goes."""
        before, after = neighbours(two)
        return before == {one} and after <= neighbours(one)[1]

    def detour(one: int, two: int) -> bool:
        """Whether `two` comes after `one` only, and demonstrations without it are like others."""
        taken_out = [[k for k, _ in groupby(k for k in each if k != two)] for each in labels if two in each]
        return neighbours(two)[0] == {one} and all(each in labels for each in taken_out)

    def alike(one: int, two: int) -> bool:
        same_place = apart(one, two) and neighbours(one) == neighbours(two)
        left_out = any(optional(*pair) or detour(*pair) for pair in ((one, two), (two, one)))
        return {one, two} <= firsts or same_place or left_out

    return [(one, two) for i, one in enumerate(phases) for two in phases[i + 1 :] if alike(one, two)]


def relabelled(found: Document, one: int, two: int) -> Document:
    """The segmentation with phase `two` counted as `one`, and later ones renumbered."""
    count = _count(found)
    number = [one if k == two else k - (k > two) for k in range(count)]
    rows: list[Document] = []
    for row in found["demonstrations"]:
        labels, cuts = [number[k] for k in row["labels"]], row["boundaries"]
        kept = [i for i in range(1, len(labels)) if labels[i] != labels[i - 1]]
        new = [labels[0], *(labels[i] for i in kept)]
        rows.append({**row, "boundaries": [cuts[i - 1] for i in kept], "labels": new})
    counts = [[0.0] * count for _ in range(count - 1)]
    for row in rows:
        for before, after in pairwise([*row["labels"], count - 1]):
            counts[before][after] += 1.0
    model = {**found["phase_model"], "successors": counts}
    if "round" in model:
        model["round"] = number[model["round"]]
    if "phase_of" in model:
        model["phase_of"] = [number[k] for k in model["phase_of"]]
    return {**found, "phase_model": model, "demonstrations": rows}
