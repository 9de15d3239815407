"""Learn a search document from blind demonstrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from skillframe.config import build
from skillframe.demonstration import Demonstration
from skillframe.document import frame_of
from skillframe.errors import InputError
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, norm
from skillframe_search import forces
from skillframe_search.contact import Samples, in_contact, push_direction, samples, surface_axes
from skillframe_search.deadband import Gains, dead_band, freed, friction_of
from skillframe_search.exploration import coordinates_of, explored
from skillframe_search.phase import Path, Phase, Push, Stiffness, Stop

MOVING = 0.002  # m/s: slower is a dwell


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings for learning, where None takes the demonstrated value.

    Attributes:
        algorithm: "sampling" or "ergodic" explore where the demonstrations did; "spiral" and "random_walk" around the
            start, for comparison, and only press.
        feedforward: "learned" exerts the learned forces; "constant" only presses.
        speed, push: [m/s], [N].
        acceleration: [m/s^2].
        contact_n: a larger push is contact [N].
        stiffness, turn_stiffness: across the push [N/m], of rotation [Nm/rad].
        pitch, layers: of the spiral [m], number of turns of it.
        friction: between tool and surface; None measures it. A spiral that lags by more than its pitch becomes stiffer
            and lighter; 0 keeps push and stiffness.
        step, reach: of the random walk [m].
        time, drop: [s], [m]: `Stop`'s.
    """

    algorithm: Literal["sampling", "ergodic", "spiral", "random_walk"] = "sampling"
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


def learn(demonstrations: Sequence[Demonstration], options: LearnOptions) -> Document:
    """Body of a search document.

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
    gains = freed(friction or 0.0, asked, settings.pitch) if settings.algorithm == "spiral" else asked
    baseline = settings.algorithm in ("spiral", "random_walk")
    looked = coordinates_of(pooled.place, axes)[:, found.columns]
    moving = across[across > MOVING]
    speed = settings.speed
    if speed is None:
        slowest, fastest = 0.005, 0.02  # bounds of a demonstrated speed [m/s]
        speed = float(np.clip(np.median(moving) if len(moving) else slowest, slowest, fastest))
    if settings.layers < 1 or (settings.layers > 1 and found.coordinates[-1] != "turn"):
        raise InputError("--set layers", f"{settings.layers} layers need a search that turns", "give 1")
    held: dict[str, Any] = {}  # effect of friction, and the gains before `freed`
    if friction is not None:
        held = {"friction": friction, "dead_band_m": dead_band(friction, gains)}
        if gains != asked:
            held["freed_from"] = [asked.push, asked.stiffness, dead_band(friction, asked)]
    # the spiral's layers: 0, then turns to both sides within 3/4 standard deviation
    widest = 0.75 * float(np.sqrt(found.covariance[-1][-1])) if settings.layers > 1 else 0.0
    turns = np.linspace(-widest, widest, settings.layers) if settings.layers > 1 else np.zeros(1)
    phase = Phase(
        push=Push(direction=(float(push[0]), float(push[1]), float(push[2])), force=gains.push),
        searched=found.coordinates,
        exploration=None if baseline else found,
        forces=None if baseline or settings.feedforward == "constant" else model,
        path=Path(
            kind="tour" if settings.algorithm == "sampling" else settings.algorithm,
            speed=speed,
            acceleration=settings.acceleration,
            pitch=settings.pitch,
            layers=tuple(float(t) for t in sorted(turns, key=abs)),
            step=settings.step,
            reach=settings.reach,
        ),
        stiffness=Stiffness(translation=gains.stiffness, rotation=settings.turn_stiffness),
        stop=Stop(time_s=settings.time, drop_m=settings.drop),
        evidence={**_evidence(every, parts, push, across, criterion, looked), **held},
    )
    body = {"frame": frame, "phases": [plain(asdict(phase))], "settings": asdict(settings)}
    return body


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
        "places": np.round(looked[:: len(looked) // 300 + 1], 5).tolist(),  # places for the picture
    }


def plain(value: Any) -> Any:
    """The value with lists for tuples, as read from a file."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value
