"""The methods of the table: LMC, averages, hand-written pushes, learners of motions, and compliance by the force.

Stiffness and wrench profile of the played methods are those that did best for each of them in `worth --tune`, on seeds
that no table uses. "on LMC's axes" is the same motion, followed with the stiffness that LMC learned.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from skillframe_lmc.intervals import track, translation
from skillframe_lmc.sectors import sectors
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned as learned_as
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Float, norm, unit
from tests.figures.teaching import learned
from tests.figures.worth_skills import Row, push_along

HANDWRITTEN = {"plate normal": (0.0, 0.0, -1.0), "along floor": (1.0, 0.0, 0.0)}
QUIET = {"feedforward": False}
TUNED: dict[str, dict[str, Any]] = {
    "replay": {**QUIET, "stiffness_translation": 1000.0}, "gmr": {**QUIET, "stiffness_translation": 500.0},
    "mean path": {**QUIET, "stiffness_translation": 500.0}, "acp": {"stiffness_translation": 500.0},
    "dmp": QUIET, "seds": QUIET,
}  # fmt: skip
BLEND: dict[str, dict[str, Any]] = {
    "replay": {"blend": 1.0, "mode": "absolute"}, "gmr": {"blend": 1.0, "most_components": 8}, "acp": {"blend": 1.0},
    "mean path": {"blend": 1.0},
}  # fmt: skip


def pushes(shown: Sequence[Demonstration]) -> dict[str, Row]:
    """LMC and the averages."""
    lmc = lmc_row(shown)
    rows = {"LMC": lmc, "LMC, free across": push_along(lmc.push)}
    return rows | {name: push_along(given) for name, given in averages(shown).items()}


def lmc_row(shown: Sequence[Demonstration], at: str | None = "tip", **settings: Any) -> Row:
    """What LMC learns at a point, as a row. None is where the recordings were made."""
    phase = learned(list(shown), at=at, settings=settings)["phases"][0]
    parts, stop, stiffness = [phase["translation"], phase["rotation"]], phase["stop"], np.zeros((6, 6))
    for i, part in enumerate(parts):
        stiffness[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = part["stiffness"]
    way = [np.zeros(3) if p["desired_direction"] is None else np.array(p["desired_direction"]) for p in parts]
    return Row(push=way[0], turn=way[1], stiffness=stiffness, speed=parts[0]["speed"], turning=parts[1]["speed"],
               lead=stop["lead_force_n"], twist=stop["lead_torque_nm"])  # fmt: skip


def averages(demonstrations: Sequence[Demonstration]) -> dict[str, Float]:
    """Pushes that are averages: of motions, of contact forces by size and as unit vectors, and of both."""
    motions = []
    for demonstration in demonstrations:
        tip = np.array(demonstration.meta["frames"]["tip"])
        motions.append(translation(track(demonstration, tip, tip, "base"), Settings()))
    given = [sectors(motion) for motion in motions]
    motion = unit(np.concatenate([g.motion for g in given]).mean(axis=0))
    load = -np.concatenate([m.load[g.contact] for m, g in zip(motions, given, strict=True)])
    force, units = unit(load.mean(axis=0)), unit(unit(load[norm(load) > 0.0]).mean(axis=0))
    return {
        "mean motion": motion, "mean force": force, "bisector": unit(motion + force),
        "mean unit force": units, "bisector, unit force": unit(motion + units),
    }  # fmt: skip


def hand_written(turn: Float, task: Any) -> dict[str, Row]:
    """Pushes along axes of the fixture and of base, with a spiral too, and the push that is known to be right."""
    nulls = {name: turn @ np.array(given) for name, given in HANDWRITTEN.items()} | {"base -z": np.array([0, 0, -1.0])}
    rows = {name: push_along(given) for name, given in nulls.items()}
    rows |= {f"{name}, spiral": Row(push=unit(given), spiral=True) for name, given in nulls.items()}
    return rows | {"true push": push_along(np.array(task.direction))}


def played(shown: Sequence[Demonstration], kinds: Sequence[str], compliance: Float) -> dict[str, Row]:
    """Learners of motions, each alone, and all but `acp` on LMC's axes too."""
    rows: dict[str, Row] = {}
    for kind in kinds:
        document = document_of(kind, shown)
        rows[kind] = Row(document=document)
        if kind != "acp":
            rows[f"{kind}, LMC's axes"] = Row(document=document, compliance=compliance)
    return rows


def document_of(kind: str, shown: Sequence[Demonstration], **settings: Any) -> Document:
    """A skill document of a kind, learned at the tip.

    A replay is of the first demonstration; the mean path is `acp` without its force, a stiff mean motion over time.
    """
    given = list(shown[:1] if kind == "replay" else shown)
    options = LearnOptions(at="tip", settings={**BLEND.get(kind, {}), **TUNED[kind], **settings})
    return learned_as(registry().skill("acp" if kind == "mean path" else kind), given, options)
