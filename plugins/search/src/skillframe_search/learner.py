"""A search document from blind demonstrations: which way to press, where to look, what is felt on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.demonstration.record import Demonstration
from skillframe.document.frame import frame_of
from skillframe.errors import InputError
from skillframe.extend.records import Document, LearnOptions
from skillframe.frames import Float, norm
from skillframe_search import forces
from skillframe_search.contact import Samples, in_contact, push_direction, samples, surface_axes
from skillframe_search.deadband import Gains, dead_band, freed, friction_of
from skillframe_search.exploration import Exploration, coordinates_of, explored
from skillframe_search.phase import Kind, Path, Phase, Push, Stiffness, Stop

SLOWEST, FASTEST = 0.005, 0.02  # what a demonstrated speed is held to [m/s]
MOVING = 0.002  # m/s: slower is a dwell
KEPT = 300  # places in the evidence, for the picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What can be set for learning. None leaves it to the demonstrations.

    Attributes:
        algorithm: "sampling" or "ergodic", the two published; a baseline has its own.
        feedforward: exert the learned forces; "constant" presses and no more.
        speed, push: [m/s], [N].
        acceleration: [m/s^2].
        contact_n: pressed harder than this is in contact [N].
        stiffness, turn_stiffness: across the push [N/m], of rotation [Nm/rad].
        pitch, layers: of the spiral [m], number of turns of it.
        friction: between tool and surface; None measures it. A spiral that it would hold back by more than its pitch is
            made stiffer and lighter than demonstrated; 0 leaves push and stiffness as they are.
        step, reach: of the random walk [m].
        time, drop: [s], [m]: `Stop`'s.
    """

    algorithm: Literal["sampling", "ergodic"] = "sampling"
    feedforward: Literal["learned", "constant"] = "learned"
    speed: float | None = None
    push: float | None = None
    acceleration: float = 0.3
    contact_n: float = 3.0
    stiffness: float = 2000.0
    turn_stiffness: float = 60.0
    pitch: float = 0.0016
    layers: int = 1
    friction: float | None = None
    step: float = 0.004
    reach: float = 0.02
    time: float = 20.0
    drop: float = 0.003


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions, kind: str = "search") -> Document:
    """The body of a search document. `kind` is "search", "spiral" or "random_walk".

    Raises:
        InputError: no demonstration, one that never touches a surface or searches nothing, or an unknown setting.
        UnknownName: a point that the demonstrations do not know.
    """
    settings = build(Settings, options.settings, "--set")
    frame = frame_of(demonstrations, options)
    at, turned = np.array(frame["learned_at"]), options.axes == "phase_start"
    every = [samples(demonstration, at, turned) for demonstration in demonstrations]
    push = push_direction(every, settings.contact_n)
    parts = [in_contact(found, push, settings.contact_n) for found in every]
    axes = surface_axes(push)
    pooled = Samples(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    found = explored(pooled, axes)
    rate = coordinates_of(pooled.rate, axes)[:, found.columns]
    model, criterion = forces.fit(rate * found.scale, pooled.wrench)
    felt = -(pooled.wrench[:, :3] @ push)
    across = norm(coordinates_of(pooled.rate, axes)[:, :2])
    friction = friction_of(pooled, push) if settings.friction is None else settings.friction
    asked = Gains(float(felt.mean()) if settings.push is None else settings.push, settings.stiffness)
    gains = freed(friction or 0.0, asked, settings.pitch) if kind == "spiral" else asked
    baseline, looked = kind != "search", coordinates_of(pooled.place, axes)[:, found.columns]
    phase = Phase(
        push=Push(direction=_vector(push), force=gains.push),
        searched=found.coordinates,
        exploration=None if baseline else found,
        forces=None if baseline or settings.feedforward == "constant" else model,
        path=_path(kind, settings, found, across),
        stiffness=Stiffness(translation=gains.stiffness, rotation=settings.turn_stiffness),
        stop=Stop(time_s=settings.time, drop_m=settings.drop),
        evidence={**_evidence(every, parts, push, across, criterion, looked), **_held(friction, asked, gains)},
    )
    body = {"frame": frame, "phases": [plain(asdict(phase))], "settings": asdict(settings)}
    return body


def _path(kind: str, settings: Settings, found: Exploration, across: Float) -> Path:
    learned: Kind = "ergodic" if settings.algorithm == "ergodic" else "tour"
    baselines: dict[str, Kind] = {"spiral": "spiral", "random_walk": "random_walk"}
    moving = across[across > MOVING]
    speed = settings.speed
    if speed is None:
        speed = float(np.clip(np.median(moving) if len(moving) else SLOWEST, SLOWEST, FASTEST))
    return Path(
        kind=baselines.get(kind, learned), speed=speed, acceleration=settings.acceleration, pitch=settings.pitch,
        layers=_layers(settings.layers, found), step=settings.step, reach=settings.reach,
    )  # fmt: skip


def _layers(count: int, found: Exploration) -> tuple[float, ...]:
    """Turns of the spiral's layers: 0, then outwards to both sides within three quarters of a standard deviation."""
    if count < 1 or (count > 1 and found.coordinates[-1] != "turn"):
        raise InputError("--set layers", f"{count} layers need a search that turns", "give 1")
    widest = 0.75 * float(np.sqrt(found.covariance[-1][-1])) if count > 1 else 0.0
    turns = np.linspace(-widest, widest, count) if count > 1 else np.zeros(1)
    return tuple(float(t) for t in sorted(turns, key=abs))


def _evidence(
    every: Sequence[Samples],
    parts: Sequence[Samples],
    push: Float,
    across: Float,
    criterion: list[float],
    looked: Float,
) -> dict[str, Any]:
    felt = np.concatenate([-(p.wrench[:, :3] @ push) for p in parts])
    return {
        "contact_share": [len(part.place) / len(whole.place) for part, whole in zip(parts, every, strict=True)],
        "samples": len(felt),
        "push_n": [float(felt.mean()), float(felt.std())],
        "dwelling_share": float((across < MOVING).mean()),
        "criterion": criterion,
        "places": np.round(looked[:: len(looked) // KEPT + 1], 5).tolist(),
    }


def _held(friction: float | None, asked: Gains, gains: Gains) -> dict[str, Any]:
    """What friction does to a compliant search, and from which push and stiffness a spiral was freed."""
    if friction is None:
        return {}
    said = {"friction": friction, "dead_band_m": dead_band(friction, gains)}
    return said if gains == asked else {**said, "freed_from": [asked.push, asked.stiffness, dead_band(friction, asked)]}


def _vector(values: Float) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def plain(value: Any) -> Any:
    """The value with lists for tuples, as it comes back from a file."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value
