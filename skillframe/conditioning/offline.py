"""A whole demonstration conditioned after the fact: bias and tool weight removed, wrench filtered or smoothed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.contact import first_free_air
from skillframe.conditioning.cored import cored
from skillframe.conditioning.noise import LEAST_SAMPLES, model_of, noise_figures
from skillframe.conditioning.payload import Payload, gravity_in_tool, identify_payload, refuse_absurd
from skillframe.demonstration.faults.fault import COPY, SATURATED, Flaw, kept
from skillframe.demonstration.faults.find import alive, faults, with_named
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import Stall, kept_stalls, stalls
from skillframe.errors import InputError
from skillframe.frames import Float, matrix_from_quaternion, norm, rotate_spatial
from skillframe.signals.kalman import WrenchFilter, WrenchModel

METHODS = ("smoother", "filter", "none")
LEAST_STRETCH = 0.2
LEAST_DOUBT = 0.5
CONDITIONING = "conditioning"
"""Metadata key of what was done to a wrench here."""
VERBS = {COPY: "is copied", SATURATED: "saturates"}


class Removed(NamedTuple):
    """A demonstration without bias (and weight), and what was taken off.

    Attributes:
        demonstration: what remains.
        payload: what was identified; `mass` is 0 where only the bias was removed.
        stretch: the free-air stretch that was used [s].
        live: (T,) samples whose wrench is what the sensor measured.
    """

    demonstration: Demonstration
    payload: Payload
    stretch: tuple[float, float]
    live: NDArray[np.bool_]


class _Scanned(NamedTuple):
    """What is wrong with a demonstration, and which of its (T,) samples are what the sensor measured."""

    held: list[Stall]
    found: list[Flaw]
    live: NDArray[np.bool_]


def _scanned(demonstration: Demonstration) -> _Scanned:
    """A wrench that was conditioned here hides its faults, and its metadata name them: it is not looked at again."""
    d = demonstration
    if CONDITIONING in d.meta:
        held, found = kept_stalls(d.meta, d.source), kept(d.meta, d.source)
    else:
        held = stalls(d)
        found = faults(d, held)
    return _Scanned(held, found, alive(d, held, found))


def smooth(demonstration: Demonstration, model: WrenchModel | None = None) -> Demonstration:
    """The demonstration with its wrench smoothed over time, which shifts nothing in time.

    Args:
        demonstration: as recorded.
        model: noise figures, for a smoother (Rauch-Tung-Striebel) with these and no other. If not given they are
            identified, and the smoother is the one of `conditioning.cored`.
    """
    return _with_filter(demonstration, model, "smoother")


def filter_wrench(demonstration: Demonstration, model: WrenchModel | None = None) -> Demonstration:
    """The demonstration with its wrench filtered causally. Takes the arguments of `smooth`."""
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


def remove_bias(
    demonstration: Demonstration, stretch: tuple[float, float] | None = None, weight: bool | None = None
) -> Removed:
    """Bias, and the tool's weight where it is in the wrench, identified in free air and taken off throughout.

    Args:
        demonstration: as recorded.
        stretch: free-air stretch [s]; by default all of it if the metadata says `contact = false`, else from the start
            to the first contact.
        weight: whether the wrench holds the tool's weight; the metadata's word if not given.

    Raises:
        InputError: the stretch is shorter than 0.2 s or holds a stall or fault, no free air is known, or what was
            identified cannot be a tool.
    """
    d = demonstration
    held, found, live = _scanned(d)
    stretch = stretch or _free_air(d, live)
    inside = (d.time >= stretch[0]) & (d.time <= stretch[1])
    if not np.all(live[inside]):
        raise InputError(
            d.source or "demonstration",
            f"the wrench {_fault_within(held, found, stretch)} within {stretch[0]:.3g} to {stretch[1]:.3g} s, so that "
            "it shows no free air there",
            "name a sound stretch (skillframe demonstration check shows what is wrong), or leave the bias (--no-bias)",
        )  # fmt: skip
    if stretch[1] - stretch[0] < LEAST_STRETCH or inside.sum() < 2:
        raise InputError(
            d.source or "demonstration",
            f"free air from {stretch[0]:.3g} to {stretch[1]:.3g} s is too short to find a bias",
            "name a stretch without contact (--free-air FROM,TO), or leave the bias (--no-bias)",
        )  # fmt: skip
    said = d.meta.get("wrench", {})
    weight = bool(said.get("includes_tool_weight")) if weight is None else weight
    payload = payload_of(d, inside)
    if weight:
        refuse_absurd(payload, _typical_noise(d, live), d.source or "demonstration", stretch)
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
    """What is wrong with the wrench in a stretch, as a verb."""
    if any(s.start <= stretch[1] and stretch[0] <= s.stop for s in held):
        return "stalls"
    kinds = {f.kind for f in found if f.start <= stretch[1] and stretch[0] <= f.stop}
    return next(verb for kind, verb in VERBS.items() if kind in kinds)


def doubtful_bias(demonstration: Demonstration, removed: Removed) -> float | None:
    """The bias force that was removed [N] where it may have been contact.

    That is, above 0.5 N, if the free air that was found reaches to the end of the recording or scatters by more than
    twice the noise.

    Args:
        demonstration: as recorded.
        removed: what `remove_bias` made of it without being told the stretch.
    """
    d, force = demonstration, float(norm(removed.payload.bias[:3]))
    if d.meta.get("contact") is False or force <= LEAST_DOUBT:
        return None
    noise = float(np.sqrt((noise_figures(d.time, d.wrench, removed.live).quiet[:3] ** 2).mean()))
    steady = removed.payload.residual_force <= 2.0 * noise and removed.stretch[1] < d.time[-1]
    return None if steady else force


def _typical_noise(demonstration: Demonstration, live: NDArray[np.bool_]) -> float:
    """Scatter of the force in motion, rms per axis [N], or 0 where a recording is too short for any."""
    if live.sum() < LEAST_SAMPLES:
        return 0.0
    return float(np.sqrt((noise_figures(demonstration.time, demonstration.wrench, live).typical[:3] ** 2).mean()))


def payload_of(demonstration: Demonstration, inside: Any) -> Payload:
    """Payload identified over chosen samples, in tool axes."""
    rotation = matrix_from_quaternion(demonstration.quaternion[inside])
    back = np.swapaxes(rotation, -1, -2)
    return identify_payload(rotate_spatial(back, demonstration.wrench[inside]), gravity_in_tool(rotation))


def _without_mass(demonstration: Demonstration, inside: Any, payload: Payload) -> Payload:
    """The bias alone: the weight was removed before."""
    back = np.swapaxes(matrix_from_quaternion(demonstration.quaternion[inside]), -1, -2)
    reading: Float = rotate_spatial(back, demonstration.wrench[inside])
    bias = reading.mean(axis=0)
    left = np.sqrt(np.mean((reading - bias) ** 2, axis=0))
    force, torque = float(np.sqrt((left[:3] ** 2).mean())), float(np.sqrt((left[3:] ** 2).mean()))
    return replace(
        payload, bias=bias, mass=0.0, com=np.zeros(3), residual_force=force, residual_torque=torque, advice=""
    )


def _free_air(demonstration: Demonstration, live: NDArray[np.bool_]) -> tuple[float, float]:
    d = demonstration
    if d.meta.get("contact") is False:
        return float(d.time[0]), float(d.time[-1])
    noise = noise_figures(d.time, d.wrench, live)
    return first_free_air(d.time, d.wrench, noise, live, d.source or "demonstration")
