"""Offline conditioning of a demonstration: remove bias and tool weight, filter or smooth the wrench."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import (
    COPY,
    LEAST_SAMPLES,
    LEVEL_TIME,
    SATURATED,
    Demonstration,
    Flaw,
    NoiseFigures,
    Stall,
    alive,
    contact_intervals,
    faults,
    free_air_level,
    kept,
    kept_stalls,
    noise_figures,
    stalls,
    with_named,
)
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate_spatial
from skillframe.signals import WrenchFilter, WrenchModel
from skillframe_recordings.conditioning.payload import Payload, gravity_in_tool, identify_payload, refuse_absurd
from skillframe_recordings.conditioning.quiet_filter import cored
from skillframe_recordings.conditioning.wrench_model import model_of

METHODS = ("smoother", "filter", "none")
CONDITIONING = "conditioning"
"""Metadata key of the conditioning."""
VERBS = {COPY: "is copied", SATURATED: "saturates"}


class Removed(NamedTuple):
    """A demonstration without bias (and weight), and what was removed.

    Attributes:
        demonstration: the result.
        payload: as identified; `mass` is 0 if only the bias was removed.
        stretch: the free-air stretch [s].
        live: (T,) samples with valid sensor readings.
    """

    demonstration: Demonstration
    payload: Payload
    stretch: tuple[float, float]
    live: NDArray[np.bool_]


class _Scanned(NamedTuple):
    """Faults of a demonstration, and its (T,) valid samples."""

    held: list[Stall]
    found: list[Flaw]
    live: NDArray[np.bool_]


def _scanned(demonstration: Demonstration) -> _Scanned:
    """Detect faults, or take them from the metadata of a conditioned wrench, which hides them."""
    d = demonstration
    if CONDITIONING in d.meta:
        held, found = kept_stalls(d.meta, d.source), kept(d.meta, d.source)
    else:
        held = stalls(d)
        found = faults(d, held)
    return _Scanned(held, found, alive(d, held, found))


def smooth(demonstration: Demonstration, model: WrenchModel | None = None) -> Demonstration:
    """Return the demonstration with its wrench smoothed without delay.

    Args:
        demonstration: as recorded.
        model: noise figures of a Rauch-Tung-Striebel smoother; None identifies them for `conditioning.cored`.
    """
    return _with_filter(demonstration, model, "smoother")


def filter_wrench(demonstration: Demonstration, model: WrenchModel | None = None) -> Demonstration:
    """Return the demonstration with its wrench filtered causally. Arguments as for `smooth`."""
    return _with_filter(demonstration, model, "filter")


def _with_filter(demonstration: Demonstration, model: WrenchModel | None, method: str) -> Demonstration:
    d, dt, scanned = demonstration, 1.0 / demonstration.rate, _scanned(demonstration)
    if model is None:
        model = model_of(d, scanned.live)
        wrench, chosen = cored(d.time, d.wrench, model, causal=method == "filter", alive=scanned.live)
    else:
        design = WrenchFilter(model, dt)
        wrench = (design.smooth if method == "smoother" else design.filter)(d.time, d.wrench)
        chosen = {"corner_hz": model.corner(dt).tolist()}
    said = {"method": method, "noise": model.noise.tolist(), **chosen}
    return replace(d, wrench=wrench, meta=_noted(with_named(d.meta, scanned.held, scanned.found), said))


def _noted(meta: dict[str, Any], said: dict[str, Any]) -> dict[str, Any]:
    return {**meta, CONDITIONING: {**meta.get(CONDITIONING, {}), **said}}


def first_free_air(
    time: Float, wrench: Float, noise: NoiseFigures, alive: NDArray[np.bool_] | None = None, where: str = "recording"
) -> tuple[float, float]:
    """Return the stretch [s] from the start to 0.1 s before the first contact, or to the first stall or the end.

    Raises:
        InputError: the recording begins with a stall, after which there may be contact.
    """
    stalled = np.zeros(0, dtype=int) if alive is None else np.flatnonzero(~alive)
    if stalled.size and time[stalled[0]] - time[0] < LEVEL_TIME:
        raise InputError(
            where,
            f"the wrench repeats one value (or shows another fault) from {time[stalled[0]]:.2f} s on, and what follows "
            "may be contact already: no free air is known",
            "name a stretch without contact (--free-air FROM,TO), or leave the bias (--no-bias)",
        )  # fmt: skip
    contacts = contact_intervals(time, wrench, noise, free_air_level(time, wrench), alive)
    ends = [float(time[-1])]
    ends += [contacts[0].start - 0.1] if contacts else []  # [s] before it touches
    ends += [float(time[stalled[0] - 1])] if stalled.size else []
    return float(time[0]), min(ends)


def remove_bias(
    demonstration: Demonstration, stretch: tuple[float, float] | None = None, weight: bool | None = None
) -> Removed:
    """Identify bias and tool weight in free air and remove them.

    Args:
        demonstration: as recorded.
        stretch: free air [s]; by default everything if the metadata says `contact = false`, else from the start to the
            first contact.
        weight: whether the wrench holds the tool's weight; None uses the metadata.

    Raises:
        InputError: the stretch is unknown, below 0.2 s or faulty, or the identified tool is impossible.
    """
    d = demonstration
    held, found, live = _scanned(d)
    if not stretch and d.meta.get("contact") is False:
        stretch = float(d.time[0]), float(d.time[-1])
    elif not stretch:
        noise = noise_figures(d.time, d.wrench, live)
        stretch = first_free_air(d.time, d.wrench, noise, live, d.source or "demonstration")
    inside = (d.time >= stretch[0]) & (d.time <= stretch[1])
    if not np.all(live[inside]):
        raise InputError(
            d.source or "demonstration",
            f"the wrench {_fault_within(held, found, stretch)} within {stretch[0]:.3g} to {stretch[1]:.3g} s, so that "
            "it shows no free air there",
            "name a sound stretch (skillframe check shows what is wrong), or leave the bias (--no-bias)",
        )  # fmt: skip
    if stretch[1] - stretch[0] < 0.2 or inside.sum() < 2:
        raise InputError(
            d.source or "demonstration",
            f"free air from {stretch[0]:.3g} to {stretch[1]:.3g} s is too short to find a bias",
            "name a stretch without contact (--free-air FROM,TO), or leave the bias (--no-bias)",
        )  # fmt: skip
    said = d.meta.get("wrench", {})
    weight = bool(said.get("includes_tool_weight")) if weight is None else weight
    payload = payload_of(d, inside)
    if weight:
        sure = live.sum() >= LEAST_SAMPLES
        typical = noise_figures(d.time, d.wrench, live).typical[:3] if sure else np.zeros(3)  # of the force in motion
        refuse_absurd(payload, float(np.sqrt((typical**2).mean())), d.source or "demonstration", stretch)
    else:
        payload = _without_mass(d, inside, payload)
    wrench = d.wrench - payload.wrench(d.pose.rotation)
    meta = _noted(with_named(d.meta, held, found), {"free_air_s": list(stretch), "payload": payload.as_meta()})
    if weight and not payload.mass:
        meta = {**meta, "wrench": {**said, "includes_tool_weight": True}}
    elif "includes_tool_weight" in said or weight:
        meta = {**meta, "wrench": {**said, "includes_tool_weight": False}}
    return Removed(replace(d, wrench=wrench, meta=meta), payload, stretch, live)


def _fault_within(held: Sequence[Stall], found: Sequence[Flaw], stretch: tuple[float, float]) -> str:
    if any(s.start <= stretch[1] and stretch[0] <= s.stop for s in held):
        return "stalls"
    kinds = {f.kind for f in found if f.start <= stretch[1] and stretch[0] <= f.stop}
    return next(verb for kind, verb in VERBS.items() if kind in kinds)


def doubtful_bias(demonstration: Demonstration, removed: Removed) -> float | None:
    """Return the removed bias force [N] if it may be contact, else None.

    It is doubtful above 0.5 N if the detected free air reaches to the end or scatters by more than twice the noise.

    Args:
        demonstration: as recorded.
        removed: result of `remove_bias` without a given stretch.
    """
    d, force = demonstration, float(norm(removed.payload.bias[:3]))
    if d.meta.get("contact") is False or force <= 0.5:
        return None
    noise = float(np.sqrt((noise_figures(d.time, d.wrench, removed.live).quiet[:3] ** 2).mean()))
    steady = removed.payload.residual_force <= 2.0 * noise and removed.stretch[1] < d.time[-1]
    return None if steady else force


def payload_of(demonstration: Demonstration, inside: Any) -> Payload:
    """Return the payload identified over chosen samples, in tool axes."""
    rotation = matrix_from_quaternion(demonstration.quaternion[inside])
    back = np.swapaxes(rotation, -1, -2)
    return identify_payload(rotate_spatial(back, demonstration.wrench[inside]), gravity_in_tool(rotation))


def _without_mass(demonstration: Demonstration, inside: Any, payload: Payload) -> Payload:
    back = np.swapaxes(matrix_from_quaternion(demonstration.quaternion[inside]), -1, -2)
    reading: Float = rotate_spatial(back, demonstration.wrench[inside])
    bias = reading.mean(axis=0)
    left = np.sqrt(np.mean((reading - bias) ** 2, axis=0))
    force, torque = float(np.sqrt((left[:3] ** 2).mean())), float(np.sqrt((left[3:] ** 2).mean()))
    return replace(
        payload, bias=bias, mass=0.0, com=np.zeros(3), residual_force=force, residual_torque=torque, advice=""
    )
