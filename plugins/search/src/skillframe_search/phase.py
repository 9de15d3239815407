"""The phase of a search document as checked records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe_search.exploration import COORDINATES, Exploration
from skillframe_search.forces import ForceModel

Kind = Literal["tour", "ergodic", "spiral", "random_walk"]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """Direction [unit vector] and force [N]."""

    direction: Vector
    force: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Trajectory, its limits and the baselines' constants.

    Attributes:
        kind: "tour" (samples), "ergodic", "spiral" or "random_walk".
        speed: limit [m/s]; acceleration: limit [m/s^2].
        pitch: of the spiral [m]; layers: its turns about the normal [rad].
        step, reach: of the random walk [m].
        radius: at which the spiral turns back [m]; 0: never.
        passes: of a spiral with a radius, alternating, each finer and slower.
        inner: radius that is searched first, as the hole is likelier there [m].
    """

    kind: Kind
    speed: float
    acceleration: float
    pitch: float
    layers: tuple[float, ...]
    step: float
    reach: float
    radius: float = 0.0
    passes: int = 1
    inner: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffness:
    """Stiffness across the push [N/m] and of rotation [Nm/rad].

    Attributes:
        turn: about the push [Nm/rad]; None: as of rotation.
    """

    translation: float
    rotation: float
    turn: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dither:
    """Rotating torques that rock the tool while it searches.

    Attributes:
        tilt_nm, tilt_hz: size and frequency of a torque that turns in the surface.
        turn_nm, turn_hz: of one about the push.
    """

    tilt_nm: float = 0.0
    tilt_hz: float = 4.0
    turn_nm: float = 0.0
    turn_hz: float = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Conditions for start and end.

    Attributes:
        touch_n: reaction to the push at which the surface is touched,
        approach_speed: approached at this speed [m/s]; approach_m: over at most this way.
        drop_m: depth below the surface of a part that has fallen in, if
        lost_share: the reaction fell below this share of the push on the way.
        time_s: of searching, after the touch.
        force_limit_n: a contact force above it fails the trial.
    """

    touch_n: float = 3.0
    approach_speed: float = 0.005
    approach_m: float = 0.015
    drop_m: float = 0.003
    lost_share: float = 0.5
    time_s: float = 20.0
    force_limit_n: float = 70.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A search.

    Attributes:
        push: direction and force.
        exploration: where to search; None: around the start.
        forces: force model; None: presses only.
        path, stiffness, stop: trajectory, stiffness and end.
        dither: torques on the way.
        searched: coordinates that the path moves.
        evidence: data that it was learned from.
    """

    name: str = "search"
    push: Push
    searched: tuple[str, ...]
    exploration: Exploration | None
    forces: ForceModel | None
    path: Path
    stiffness: Stiffness
    stop: Stop
    dither: Dither = Dither()
    evidence: dict[str, Any]


def read_phase(document: Document) -> Phase:
    """The phase of a search document.

    Raises:
        InputError: not exactly one phase, or a wrong key or value.
    """
    phases = document["phases"]
    if len(phases) != 1:
        raise InputError("phases", f"a search has one phase, this has {len(phases)}", "learn the skill again")
    phase = build(Phase, phases[0], "phases[0]")
    if abs(float(np.linalg.norm(phase.push.direction)) - 1.0) > 0.01:
        raise InputError("phases[0].push.direction", "should be a unit vector", "divide it by its length")
    positive = {
        "push.force": phase.push.force, "path.speed": phase.path.speed, "path.acceleration": phase.path.acceleration,
        "path.pitch": phase.path.pitch, "path.step": phase.path.step,
        "stiffness.translation": phase.stiffness.translation, "stiffness.rotation": phase.stiffness.rotation,
        "path.layers": float(len(phase.path.layers)),
        **{f"stop.{name}": getattr(phase.stop, name) for name in Stop.__dataclass_fields__},
    }  # fmt: skip
    for key, value in positive.items():
        if not 0.0 < value < 1e6:
            raise InputError(f"phases[0].{key}", f"should be positive, is {value:g}", "fix it, or learn again")
    if not (0.0 <= phase.path.radius < 1.0 and 1 <= phase.path.passes <= 10):
        raise InputError("phases[0].path", "radius should be 0 to 1 m, passes 1 to 10", "fix it, or learn again")
    if phase.stiffness.turn is not None and not 0.0 < phase.stiffness.turn < 1e6:
        raise InputError("phases[0].stiffness.turn", f"should be positive, is {phase.stiffness.turn:g}", "fix it")
    for name in Dither.__dataclass_fields__:
        if not 0.0 <= getattr(phase.dither, name) < 25.0:
            raise InputError(f"phases[0].dither.{name}", "should be 0 to 25 Nm or Hz", "fix it, or learn again")
    if phase.stop.time_s > 300.0:
        raise InputError("phases[0].stop.time_s", "a search longer than 300 s is not planned", "give a shorter time")
    if phase.path.reach < phase.path.step:
        raise InputError("phases[0].path.reach", "is smaller than a step", "give a larger reach")
    _check_exploration(phase)
    return phase


def _check_exploration(phase: Phase) -> None:
    names = list(phase.searched)
    if not names or names != [name for name in COORDINATES if name in names]:
        raise InputError("phases[0].searched", f"should name some of {', '.join(COORDINATES)}, in order", "fix it")
    if phase.path.kind in ("spiral", "random_walk"):
        if names[:2] != list(COORDINATES[:2]):
            raise InputError("phases[0].searched", "a spiral or walk needs across_1 and across_2", "choose tour")
        return
    found = phase.exploration
    if found is None:
        raise InputError("phases[0].exploration", f"is missing for the kind {phase.path.kind}", "learn the skill again")
    k = len(names)
    shape = (found.coordinates, len(found.mean), _shape(found.covariance))
    if shape != (phase.searched, k, (k, k)) or np.linalg.eigvalsh(np.array(found.covariance)).min() <= 0.0:
        raise InputError("phases[0].exploration", "is not a Gaussian over what is searched", "learn the skill again")
    if phase.forces is not None and not _fits(phase.forces, k):
        raise InputError("phases[0].forces", "does not fit what is searched", "learn the skill again")


def _shape(rows: Any) -> tuple[int, ...]:
    try:
        return np.shape(rows)
    except ValueError:
        return (-1,)


def _fits(forces: ForceModel, k: int) -> bool:
    count, width = len(forces.weights), k + 6
    shapes = _shape(forces.means), _shape(forces.covariances)
    if count == 0 or shapes != ((count, width), (count, width, width)) or min(forces.weights) < 0.0:
        return False
    try:
        np.linalg.cholesky(np.array(forces.covariances)[:, :k, :k])
    except np.linalg.LinAlgError:
        return False
    return True
